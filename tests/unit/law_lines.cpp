// Prints, for every test with the tag [law], its checks with value, reference and tolerance, what the test says of
// them, and the conditions that its runs have noted. The first of each check: it may stand in a loop.
#include "unit/law_lines.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <iostream>
#include <map>
#include <sstream>
#include <vector>

namespace {

constexpr int kMost = 4;  // lines of a check

struct {
  std::vector<std::string> lines, conditions;
  std::map<std::size_t, int> seen;  // by the line of the check
} told;

#if __has_include(<catch2/catch_all.hpp>)
using Listener = Catch::EventListenerBase;
using Answer = void;
#else
using Listener = Catch::TestEventListenerBase;
using Answer = bool;
#endif

class LawLines : public Listener {
 public:
#if __has_include(<catch2/catch_all.hpp>)
  explicit LawLines(const Catch::IConfig* config) : Listener(config) { m_preferences.shouldReportAllAssertions = true; }
#else
  using Listener::Listener;
#endif

  void testCaseStarting(const Catch::TestCaseInfo& info) override {
    Listener::testCaseStarting(info);
    is_law_ = info.tagsAsString().find("[law]") != std::string::npos;
    name_ = info.name;
    told = {};
  }

  Answer assertionEnded(const Catch::AssertionStats& stats) override {
    const auto& result = stats.assertionResult;
    if (is_law_ && result.hasExpression() && told.seen[result.getSourceInfo().line]++ < kMost) {
      std::ostringstream text;
      text << result.getExpression() << ": " << result.getExpandedExpression();
      for (const auto& info : stats.infoMessages) text << "; " << info.message;
      told.lines.push_back(text.str());
    }
    return Answer(true);
  }

  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    Listener::testCaseEnded(stats);
    if (!is_law_) return;
    std::cout << "law: " << name_ << '\n';
    for (const std::string& line : told.lines) std::cout << "  " << line << '\n';
    for (const std::string& line : told.conditions) std::cout << "  with " << line << '\n';
    std::cout << std::flush;
  }

 private:
  bool is_law_ = false;
  std::string name_;
};
CATCH_REGISTER_LISTENER(LawLines)

}  // namespace

void efsi::test::note_conditions(const std::string& text) {
  auto& all = told.conditions;
  if (std::find(all.begin(), all.end(), text) == all.end()) all.push_back(text);
}
