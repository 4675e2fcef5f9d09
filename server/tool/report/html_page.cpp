// SPDX-License-Identifier: Apache-2.0
#include "tool/report/html_page.hpp"

#include <fmt/format.h>

#include "tool/support/replacing_file.hpp"

namespace emit::tool {

std::string html_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string html_page(std::string_view title, std::string_view style, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<title>{}</title>\n<style>\n"
      "body {{ font: 15px/1.45 sans-serif; color: #222; max-width: 1160px; margin: 2em auto; }}\n"
      "table {{ border-collapse: collapse; }}\n"
      "td {{ padding: 3px 18px 3px 0; border-bottom: 1px solid #ddd; }}\n"
      "svg {{ max-width: 100%; height: auto; }}\n{}</style>\n</head>\n<body>\n{}</body>\n</html>\n",
      html_escaped(title), style, body);
}

physics::Result<void> write_html(const std::filesystem::path& file, const std::string& page) {
  auto out = ReplacingFile::create(file);
  if (!out) return tl::unexpected(std::move(out.error()));
  if (auto done = out->write(page); !done) return done;
  return out->commit();
}

}  // namespace emit::tool
