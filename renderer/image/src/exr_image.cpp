// SPDX-License-Identifier: Apache-2.0
#include "emit/image/exr_image.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#pragma GCC diagnostic pop
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <exception>
#include <set>
#include <utility>

#include "emit/physics/constants.hpp"
#include "exr_header.hpp"

namespace emit::image {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28U;

std::string describe_sizes(const ExrImage& image) {
  return fmt::format("{}x{}, {} channels", image.width_px, image.height_px, image.channels.size());
}

physics::Result<void> check_for_writing(const ExrImage& image) {
  const std::uint64_t pixels = std::uint64_t{image.width_px} * image.height_px;
  if (pixels == 0 || pixels > kMaxPixels || image.channels.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      "not an image that can be written: " + describe_sizes(image));
  }
  std::set<std::string> names;
  for (const ExrChannel& channel : image.channels) {
    if (channel.pixels.size() != pixels) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("channel '{}' has {} pixels instead of {}", channel.name,
                                    channel.pixels.size(), pixels));
    }
    if (channel.name.empty() || !names.insert(channel.name).second) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("channel name '{}' is empty or used twice", channel.name));
    }
  }
  return {};
}

void insert_attributes(Imf::Header& header, const ExrImage& image) {
  for (const auto& [name, value] : image.attributes) {
    if (const auto* text = std::get_if<std::string>(&value)) {
      header.insert(name, Imf::StringAttribute(*text));
    } else if (const auto* number = std::get_if<double>(&value)) {
      header.insert(name, Imf::DoubleAttribute(*number));
    } else {
      header.insert(name, Imf::IntAttribute(std::get<std::int32_t>(value)));
    }
  }
}

void read_attributes(const Imf::Header& header, ExrImage& image) {
  for (auto it = header.begin(); it != header.end(); ++it) {
    const Imf::Attribute& attribute = it.attribute();
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute)) {
      image.attributes[it.name()] = text->value();
    } else if (const auto* number = dynamic_cast<const Imf::DoubleAttribute*>(&attribute)) {
      image.attributes[it.name()] = number->value();
    } else if (const auto* integer = dynamic_cast<const Imf::IntAttribute*>(&attribute)) {
      image.attributes[it.name()] = integer->value();
    }
  }
  // The library adds "type", a standard attribute of the format. It is not ours.
  image.attributes.erase("type");
}

/// Describes a channel's pixels to the library. OpenEXR addresses pixel (x, y) at
/// base + x * xs + y * ys, counted from the origin of the data window.
Imf::Slice slice_of(float* pixels, const Imath::Box2i& window, std::uint32_t width) {
  return Imf::Slice::Make(Imf::FLOAT, pixels, window.min, static_cast<int64_t>(width), 1,
                          sizeof(float), sizeof(float) * width);
}

/// Reads the pixels in bands of rows. Memory grows with the rows read, so that a small file cannot
/// ask for much.
void read_pixels(Imf::InputFile& input, const Imath::Box2i& window, ExrImage& image) {
  constexpr std::size_t kBandValues = std::size_t{1} << 22U;
  const std::size_t row_values = std::size_t{image.width_px} * image.channels.size();
  const auto band_rows = static_cast<int>(
      std::clamp<std::size_t>(kBandValues / std::max<std::size_t>(row_values, 1), 1, 65536));
  for (int first = window.min.y; first <= window.max.y;) {
    const int last =
        static_cast<int>(std::min<std::int64_t>(std::int64_t{first} + band_rows - 1, window.max.y));
    const auto rows = static_cast<std::size_t>(std::int64_t{last} - window.min.y + 1);
    Imf::FrameBuffer frame;
    for (ExrChannel& channel : image.channels) {
      channel.pixels.resize(rows * image.width_px);
      frame.insert(channel.name, slice_of(channel.pixels.data(), window, image.width_px));
    }
    input.setFrameBuffer(frame);
    input.readPixels(first, last);
    if (last == window.max.y) break;
    first = last + 1;
  }
}

physics::Result<ExrImage> read_open_file(Imf::InputFile& input) {
  const Imf::Header& header = input.header();
  const Imath::Box2i window = header.dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
  const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width <= 0 || height <= 0 ||
      static_cast<std::uint64_t>(width) > kMaxPixels / static_cast<std::uint64_t>(height)) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("image of {} x {} pixels is out of range", width, height));
  }
  ExrImage image;
  image.width_px = static_cast<std::uint32_t>(width);
  image.height_px = static_cast<std::uint32_t>(height);
  for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
    if (it.channel().xSampling != 1 || it.channel().ySampling != 1) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("channel '{}' is subsampled", it.name()));
    }
    image.channels.push_back({it.name(), {}});
  }
  read_pixels(input, window, image);
  read_attributes(header, image);
  return image;
}

physics::Result<double> number_attribute(const ExrImage& image, const char* name) {
  const auto found = image.attributes.find(name);
  if (found != image.attributes.end()) {
    if (const auto* value = std::get_if<double>(&found->second)) {
      return *value;
    }
  }
  return make_error(ErrorCode::parse,
                    fmt::format("attribute '{}' is missing or not a number", name));
}

physics::Result<std::string> text_attribute(const ExrImage& image, const char* name) {
  const auto found = image.attributes.find(name);
  if (found != image.attributes.end()) {
    if (const auto* value = std::get_if<std::string>(&found->second)) {
      return *value;
    }
  }
  return make_error(ErrorCode::parse, fmt::format("attribute '{}' is missing or not a text", name));
}

template <class Integer>
physics::Result<Integer> integer_attribute(const ExrImage& image, const char* name) {
  const physics::Result<std::string> text = text_attribute(image, name);
  if (!text) {
    return tl::unexpected(text.error());
  }
  Integer value = 0;
  const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (code != std::errc{} || end != text->data() + text->size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("attribute '{}': '{}' is not an integer in range", name, *text));
  }
  return value;
}

constexpr std::string_view kRectangle = "rectangle";

std::string response_text(const std::vector<physics::ResponsePoint>& response) {
  if (response.empty()) return std::string(kRectangle);
  std::string out;
  for (const physics::ResponsePoint& point : response) {
    // Print the shortest digits that read back as the same numbers.
    out += fmt::format("{}{}:{}", out.empty() ? "" : " ", point.wavelength_um, point.response_frac);
  }
  return out;
}

physics::Result<std::vector<physics::ResponsePoint>> response_attribute(const ExrImage& image) {
  const physics::Result<std::string> text = text_attribute(image, "bandResponse");
  if (!text) return tl::unexpected(text.error());
  std::vector<physics::ResponsePoint> out;
  if (*text == kRectangle) return out;
  const char* at = text->data();
  const char* const end = at + text->size();
  for (;;) {
    physics::ResponsePoint point;
    const auto wavelength = std::from_chars(at, end, point.wavelength_um);
    if (wavelength.ec != std::errc{} || wavelength.ptr == end || *wavelength.ptr != ':') break;
    const auto response = std::from_chars(wavelength.ptr + 1, end, point.response_frac);
    if (response.ec != std::errc{}) break;
    out.push_back(point);
    if (response.ptr == end) return out;
    if (*response.ptr != ' ') break;
    at = response.ptr + 1;
  }
  return make_error(ErrorCode::parse,
                    "attribute 'bandResponse' is not made of pairs wavelength:response");
}

}  // namespace

const ExrChannel* ExrImage::find(std::string_view channel) const noexcept {
  const auto found = std::find_if(channels.begin(), channels.end(),
                                  [&](const ExrChannel& c) { return c.name == channel; });
  return found == channels.end() ? nullptr : &*found;
}

void ExrImage::add(std::string channel, std::span<const float> pixels) {
  channels.push_back({std::move(channel), {pixels.begin(), pixels.end()}});
}

physics::Result<void> write_exr(const std::filesystem::path& file, const ExrImage& image) {
  if (auto checked = check_for_writing(image); !checked) {
    return tl::unexpected(std::move(checked.error()).with_context(file.string()));
  }
  try {
    Imf::Header header(static_cast<int>(image.width_px), static_cast<int>(image.height_px));
    header.compression() = Imf::ZIP_COMPRESSION;
    insert_attributes(header, image);
    Imf::FrameBuffer frame;
    for (const ExrChannel& channel : image.channels) {
      header.channels().insert(channel.name, Imf::Channel(Imf::FLOAT));
      // The library takes a mutable pointer both for reading and for writing; here it only reads.
      frame.insert(channel.name, slice_of(const_cast<float*>(channel.pixels.data()),
                                          header.dataWindow(), image.width_px));
    }
    Imf::OutputFile output(file.c_str(), header);
    output.setFrameBuffer(frame);
    output.writePixels(static_cast<int>(image.height_px));
  } catch (const std::exception& error) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", file.string(), error.what()));
  }
  return {};
}

physics::Result<ExrImage> read_exr(const std::filesystem::path& file) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(file, status)) {
    return make_error(ErrorCode::not_found, fmt::format("{}: no such file", file.string()));
  }
  try {
    if (auto checked = check_exr_header(file); !checked) {
      return tl::unexpected(std::move(checked.error()).with_context(file.string()));
    }
    Imf::InputFile input(file.c_str());
    physics::Result<ExrImage> image = read_open_file(input);
    if (!image) {
      return tl::unexpected(std::move(image.error()).with_context(file.string()));
    }
    return image;
  } catch (const std::exception& error) {
    return make_error(ErrorCode::parse, fmt::format("{}: {}", file.string(), error.what()));
  }
}

void set_frame_metadata(ExrImage& image, const FrameMetadata& metadata) {
  auto& attributes = image.attributes;
  const physics::Pose& pose = metadata.sensor_pose;
  attributes["simTimeNs"] = std::to_string(metadata.sim_time_ns);
  attributes["frameNumber"] = std::to_string(metadata.frame_number);
  attributes["posePositionXM"] = pose.position_world_m.x;
  attributes["posePositionYM"] = pose.position_world_m.y;
  attributes["posePositionZM"] = pose.position_world_m.z;
  attributes["poseQuatW"] = pose.world_from_body.w;
  attributes["poseQuatX"] = pose.world_from_body.x;
  attributes["poseQuatY"] = pose.world_from_body.y;
  attributes["poseQuatZ"] = pose.world_from_body.z;
  attributes["bandName"] = metadata.band_name;
  attributes["bandLoUm"] = metadata.band_lo_um;
  attributes["bandHiUm"] = metadata.band_hi_um;
  attributes["units"] = metadata.units;
  if (metadata.band_response) attributes["bandResponse"] = response_text(*metadata.band_response);
  if (metadata.fov_h_rad) attributes["fovHDeg"] = *metadata.fov_h_rad / physics::kDegree;
}

physics::Result<FrameMetadata> frame_metadata(const ExrImage& image) {
  FrameMetadata metadata;
  const auto sim_time = integer_attribute<std::int64_t>(image, "simTimeNs");
  const auto frame_number = integer_attribute<std::uint64_t>(image, "frameNumber");
  const auto band = text_attribute(image, "bandName");
  const auto units = text_attribute(image, "units");
  if (!sim_time) return tl::unexpected(sim_time.error());
  if (!frame_number) return tl::unexpected(frame_number.error());
  if (!band) return tl::unexpected(band.error());
  if (!units) return tl::unexpected(units.error());
  metadata.sim_time_ns = *sim_time;
  metadata.frame_number = *frame_number;
  metadata.band_name = *band;
  metadata.units = *units;
  if (image.attributes.contains("bandResponse")) {
    auto response = response_attribute(image);
    if (!response) return tl::unexpected(response.error());
    metadata.band_response = std::move(*response);
  }
  if (image.attributes.contains("fovHDeg")) {
    const auto fov_h_deg = number_attribute(image, "fovHDeg");
    if (!fov_h_deg) return tl::unexpected(fov_h_deg.error());
    metadata.fov_h_rad = *fov_h_deg * physics::kDegree;
  }
  physics::Pose& pose = metadata.sensor_pose;
  const std::pair<const char*, double*> numbers[] = {{"posePositionXM", &pose.position_world_m.x},
                                                     {"posePositionYM", &pose.position_world_m.y},
                                                     {"posePositionZM", &pose.position_world_m.z},
                                                     {"poseQuatW", &pose.world_from_body.w},
                                                     {"poseQuatX", &pose.world_from_body.x},
                                                     {"poseQuatY", &pose.world_from_body.y},
                                                     {"poseQuatZ", &pose.world_from_body.z},
                                                     {"bandLoUm", &metadata.band_lo_um},
                                                     {"bandHiUm", &metadata.band_hi_um}};
  for (const auto& [name, target] : numbers) {
    const physics::Result<double> value = number_attribute(image, name);
    if (!value) return tl::unexpected(value.error());
    *target = *value;
  }
  return metadata;
}

}  // namespace emit::image
