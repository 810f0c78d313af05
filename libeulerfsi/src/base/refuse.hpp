// Purpose: errors about values of fields.
#pragma once

#include <string>

namespace efsi {

// As it stands in messages.
std::string number(double value);
// "field = value: must be limit" (ErrorCode::kArgument).
[[noreturn]] void refuse(const std::string& field, double value, const std::string& limit);

}  // namespace efsi
