// Purpose: base.h: version, status texts; the error struct.
#include <cstring>

#include "capi/guard.hpp"

namespace efsi::capi {

void fill_error(EfsiError* error, EfsiStatus status, const char* text) noexcept {
  if (!error) return;
  error->status = status;
  std::size_t length = std::strlen(text);
  if (length >= sizeof(error->message)) {
    length = sizeof(error->message) - 1;
    // Bytes 10xxxxxx continue a character: the cut is moved before its first byte.
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xc0u) == 0x80u) --length;
  }
  std::memcpy(error->message, text, length);
  std::memset(error->message + length, 0, sizeof(error->message) - length);
}

}  // namespace efsi::capi

EfsiStatus efsi_version(int32_t* major, int32_t* minor, int32_t* patch) {
  if (major) *major = EFSI_VERSION_MAJOR;
  if (minor) *minor = EFSI_VERSION_MINOR;
  if (patch) *patch = EFSI_VERSION_PATCH;
  return EFSI_OK;
}

const char* efsi_status_text(EfsiStatus status) {
  switch (status) {
    case EFSI_OK:
      return "success";
    case EFSI_ERROR_INTERNAL:
      return "internal error";
    case EFSI_ERROR_ARGUMENT:
      return "invalid argument";
    case EFSI_ERROR_MESH:
      return "unusable mesh";
    case EFSI_ERROR_DIVERGED:
      return "diverged";
    case EFSI_ERROR_IO:
      return "input/output error";
    case EFSI_ERROR_MEMORY:
      return "not enough memory";
    case EFSI_ERROR_CANCELLED:
      return "cancelled";
    case EFSI_ERROR_CHECKPOINT:
      return "checkpoint of another scene or version";
    default:
      return "unknown status";
  }
}
