// SPDX-License-Identifier: Apache-2.0
#include "tool/support/library_edit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string_view>
#include <vector>

#include "emit/config/load.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// Returns true for the line "key = ..." at the left margin.
bool assigns(std::string_view line, std::string_view key) {
  if (!line.starts_with(key)) return false;
  const std::string_view rest = trimmed(line.substr(key.size()));
  return rest.starts_with("=");
}

/// Returns true if the value of a line is a name, in either spelling of TOML.
bool is_name(std::string_view value, const std::string& name) {
  std::string quoted = "\"";
  for (const char c : name) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return value == quoted + '"' || value == "'" + name + "'";
}

/// Returns the end of a value that begins at line `begin`: brackets must balance. Strings in
/// library values hold none.
std::size_t value_end(const std::vector<std::string>& lines, std::size_t begin) {
  int depth = 0;
  for (std::size_t i = begin; i < lines.size(); ++i) {
    for (const char c : lines[i]) {
      if (c == '[' || c == '{') ++depth;
      if (c == ']' || c == '}') --depth;
    }
    if (depth <= 0) return i + 1;
  }
  return lines.size();
}

std::vector<std::string> lines_of(const LibraryEntry& entry) {
  std::vector<std::string> lines;
  if (!entry.foster) {
    lines.emplace_back("modes = [");
    for (const scene::RelaxationMode& mode : entry.fit.modes) {
      lines.push_back(fmt::format("  {{ tau_s = {:.6g}, weight_frac = {:.9g} }},", mode.tau_s,
                                  mode.weight_frac));
    }
    lines.emplace_back("]");
    return lines;
  }
  lines.emplace_back("foster_modes = [");
  for (std::size_t i = 0; i < entry.fit.network.count; ++i) {
    const physics::NetworkMode& mode = entry.fit.network.modes[i];
    lines.push_back(fmt::format("  {{ tau_s = {:.6g}, resistance_m2k_w = {:.9g} }},", mode.tau_s,
                                mode.resistance_m2k_w));
  }
  lines.emplace_back("]");
  lines.push_back(
      fmt::format("foster_fit = {{ horizon_s = {:.0f}, rms_k = {:.3f}, max_k = {:.3f} }}",
                  entry.fit.horizon_s, entry.fit.rms_k, entry.fit.max_k));
  return lines;
}

void replace_in_block(std::vector<std::string>& lines, std::size_t begin, std::size_t end,
                      const LibraryEntry& entry) {
  std::vector<std::string> block(lines.begin() + static_cast<std::ptrdiff_t>(begin),
                                 lines.begin() + static_cast<std::ptrdiff_t>(end));
  const std::vector<std::string_view> keys =
      entry.foster ? std::vector<std::string_view>{"foster_modes", "foster_fit"}
                   : std::vector<std::string_view>{"modes"};
  for (const std::string_view key : keys) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!assigns(block[i], key)) continue;
      block.erase(block.begin() + static_cast<std::ptrdiff_t>(i),
                  block.begin() + static_cast<std::ptrdiff_t>(value_end(block, i)));
      break;
    }
  }
  // The modes go before the source, else at the end of the block's text.
  auto at = std::find_if(block.begin(), block.end(),
                         [](const std::string& line) { return assigns(line, "source"); });
  if (at == block.end()) {
    while (at != block.begin() && (trimmed(*(at - 1)).empty() || (at - 1)->starts_with('#'))) --at;
  }
  const std::vector<std::string> fresh = lines_of(entry);
  block.insert(at, fresh.begin(), fresh.end());
  lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(begin),
              lines.begin() + static_cast<std::ptrdiff_t>(end));
  lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(begin), block.begin(), block.end());
}

}  // namespace

Result<std::string> with_fitted_modes(const std::string& library,
                                      std::span<const LibraryEntry> entries) {
  std::vector<std::string> lines;
  std::stringstream stream(library);
  for (std::string line; std::getline(stream, line);) lines.push_back(std::move(line));
  for (const LibraryEntry& entry : entries) {
    bool found = false;
    for (std::size_t begin = 0; begin < lines.size() && !found;) {
      if (trimmed(lines[begin]) != "[[material]]") {
        ++begin;
        continue;
      }
      std::size_t end = begin + 1;
      while (end < lines.size() && !trimmed(lines[end]).starts_with("[[")) ++end;
      for (std::size_t i = begin + 1; i < end; ++i) {
        if (assigns(lines[i], "name") &&
            is_name(trimmed(std::string_view(lines[i]).substr(lines[i].find('=') + 1)),
                    entry.fit.material)) {
          replace_in_block(lines, begin + 1, end, entry);
          found = true;
          break;
        }
      }
      begin = end;
    }
    if (!found) {
      return make_error(ErrorCode::not_found,
                        fmt::format("the library has no material '{}'", entry.fit.material));
    }
  }
  std::string out;
  for (const std::string& line : lines) out += line + "\n";
  return out;
}

Result<void> write_library(const std::filesystem::path& library,
                           std::span<const LibraryEntry> entries,
                           const std::filesystem::path& out) {
  std::filesystem::path from = library;
  if (from.empty()) {
    auto shipped = config::find_data_file("materials/library.toml");
    if (!shipped) return tl::unexpected(std::move(shipped.error()));
    from = *shipped;
  }
  std::ifstream in(from, std::ios::binary);
  if (!in) return make_error(ErrorCode::not_found, fmt::format("{}: cannot open", from.string()));
  std::stringstream text;
  text << in.rdbuf();
  in.close();
  auto edited = with_fitted_modes(text.str(), entries);
  if (!edited) {
    return make_error(edited.error().code,
                      fmt::format("{}: {}", from.string(), edited.error().text));
  }
  std::ofstream file(out, std::ios::binary);
  file << *edited;
  file.close();
  if (!file) return make_error(ErrorCode::io, fmt::format("{}: cannot write", out.string()));
  return {};
}

}  // namespace emit::tool
