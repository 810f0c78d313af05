#include "base/refuse.hpp"

#include <sstream>

#include "base/error.hpp"

namespace efsi {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

void refuse(const std::string& field, double value, const std::string& limit) {
  throw Error(ErrorCode::kArgument, field + " = " + number(value) + ": must be " + limit);
}

}  // namespace efsi
