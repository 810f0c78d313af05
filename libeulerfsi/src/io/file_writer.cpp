// Purpose: files that are either there in full or not at all.
#include "io/file_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "base/error.hpp"

namespace efsi::io {

namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what, int code) {
  throw Error(ErrorCode::kIo, path + ": " + what + ": " + std::generic_category().message(code));
}

// An open temporary file, removed unless it was renamed.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& path) : target_(path) {
    const std::filesystem::path target(path);
    const std::string start = (target.parent_path() / ("." + target.filename().string() + ".")).string();
    // The process id tells processes apart; the number tells apart threads and what a killed run left behind.
    for (int number = 0; descriptor_ < 0; ++number) {
      const std::string name = start + std::to_string(::getpid()) + "-" + std::to_string(number) + ".tmp";
      descriptor_ = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (descriptor_ >= 0) {
        name_ = name;
      } else if (errno != EEXIST) {
        fail(target_, "cannot be written", errno);
      }
    }
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!name_.empty()) ::unlink(name_.c_str());
  }

  void write(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(target_, "cannot be written", errno);
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }

  void commit() {
    if (::fsync(descriptor_) != 0) fail(target_, "cannot be flushed to disk", errno);
    const int closed = ::close(descriptor_);
    descriptor_ = -1;
    if (closed != 0) fail(target_, "cannot be written", errno);
    if (::rename(name_.c_str(), target_.c_str()) != 0) fail(target_, "cannot be replaced", errno);
    name_.clear();
  }

 private:
  std::string target_, name_;
  int descriptor_ = -1;
};

// Makes a rename in the folder last; file systems that cannot flush folders are left alone.
void flush_folder(const std::string& path) {
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

void replace_file(const std::string& path, std::string_view bytes) {
  TemporaryFile file(path);
  file.write(bytes);
  file.commit();
  flush_folder(path);
}

}  // namespace efsi::io
