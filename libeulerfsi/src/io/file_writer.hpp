// Purpose: files that are either there in full or not at all.
#pragma once

#include <string>
#include <string_view>

namespace efsi::io {

// Writes `bytes` to `path` by way of a temporary file in the same folder that is flushed to disk and renamed: `path`
// holds either what it held before or all of `bytes`. Throws Error(kIo) naming path and reason (folder missing or not
// writable, disk full, ...); the temporary file is then removed.
void replace_file(const std::string& path, std::string_view bytes);

}  // namespace efsi::io
