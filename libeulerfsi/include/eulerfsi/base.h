/* eulerfsi: export macro, status codes, errors, version, log callback.
 *
 * Every function returns an EfsiStatus. Functions that act on a simulation store a message that
 * efsi_simulation_last_error() returns; functions without one fill an optional EfsiError.
 * All quantities are SI (metre, kilogram, second, pascal) unless a comment says otherwise.
 */
#ifndef EULERFSI_BASE_H
#define EULERFSI_BASE_H

#include <stddef.h>
#include <stdint.h>

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

#define EFSI_VERSION_MAJOR 0
#define EFSI_VERSION_MINOR 1
#define EFSI_VERSION_PATCH 0

typedef int32_t EfsiStatus;
#define EFSI_OK 0               /* success */
#define EFSI_ERROR_INTERNAL 1   /* a defect of the library */
#define EFSI_ERROR_ARGUMENT 2   /* a value is refused; the message names field, value and limit */
#define EFSI_ERROR_MESH 3       /* a mesh cannot become a solid */
#define EFSI_ERROR_DIVERGED 4   /* the state went bad; the state is the last good one */
#define EFSI_ERROR_IO 5         /* a file cannot be read or written */
#define EFSI_ERROR_MEMORY 6     /* not enough memory */
#define EFSI_ERROR_CANCELLED 7  /* the progress callback asked to stop; the state is the last completed step */
#define EFSI_ERROR_CHECKPOINT 8 /* the checkpoint belongs to another scene or another version */

/* Where functions without a simulation put their message. `status` repeats the return value. */
typedef struct EfsiError {
  EfsiStatus status;
  char message[1020]; /* UTF-8, zero-terminated */
} EfsiError;

typedef struct EfsiVec3 {
  double x, y, z;
} EfsiVec3;

#define EFSI_LOG_INFO 0
#define EFSI_LOG_WARNING 1
/* Called on the caller's thread only, during a call into the library. */
typedef void (*EfsiLogCallback)(void* user, int32_t level, const char* message);

/* Version of the loaded library; any pointer may be NULL. */
EFSI_API EfsiStatus efsi_version(int32_t* major, int32_t* minor, int32_t* patch);
/* Short English name of a status, never NULL; lives as long as the library. */
EFSI_API const char* efsi_status_text(EfsiStatus status);

#ifdef __cplusplus
}
#endif
#endif
