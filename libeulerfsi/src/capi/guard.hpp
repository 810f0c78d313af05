// Purpose: the wall itself: no exception leaves the library. guarded() turns them into a status and a message.
#pragma once

#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "capi/handle.hpp"

namespace efsi::capi {

static_assert(EFSI_ERROR_INTERNAL == static_cast<int>(ErrorCode::kInternal));
static_assert(EFSI_ERROR_ARGUMENT == static_cast<int>(ErrorCode::kArgument));
static_assert(EFSI_ERROR_MESH == static_cast<int>(ErrorCode::kMesh));
static_assert(EFSI_ERROR_DIVERGED == static_cast<int>(ErrorCode::kDiverged));
static_assert(EFSI_ERROR_IO == static_cast<int>(ErrorCode::kIo));
static_assert(EFSI_ERROR_MEMORY == static_cast<int>(ErrorCode::kMemory));
static_assert(EFSI_ERROR_CANCELLED == static_cast<int>(ErrorCode::kCancelled));
static_assert(EFSI_ERROR_CHECKPOINT == static_cast<int>(ErrorCode::kCheckpoint));

// Runs fn(); on an exception returns its status and calls report(text), which must not throw.
template <class Fn, class Report>
EfsiStatus run_guarded(const Fn& fn, const Report& report) noexcept {
  try {
    fn();
    return EFSI_OK;
  } catch (const Error& error) {
    report(error.what());
    return static_cast<EfsiStatus>(error.code());
  } catch (const std::bad_alloc&) {
    report("not enough memory");
    return EFSI_ERROR_MEMORY;
  } catch (const std::length_error&) {  // a container larger than the address space
    report("not enough memory");
    return EFSI_ERROR_MEMORY;
  } catch (const std::exception& error) {
    report(error.what());
    return EFSI_ERROR_INTERNAL;
  } catch (...) {
    report("an exception that is no std::exception");
    return EFSI_ERROR_INTERNAL;
  }
}

// For calls on a simulation: the message goes to efsi_simulation_last_error(). sim NULL: EFSI_ERROR_ARGUMENT.
template <class Fn>
EfsiStatus guarded(const EfsiSim* sim, const Fn& fn) noexcept {
  if (!sim) return EFSI_ERROR_ARGUMENT;
  return run_guarded(fn, [&](const char* text) noexcept {
    try {
      sim->last_error = text;
    } catch (...) {
      sim->last_error.clear();
    }
  });
}

// Writes status and text, cut at a whole UTF-8 character where it is too long. error may be NULL.
void fill_error(EfsiError* error, EfsiStatus status, const char* text) noexcept;

// For calls without a simulation: the message goes to *error, which may be NULL.
template <class Fn>
EfsiStatus guarded(EfsiError* error, const Fn& fn) noexcept {
  fill_error(error, EFSI_OK, "");
  const EfsiStatus status = run_guarded(fn, [&](const char* text) noexcept { fill_error(error, EFSI_OK, text); });
  if (error) error->status = status;
  return status;
}

// Refuses a pointer that is NULL; what: "efsi_solid_add: def".
template <class T>
void demand(const T* pointer, const char* what) {
  if (!pointer) throw Error(ErrorCode::kArgument, std::string(what) + " is NULL");
}

// The same for a path, which must not be empty either.
inline void demand_path(const char* path, const char* what) {
  demand(path, what);
  if (!*path) throw Error(ErrorCode::kArgument, std::string(what) + " is empty");
}

}  // namespace efsi::capi
