// Purpose: the library's one exception type.
#pragma once

#include <stdexcept>
#include <string>

namespace efsi {

// Values equal the EFSI_ERROR_* constants of the C API (checked in capi/guard.hpp).
enum class ErrorCode : int {
  kInternal = 1,
  kArgument = 2,
  kMesh = 3,
  kDiverged = 4,
  kIo = 5,
  kMemory = 6,
  kCancelled = 7,
  kCheckpoint = 8,
};

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace efsi
