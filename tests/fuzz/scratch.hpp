// Purpose: what the fuzzing programs share: a file that holds the input, and numbers taken from the input.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

namespace efsi::fuzz {

// Writes the bytes to a file of this process with that name; it stays one file in a folder of temporary files.
inline std::string scratch(const std::string& name, const void* bytes, std::size_t count) {
  static const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("efsi_fuzz_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const std::string path = (folder / name).string();
  std::ofstream(path, std::ios::binary).write(static_cast<const char*>(bytes), static_cast<std::streamsize>(count));
  return path;
}

// Takes values from the input, from its beginning; zeros behind its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  template <class T>
  T take() {
    T value{};
    const std::size_t count = std::min(sizeof(T), size_);
    std::memcpy(&value, data_, count);
    data_ += count;
    size_ -= count;
    return value;
  }
  const std::uint8_t* data() const { return data_; }
  std::size_t size() const { return size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

}  // namespace efsi::fuzz
