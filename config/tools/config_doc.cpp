// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>

#include "emit/config/load.hpp"

/// Writes the key tables into a README between its two markers:
///   config_doc config/README.md          rewrites the file
///   config_doc --check config/README.md  exits 1 when it is out of date
///   config_doc                           prints the tables
int main(int argc, char** argv) {
  constexpr std::string_view kBegin = "<!-- keys:begin -->\n";
  constexpr std::string_view kEnd = "<!-- keys:end -->";
  const std::string tables = emit::config::key_reference_markdown();
  if (argc < 2) {
    std::cout << tables;
    return 0;
  }
  const bool check = std::string_view(argv[1]) == "--check";
  if (check && argc < 3) {
    std::cerr << "config_doc: --check needs a file\n";
    return 2;
  }
  const std::string file = argv[check ? 2 : 1];
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  const std::string before = text.str();
  const std::size_t begin = before.find(kBegin);
  const std::size_t end = before.find(kEnd);
  if (!in || begin == std::string::npos || end == std::string::npos || end < begin) {
    std::cerr << "config_doc: " << file << " cannot be read or has no key markers\n";
    return 2;
  }
  const std::string after = before.substr(0, begin + kBegin.size()) + tables + before.substr(end);
  if (after == before) {
    return 0;
  }
  if (check) {
    std::cerr << "config_doc: " << file << " is out of date\n";
    return 1;
  }
  std::ofstream out(file, std::ios::binary);
  out << after;
  return out.flush() ? 0 : 2;
}
