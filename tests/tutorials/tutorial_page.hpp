// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fstream>
#include <sstream>
#include <string>

namespace emit::test {

/// Snippets of a tutorial in deploy/docs/tutorials, so that the tests run what readers see.
class TutorialPage {
 public:
  /// @param name  file name of the page, such as "rig.md"
  explicit TutorialPage(const std::string& name) {
    std::ifstream in(std::string(EMIT_TEST_SOURCE_DIR) + "/../deploy/docs/tutorials/" + name);
    std::ostringstream out;
    out << in.rdbuf();
    text_ = out.str();
  }

  /// Returns all fenced blocks of a language, one after the other; empty: there is none.
  [[nodiscard]] std::string snippets(const std::string& language) const {
    std::istringstream in(text_);
    std::string line;
    std::string out;
    bool inside = false;
    while (std::getline(in, line)) {
      if (line == "```" + language) {
        inside = true;
      } else if (line == "```") {
        inside = false;
      } else if (inside) {
        out += line + "\n";
      }
    }
    return out;
  }

 private:
  std::string text_;
};

}  // namespace emit::test
