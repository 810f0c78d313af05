// Purpose: messages for the user; silent unless the caller installs a callback.
#pragma once

#include <functional>
#include <string>

namespace efsi {

enum class LogLevel : int { kInfo = 0, kWarning = 1 };

class Log {
 public:
  using Callback = std::function<void(LogLevel, const std::string&)>;
  Log() = default;
  explicit Log(Callback callback) : callback_(std::move(callback)) {}
  void info(const std::string& message) const { emit(LogLevel::kInfo, message); }
  void warning(const std::string& message) const { emit(LogLevel::kWarning, message); }

 private:
  void emit(LogLevel level, const std::string& message) const {
    if (callback_) callback_(level, message);
  }
  Callback callback_;
};

}  // namespace efsi
