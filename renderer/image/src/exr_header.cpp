// SPDX-License-Identifier: Apache-2.0
#include "exr_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace emit::image {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

static_assert(std::endian::native == std::endian::little, "OpenEXR files are little endian");

constexpr std::uint32_t kMagic = 20000630;
constexpr std::uint32_t kMultiPartFlag = 0x1000;
constexpr std::size_t kMaxNameBytes = 255;
/// Number of rows of a chunk by compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA,
/// DWAB.
constexpr std::array<std::int64_t, 10> kChunkRows{1, 1, 1, 16, 32, 16, 32, 32, 32, 256};

/// Attribute types of a fixed size. The library reads that many bytes whatever size the file
/// states, and would then continue at another place than this check does.
struct TypeSize {
  std::string_view type;
  std::int64_t bytes;
};
constexpr TypeSize kTypeSizes[] = {{"box2f", 16},      {"box2i", 16},    {"chromaticities", 32},
                                   {"compression", 1}, {"double", 8},    {"deepImageState", 1},
                                   {"envmap", 1},      {"float", 4},     {"int", 4},
                                   {"keycode", 28},    {"lineOrder", 1}, {"m33d", 72},
                                   {"m33f", 36},       {"m44d", 128},    {"m44f", 64},
                                   {"rational", 8},    {"tiledesc", 9},  {"timecode", 8},
                                   {"v2d", 16},        {"v2f", 8},       {"v2i", 8},
                                   {"v3d", 24},        {"v3f", 12},      {"v3i", 12}};

/// Binary reader of a file.
class File {
 public:
  explicit File(const std::filesystem::path& path) : stream_(path, std::ios::binary) {
    stream_.seekg(0, std::ios::end);
    bytes_ = static_cast<std::int64_t>(stream_.tellg());
    stream_.seekg(0);
  }
  [[nodiscard]] bool ok() const { return static_cast<bool>(stream_); }
  [[nodiscard]] std::int64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::int64_t left() { return bytes_ - static_cast<std::int64_t>(stream_.tellg()); }
  template <class T>
  [[nodiscard]] T number() {
    T value{};
    stream_.read(reinterpret_cast<char*>(&value), sizeof value);
    return value;
  }
  /// Reads a name up to its zero byte. Fails beyond kMaxNameBytes.
  [[nodiscard]] std::string name() {
    std::string out;
    for (char c = 0; stream_.get(c) && c != '\0';) {
      out += c;
      if (out.size() > kMaxNameBytes) stream_.setstate(std::ios::failbit);
    }
    return out;
  }
  [[nodiscard]] std::vector<char> take(std::int64_t count) {
    std::vector<char> out(static_cast<std::size_t>(count));
    stream_.read(out.data(), static_cast<std::streamsize>(count));
    return out;
  }
  void skip(std::int64_t count) { stream_.seekg(count, std::ios::cur); }

 private:
  std::ifstream stream_;
  std::int64_t bytes_ = 0;
};

/// Header values that determine how much memory the library allocates for one part.
struct Part {
  std::array<std::int32_t, 4> data_window{0, 0, -1, -1};
  std::size_t compression = 0;
  std::int64_t channels = 0;
  std::optional<std::array<std::uint32_t, 2>> tile_px;
};

/// Counts the channels of a list. An entry is a name, its zero byte and 16 bytes; a zero byte ends
/// the list. Returns nothing if the entries do not fill the list exactly.
std::optional<std::int64_t> count_channels(const std::vector<char>& list) {
  std::int64_t count = 0;
  std::size_t at = 0;
  for (; at < list.size() && list[at] != '\0'; ++count) {
    while (at < list.size() && list[at] != '\0') ++at;
    at += 17;
  }
  return at + 1 == list.size() ? std::optional(count) : std::nullopt;
}

/// Checks a preview image: a width, a height and as many pixels of 4 bytes.
bool is_whole_preview(const std::vector<char>& value) {
  std::array<std::uint32_t, 2> size_px{};
  if (value.size() < sizeof size_px) return false;
  std::memcpy(size_px.data(), value.data(), sizeof size_px);
  return std::uint64_t{size_px[0]} * size_px[1] == (value.size() - sizeof size_px) / 4 &&
         value.size() % 4 == 0;
}

/// Returns the size in bytes of a type, if that is fixed.
std::optional<std::int64_t> fixed_bytes(std::string_view type) {
  const auto* const found = std::ranges::find(kTypeSizes, type, &TypeSize::type);
  return found != std::end(kTypeSizes) ? std::optional(found->bytes) : std::nullopt;
}

template <class T>
bool copy_to(const std::vector<char>& value, T& out) {
  if (value.size() < sizeof out) return false;
  std::memcpy(&out, value.data(), sizeof out);
  return true;
}

/// Takes over one attribute. Returns false if its value does not fit its type or name.
bool take_value(const std::string& name, std::string_view type, const std::vector<char>& value,
                Part& part) {
  if (type == "preview") return is_whole_preview(value);
  if (type == "chlist") {
    const auto count = count_channels(value);
    part.channels = std::max(part.channels, count.value_or(0));
    return count.has_value();
  }
  if (name == "dataWindow") return copy_to(value, part.data_window);
  if (name == "tiles") return copy_to(value, part.tile_px.emplace());
  if (name == "compression") {
    std::uint8_t kind = 0;
    const bool whole = copy_to(value, kind);
    part.compression = kind;
    return whole && kind < kChunkRows.size();
  }
  return true;
}

/// Checks the sizes that a part announces against the limits and the length of the file.
Result<void> check_part(const Part& part, std::int64_t file_bytes) {
  const auto side = [&](std::size_t axis) {
    return std::int64_t{part.data_window[axis + 2]} - part.data_window[axis] + 1;
  };
  const std::int64_t width = side(0);
  const std::int64_t height = side(1);
  if (width <= 0 || height <= 0 || width > kMaxExrSidePx || height > kMaxExrSidePx) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("image of {} x {} pixels is out of range", width, height));
  }
  if (part.channels > kMaxExrChannels) {
    return make_error(ErrorCode::unsupported, fmt::format("{} channels", part.channels));
  }
  std::int64_t chunk_width = width;
  std::int64_t chunk_rows = kChunkRows[part.compression];
  if (part.tile_px) {
    chunk_width = (*part.tile_px)[0];
    chunk_rows = (*part.tile_px)[1];
    if (chunk_width < 1 || chunk_rows < 1 || chunk_width > kMaxExrSidePx ||
        chunk_rows > kMaxExrSidePx) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("tiles of {} x {} pixels", chunk_width, chunk_rows));
    }
  }
  const std::int64_t chunks =
      ((width + chunk_width - 1) / chunk_width) * ((height + chunk_rows - 1) / chunk_rows);
  if (chunks > file_bytes / std::int64_t{sizeof(std::uint64_t)}) {
    return make_error(ErrorCode::parse, fmt::format("a table of {} pieces in {} bytes: truncated?",
                                                    chunks, file_bytes));
  }
  if (chunk_width * chunk_rows >
      kMaxExrChunkBytes / std::int64_t{sizeof(float)} / std::max<std::int64_t>(part.channels, 1)) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("pieces of {} x {} pixels and {} channels", chunk_width,
                                  chunk_rows, part.channels));
  }
  return {};
}

/// Reads and checks the header of the next part. Returns false if the list of parts ends here.
Result<bool> check_next_part(File& file) {
  Part part;
  for (int count = 0;; ++count) {
    const std::string name = file.name();
    if (file.ok() && name.empty()) {
      if (count == 0) return false;
      break;
    }
    const std::string type = file.name();
    const std::int64_t size = file.number<std::int32_t>();
    if (!file.ok() || size < 0 || size > file.left()) {
      return make_error(ErrorCode::parse,
                        fmt::format("attribute '{}' of {} bytes: truncated?", name, size));
    }
    const auto wrong = [&] {
      return make_error(ErrorCode::parse,
                        fmt::format("attribute '{}': {} bytes are no {}", name, size, type));
    };
    if (fixed_bytes(type).value_or(size) != size) return wrong();
    const bool looked_into = type == "preview" || type == "chlist" || name == "dataWindow" ||
                             name == "compression" || name == "tiles";
    if (!looked_into) {
      file.skip(size);
    } else if (!take_value(name, type, file.take(size), part)) {
      return wrong();
    }
  }
  if (auto checked = check_part(part, file.bytes()); !checked) {
    return tl::unexpected(checked.error());
  }
  return true;
}

}  // namespace

Result<void> check_exr_header(const std::filesystem::path& path) {
  File file(path);
  if (!file.ok()) {
    return make_error(ErrorCode::io, "cannot be read");
  }
  const auto magic = file.number<std::uint32_t>();
  const auto version = file.number<std::uint32_t>();
  if (!file.ok() || magic != kMagic) {
    return make_error(ErrorCode::parse, "not an OpenEXR file");
  }
  bool more = true;
  for (bool first = true; more; first = false) {
    const Result<bool> part = check_next_part(file);
    if (!part) {
      return tl::unexpected(part.error());
    }
    if (first && !*part) {
      return make_error(ErrorCode::parse, "a header without attributes");
    }
    more = *part && (version & kMultiPartFlag) != 0;
  }
  return {};
}

}  // namespace emit::image
