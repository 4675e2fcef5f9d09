// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <system_error>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

/// A row that is longer than this has most likely lost a quote.
constexpr std::size_t kMaxRowBytes = std::size_t{1} << 20;
constexpr int kEnd = -1;

bool is_blank(int c) noexcept {
  return c == ' ' || c == '\t';
}

/// Shortens the text of a user's file to one short line for a message.
std::string shown(std::string_view text) {
  constexpr std::size_t kMaxShownBytes = 60;
  std::string out(text.substr(0, kMaxShownBytes));
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  }
  if (text.size() > kMaxShownBytes) out += "...";
  return out;
}

/// Returns the name of the format of a file that is not UTF-8 text, judged by its first bytes. The
/// result is empty for text.
std::string_view foreign_format(std::string_view first) noexcept {
  if (first.starts_with("\xFF\xFE") || first.starts_with("\xFE\xFF")) {
    return "the file is UTF-16 text: save it as UTF-8";
  }
  if (first.starts_with("PK\x03\x04") || first.starts_with("\xD0\xCF\x11\xE0")) {
    return "the file is a spreadsheet or an archive, not text: export it as CSV in UTF-8";
  }
  if (first.starts_with("\x1F\x8B")) return "the file is compressed: unpack it first";
  if (first.find('\0') != std::string_view::npos) {
    return "the file is UTF-16 text or binary: save it as UTF-8 text";
  }
  return {};
}

/// Returns the name of a character that stands in place of a comma. The result is empty for other
/// characters.
std::string_view foreign_separator(int c) noexcept {
  switch (c) {
    case ';':
      return "';'";
    case '\t':
      return "tabs";
    case '|':
      return "'|'";
    case ' ':
      return "blanks";
    default:
      return {};
  }
}

std::string separator_fault(std::string_view separator) {
  return fmt::format("cells are separated by {}; commas are wanted, and '.' in decimal numbers",
                     separator);
}

}  // namespace

struct CsvReader::Impl {
  std::string name;
  std::unique_ptr<std::istream> stream;
  std::string first;  ///< the first bytes, which show the format of the file
  std::size_t first_at = 0;
  int ahead = kEnd;        ///< next character
  std::uint32_t line = 1;  ///< of `ahead`
  std::uint32_t column = 1;
  std::vector<CsvCell> header;
  std::uint32_t header_line = 1;
  std::vector<CsvCell> cells;  ///< of the row; the first `count` are in use
  std::size_t count = 0;
  std::uint32_t row_line = 1;
  std::size_t row_bytes = 0;
  std::uint32_t named_comment_line = 0;  ///< a comment with commas above the header; 0: none

  tl::unexpected<Error> fault(std::uint32_t at_line, std::uint32_t at_column,
                              std::string_view text) const {
    return make_error(ErrorCode::parse,
                      fmt::format("{}:{}:{}: {}", name, at_line, at_column, text));
  }

  int read() {
    if (first_at < first.size()) return static_cast<unsigned char>(first[first_at++]);
    const int c = stream->rdbuf()->sbumpc();
    return c == std::char_traits<char>::eof() ? kEnd : c;
  }
  /// Takes the next character. All three kinds of line ends become '\n'.
  int take() {
    const int c = ahead;
    if (c == kEnd) return kEnd;
    ahead = read();
    if (c == '\r' && ahead == '\n') return take();
    if (c == '\n' || c == '\r') {
      ++line;
      column = 1;
      return '\n';
    }
    // Bytes that continue a UTF-8 character do not count.
    if ((c & 0xC0) != 0x80) ++column;
    ++row_bytes;
    return c;
  }
  [[nodiscard]] bool at_line_end() const noexcept {
    return ahead == kEnd || ahead == '\n' || ahead == '\r';
  }

  Result<void> begin() {
    constexpr std::size_t kFirstBytes = 4;
    first.resize(kFirstBytes);
    const std::streamsize got =
        stream->rdbuf()->sgetn(first.data(), static_cast<std::streamsize>(kFirstBytes));
    first.resize(static_cast<std::size_t>(std::max<std::streamsize>(got, 0)));
    if (const std::string_view what = foreign_format(first); !what.empty()) {
      return make_error(ErrorCode::parse, fmt::format("{}: {}", name, what));
    }
    if (first.starts_with("\xEF\xBB\xBF")) first_at = 3;
    ahead = read();
    return read_header();
  }

  Result<void> skip_comment() {
    const std::uint32_t comment_line = line;
    bool commas = false;
    while (!at_line_end()) {
      commas = take() == ',' || commas;
      row_bytes = 0;
    }
    take();
    if (header.empty() && commas) named_comment_line = comment_line;
    return {};
  }

  CsvCell& new_cell() {
    if (count == cells.size()) cells.emplace_back();
    CsvCell& cell = cells[count++];
    cell.text.clear();
    cell.line = line;
    cell.column = column;
    cell.quoted = false;
    return cell;
  }

  Result<void> read_quoted(CsvCell& cell) {
    cell.quoted = true;
    take();
    while (true) {
      if (ahead == kEnd) {
        return fault(cell.line, cell.column, "the quoted cell that begins here is never closed");
      }
      if (row_bytes > kMaxRowBytes) {
        return fault(cell.line, cell.column,
                     "the quoted cell that begins here is longer than 1 MiB; a quote is missing");
      }
      const int c = take();
      if (c != '"') {
        cell.text.push_back(static_cast<char>(c));
      } else if (ahead == '"') {
        cell.text.push_back(static_cast<char>(take()));
      } else {
        break;
      }
    }
    bool tab = false;
    while (is_blank(ahead)) tab = take() == '\t' || tab;
    if (at_line_end() || ahead == ',') return {};
    const std::string_view separator = foreign_separator(tab ? '\t' : ahead);
    if (header.empty() && !separator.empty()) {
      return fault(line, column, separator_fault(separator));
    }
    return fault(line, column, "a comma is missing behind a closing quote");
  }

  Result<void> read_plain(CsvCell& cell) {
    while (!at_line_end() && ahead != ',') {
      cell.text.push_back(static_cast<char>(take()));
      if (row_bytes > kMaxRowBytes) {
        return fault(cell.line, cell.column, "the row is longer than 1 MiB");
      }
    }
    while (!cell.text.empty() && is_blank(static_cast<unsigned char>(cell.text.back()))) {
      cell.text.pop_back();
    }
    return {};
  }

  /// Reads the next row with content. It returns false at the end.
  Result<bool> read_row() {
    while (true) {
      count = 0;
      row_bytes = 0;
      row_line = line;
      if (ahead == kEnd) {
        if (stream->bad()) {
          return make_error(ErrorCode::io, fmt::format("{}: reading failed", name));
        }
        return false;
      }
      if (ahead == '#') {
        if (auto done = skip_comment(); !done) return tl::unexpected(done.error());
        continue;
      }
      while (true) {
        while (is_blank(ahead)) take();
        CsvCell& cell = new_cell();
        auto done = ahead == '"' ? read_quoted(cell) : read_plain(cell);
        if (!done) return tl::unexpected(std::move(done.error()));
        if (ahead != ',') break;
        take();
      }
      take();  // the line end
      const std::span<const CsvCell> read = std::span(cells).first(count);
      if (std::ranges::all_of(
              read, [](const CsvCell& cell) { return cell.text.empty() && !cell.quoted; })) {
        continue;
      }
      if (!cells[0].quoted && cells[0].text.starts_with('#')) {
        return fault(cells[0].line, cells[0].column,
                     "a comment has to begin in the first column of its line");
      }
      return true;
    }
  }

  Result<void> read_header() {
    auto more = read_row();
    if (more && *more && cells[0].text.starts_with("sep=")) {
      if (count != 2 || cells[0].text != "sep=") {
        return fault(cells[0].line, cells[0].column,
                     separator_fault("'" + shown(cells[0].text.substr(4)) + "'"));
      }
      more = read_row();  // a spreadsheet's note that commas separate
    }
    if (!more) return tl::unexpected(std::move(more.error()));
    if (!*more) {
      return make_error(ErrorCode::parse, fmt::format("{}: the file has no header row", name));
    }
    while (count > 1 && cells[count - 1].text.empty()) --count;
    const std::span<const CsvCell> names = std::span(cells).first(count);
    if (count == 1) {
      for (const char c : {';', '\t', '|', ' '}) {
        if (names[0].text.find(c) == std::string::npos) continue;
        return fault(names[0].line, names[0].column, separator_fault(foreign_separator(c)));
      }
    }
    if (std::ranges::all_of(
            names, [](const CsvCell& cell) { return csv_number(cell.text).has_value(); })) {
      return fault(row_line, 1,
                   fmt::format("the first row has to name the columns, but it holds numbers{}",
                               named_comment_line == 0
                                   ? std::string()
                                   : fmt::format("; does the comment in line {} hold the names? "
                                                 "Remove its '#'",
                                                 named_comment_line)));
    }
    for (const CsvCell& cell : names) {
      if (cell.text.empty()) return fault(cell.line, cell.column, "the column has no name");
    }
    header.assign(names.begin(), names.end());
    header_line = row_line;
    return {};
  }

  Result<bool> next() {
    auto more = read_row();
    if (!more || !*more) return more;
    while (count > header.size() && cells[count - 1].text.empty()) --count;
    if (count != header.size()) {
      const std::size_t got = std::exchange(count, 0);
      return fault(row_line, 1, fmt::format("{} values, the header has {}", got, header.size()));
    }
    return true;
  }
};

CsvReader::CsvReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CsvReader::CsvReader(CsvReader&&) noexcept = default;
CsvReader& CsvReader::operator=(CsvReader&&) noexcept = default;
CsvReader::~CsvReader() = default;

Result<CsvReader> CsvReader::open(const std::filesystem::path& file) {
  std::error_code code;
  if (!std::filesystem::exists(file, code)) {
    return make_error(ErrorCode::not_found, file.string() + ": no such file");
  }
  auto stream = std::make_unique<std::ifstream>(file, std::ios::binary);
  if (!*stream || std::filesystem::is_directory(file, code)) {
    return make_error(ErrorCode::io, file.string() + ": cannot be opened");
  }
  auto impl = std::make_unique<Impl>();
  impl->name = file.string();
  impl->stream = std::move(stream);
  if (auto begun = impl->begin(); !begun) return tl::unexpected(std::move(begun.error()));
  return CsvReader(std::move(impl));
}

Result<CsvReader> CsvReader::from_text(std::string text, std::string name) {
  auto impl = std::make_unique<Impl>();
  impl->name = std::move(name);
  impl->stream = std::make_unique<std::istringstream>(std::move(text));
  if (auto begun = impl->begin(); !begun) return tl::unexpected(std::move(begun.error()));
  return CsvReader(std::move(impl));
}

const std::string& CsvReader::name() const noexcept {
  return impl_->name;
}

std::span<const CsvCell> CsvReader::header() const noexcept {
  return impl_->header;
}

namespace {

/// Finds the position of `column` among `names`. An error message begins with `place`.
template <class Names>
Result<std::size_t> find_column(const Names& names, std::string_view column, std::string_view place,
                                ErrorCode missing) {
  const auto found = std::ranges::find(names, column);
  if (found == names.end()) {
    std::string listed;
    for (const std::string& name : names) listed += (listed.empty() ? "" : ", ") + shown(name);
    return make_error(missing, fmt::format("{}: column '{}' is missing (the file has {})", place,
                                           column, listed));
  }
  if (std::find(std::next(found), names.end(), column) != names.end()) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: column '{}' appears twice", place, column));
  }
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace

Result<std::size_t> CsvReader::find(std::string_view column) const {
  std::vector<std::string> names;
  for (const CsvCell& cell : impl_->header) names.push_back(cell.text);
  return find_column(names, column, fmt::format("{}:{}", impl_->name, impl_->header_line),
                     ErrorCode::parse);
}

Result<bool> CsvReader::next() {
  return impl_->next();
}

std::span<const CsvCell> CsvReader::row() const noexcept {
  return std::span(impl_->cells).first(impl_->count);
}

std::uint32_t CsvReader::line() const noexcept {
  return impl_->row_line;
}

std::string CsvReader::place_of(const CsvCell& cell) const {
  return fmt::format("{}:{}:{}", impl_->name, cell.line, cell.column);
}

Result<CsvTable> CsvTable::read(const std::filesystem::path& file) {
  return read_all(CsvReader::open(file));
}

Result<CsvTable> CsvTable::parse(std::string text, std::string name) {
  return read_all(CsvReader::from_text(std::move(text), std::move(name)));
}

Result<CsvTable> CsvTable::read_all(Result<CsvReader> reader) {
  if (!reader) return tl::unexpected(std::move(reader.error()));
  CsvTable table;
  table.name_ = reader->name();
  table.header_line_ = reader->line();
  for (const CsvCell& cell : reader->header()) table.columns_.push_back(cell.text);
  while (true) {
    auto more = reader->next();
    if (!more) return tl::unexpected(std::move(more.error()));
    if (!*more) return table;
    for (const CsvCell& cell : reader->row()) {
      table.cells_.push_back({table.text_.size(), cell.text.size()});
      table.text_ += cell.text;
    }
    table.lines_.push_back(reader->line());
  }
}

std::size_t CsvTable::line_of(std::size_t row) const {
  EMIT_CHECK_OP(row, <, lines_.size());
  return lines_[row];
}

bool CsvTable::has(std::string_view column) const noexcept {
  return std::find(columns_.begin(), columns_.end(), column) != columns_.end();
}

Result<std::size_t> CsvTable::find(std::string_view column) const {
  return find_column(columns_, column, fmt::format("{}:{}", name_, header_line_),
                     ErrorCode::invalid_argument);
}

std::string_view CsvTable::cell(std::size_t row, std::size_t column) const {
  const Place& place = cells_[row * columns_.size() + column];
  return std::string_view(text_).substr(place.begin, place.length);
}

Result<std::vector<double>> CsvTable::numbers(std::string_view column) const {
  const auto index = find(column);
  if (!index) return tl::unexpected(index.error());
  std::vector<double> values;
  values.reserve(rows());
  for (std::size_t row = 0; row < rows(); ++row) {
    const std::optional<double> value = csv_number(cell(row, *index));
    if (!value) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: column '{}': {}", name_, lines_[row], column,
                                    not_a_number_text(cell(row, *index))));
    }
    values.push_back(*value);
  }
  return values;
}

Result<std::vector<std::string_view>> CsvTable::texts(std::string_view column) const {
  const auto index = find(column);
  if (!index) return tl::unexpected(index.error());
  std::vector<std::string_view> values;
  values.reserve(rows());
  for (std::size_t row = 0; row < rows(); ++row) values.push_back(cell(row, *index));
  return values;
}

std::optional<double> csv_number(std::string_view text) noexcept {
  if (text.starts_with('+')) {
    text.remove_prefix(1);
    if (text.starts_with('-')) return std::nullopt;
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc()) return value;
  if (error != std::errc::result_out_of_range) return std::nullopt;
  // 1e-400 is 0 and 1e400 is infinite, as everywhere else in IEEE arithmetic.
  return std::strtod(std::string(text).c_str(), nullptr);
}

std::string not_a_number_text(std::string_view text) {
  std::string out = fmt::format("'{}' is not a number", shown(text));
  const auto digit = [text](std::size_t i) {
    return i < text.size() && text[i] >= '0' && text[i] <= '9';
  };
  if (digit(0) && text.size() > 5 && text.find_first_of("-/:") != std::string_view::npos &&
      (digit(1) || text[1] == '/' || text[1] == ':')) {
    out += "; dates and times of day are not read, times are seconds from the scenario's epoch_utc";
  } else if (std::ranges::count(text, ',') == 1 && text.find('.') == std::string_view::npos) {
    std::string with_point(text);
    std::ranges::replace(with_point, ',', '.');
    if (csv_number(with_point)) out += "; write '.' for the decimal point";
  }
  return out;
}

std::string unix_time_hint(double seconds) {
  struct Unit {
    const char* name;
    double per_s;
  };
  // UNIX times from 2001 to 2286 have ten digits in seconds, and more in smaller units.
  for (const Unit& unit :
       {Unit{"seconds", 1.0}, {"milliseconds", 1e3}, {"microseconds", 1e6}, {"nanoseconds", 1e9}}) {
    const double unix_s = seconds / unit.per_s;
    if (!(unix_s >= 1e9 && unix_s < 1e10)) continue;
    const std::chrono::sys_seconds instant{std::chrono::seconds{static_cast<std::int64_t>(unix_s)}};
    const std::chrono::year_month_day date{std::chrono::floor<std::chrono::days>(instant)};
    return fmt::format(
        "; this looks like UNIX time in {} ({:04}-{:02}-{:02}), wanted are seconds from the "
        "scenario's epoch_utc",
        unit.name, static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
        static_cast<unsigned>(date.day()));
  }
  return {};
}

}  // namespace emit::physics
