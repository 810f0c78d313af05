/** @file
 * eulerfsi: export macro, status codes, errors, version, log callback.
 *
 * Functions return an EfsiStatus unless their declaration shows another type. A function that acts on a simulation
 * stores the message of a failure, which efsi_simulation_last_error() returns; the others write it to an optional
 * EfsiError. Every function returns EFSI_ERROR_ARGUMENT for a required pointer that is NULL, an unknown id and a value
 * outside its limits, EFSI_ERROR_MEMORY when memory runs out and EFSI_ERROR_INTERNAL for a defect of the library;
 * comments name the other errors only. All quantities are SI (metre, kilogram, second, pascal) unless a comment says
 * otherwise.
 *
 * Structs grow at their end only. A caller tells the size that a struct has in its header, so that a caller compiled
 * against an older header is served by a newer library: fields that it does not know keep their defaults and are not
 * written. Where a caller's struct is larger than the library's, the call is refused with EFSI_ERROR_ARGUMENT, and the
 * message names the last field that the library knows. EfsiError, EfsiVec3, EfsiMeshView and EfsiEnergy never change.
 */
#ifndef EULERFSI_BASE_H
#define EULERFSI_BASE_H

#include <stddef.h>
#include <stdint.h>

/** Marks the functions that the library exports. */
#if defined(_WIN32)
#if defined(EFSI_BUILDING)
#define EFSI_API __declspec(dllexport)
#else
#define EFSI_API __declspec(dllimport)
#endif
#else
#define EFSI_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** Version of the headers: changes with the ABI. */
#define EFSI_VERSION_MAJOR 0
/** Version of the headers: changes with additions. */
#define EFSI_VERSION_MINOR 2
/** Version of the headers: changes with corrections. */
#define EFSI_VERSION_PATCH 0

/** Result of a call. */
typedef enum EfsiStatusCode {
  EFSI_OK = 0,               /**< success */
  EFSI_ERROR_INTERNAL = 1,   /**< a defect of the library */
  EFSI_ERROR_ARGUMENT = 2,   /**< an invalid value; the message names field, value and limit */
  EFSI_ERROR_MESH = 3,       /**< a mesh that does not define a solid */
  EFSI_ERROR_DIVERGED = 4,   /**< the run diverged; the state is that of the last valid step */
  EFSI_ERROR_IO = 5,         /**< a file that cannot be read or written */
  EFSI_ERROR_MEMORY = 6,     /**< not enough memory */
  EFSI_ERROR_CANCELLED = 7,  /**< stopped by the progress callback; the state is that of the last completed step */
  EFSI_ERROR_CHECKPOINT = 8, /**< a checkpoint of another scene or another version */
} EfsiStatusCode;

/** A value of EfsiStatusCode. */
typedef int32_t EfsiStatus;

/** Error of a function that does not act on a simulation. */
typedef struct EfsiError {
  EfsiStatus status;  /**< that the call returned */
  char message[1020]; /**< UTF-8, zero-terminated */
} EfsiError;

/** Shapes of the region of an emitter or a force. */
typedef enum EfsiRegionShape {
  EFSI_REGION_BOX = 0,    /**< [-1/2,1/2]^3 */
  EFSI_REGION_SPHERE = 1, /**< of radius 1/2 */
  EFSI_REGION_COUNT = 2,  /**< number of shapes */
} EfsiRegionShape;

/** A vector. */
typedef struct EfsiVec3 {
  double x, y, z; /**< component along the axis */
} EfsiVec3;

/** Levels of log messages. */
typedef enum EfsiLogLevel {
  EFSI_LOG_INFO = 0,    /**< what happens */
  EFSI_LOG_WARNING = 1, /**< what may not be as wanted */
} EfsiLogLevel;

/** Receives a log message, a `level` of EfsiLogLevel. Runs on the caller's thread, during a call into the library. */
typedef void (*EfsiLogCallback)(void* user, int32_t level, const char* message);

/** Returns the version of the loaded library; any pointer may be NULL.
 * @param[out] major EFSI_VERSION_MAJOR of the headers that it was built from
 * @param[out] minor likewise
 * @param[out] patch likewise */
EFSI_API EfsiStatus efsi_version(int32_t* major, int32_t* minor, int32_t* patch);

/** Returns a short English name of a status, never NULL; valid as long as the library is loaded.
 * @param status any number */
EFSI_API const char* efsi_status_text(EfsiStatus status);

#ifdef __cplusplus
}
#endif
#endif
