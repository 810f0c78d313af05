// Purpose: what a law test prints: what each of its checks compares, and under which conditions.
#pragma once

#include <string>

namespace efsi::test {

// Resolution, steps and preset of a run of the law test that runs now; each is printed once.
void note_conditions(const std::string& text);

}  // namespace efsi::test
