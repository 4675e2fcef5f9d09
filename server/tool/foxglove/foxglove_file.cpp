// SPDX-License-Identifier: Apache-2.0
#include "tool/foxglove/foxglove_file.hpp"

#include <bit>
#include <cmath>
#include <map>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/units.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "emit/protocol/record/message_schema.hpp"
#include "emit/v1/control.pb.h"
#include "foxglove/CameraCalibration.pb.h"
#include "foxglove/FrameTransform.pb.h"
#include "foxglove/LocationFix.pb.h"
#include "foxglove/Log.pb.h"
#include "foxglove/PoseInFrame.pb.h"
#include "foxglove/RawImage.pb.h"

namespace emit::tool {
namespace {

using physics::Result;

static_assert(std::endian::native == std::endian::little, "32FC1 is little endian");

constexpr const char* kWorldFrame = "world";
constexpr std::int64_t kSecondNs = 1'000'000'000;

void fill(std::int64_t stamp_ns, google::protobuf::Timestamp& out) {
  out.set_seconds(stamp_ns / kSecondNs);
  out.set_nanos(static_cast<std::int32_t>(stamp_ns % kSecondNs));
}

void fill(const glm::dvec3& from, foxglove::Vector3& out) {
  out.set_x(from.x);
  out.set_y(from.y);
  out.set_z(from.z);
}

void fill(const glm::dquat& from, foxglove::Quaternion& out) {
  out.set_x(from.x);
  out.set_y(from.y);
  out.set_z(from.z);
  out.set_w(from.w);
}

/// Begins a RawImage with everything but the pixels.
foxglove::RawImage raw_image(std::int64_t stamp_ns, std::string_view frame, std::uint32_t width_px,
                             std::uint32_t height_px, const char* encoding,
                             std::size_t pixel_bytes) {
  foxglove::RawImage out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_frame_id(std::string(frame));
  out.set_width(width_px);
  out.set_height(height_px);
  out.set_encoding(encoding);
  out.set_step(static_cast<std::uint32_t>(width_px * pixel_bytes));
  return out;
}

}  // namespace

struct FoxgloveFile::Impl {
  /// A topic with the number of its messages.
  struct Topic {
    std::uint16_t channel = 0;
    std::string message;  ///< name of the message type
    std::uint32_t messages = 0;
  };

  explicit Impl(protocol::McapWriter writer) : mcap(std::move(writer)) {}
  protocol::McapWriter mcap;
  std::map<std::string, std::uint16_t, std::less<>> schemas;  // by name of the message
  std::map<std::string, Topic, std::less<>> topics;
  std::string encoded;

  Result<Topic*> topic_of(std::string_view name, const google::protobuf::Descriptor& message) {
    if (const auto known = topics.find(name); known != topics.end()) return &known->second;
    auto schema = schemas.find(message.full_name());
    if (schema == schemas.end()) {
      auto id =
          mcap.add_schema(message.full_name(), "protobuf", protocol::file_descriptor_set(message));
      if (!id) return tl::unexpected(id.error());
      schema = schemas.emplace(message.full_name(), *id).first;
    }
    auto channel = mcap.add_channel(schema->second, name, "protobuf");
    if (!channel) return tl::unexpected(channel.error());
    return &topics.emplace(std::string(name), Topic{*channel, message.full_name(), 0})
                .first->second;
  }

  Result<void> write(std::string_view name, std::int64_t stamp_ns,
                     const google::protobuf::Message& message) {
    auto topic = topic_of(name, *message.GetDescriptor());
    if (!topic) return tl::unexpected(topic.error());
    message.SerializeToString(&encoded);
    return mcap.write((*topic)->channel, ++(*topic)->messages, stamp_ns, stamp_ns,
                      std::as_bytes(std::span(encoded)));
  }
};

FoxgloveFile::FoxgloveFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FoxgloveFile::FoxgloveFile(FoxgloveFile&&) noexcept = default;
FoxgloveFile& FoxgloveFile::operator=(FoxgloveFile&&) noexcept = default;
FoxgloveFile::~FoxgloveFile() = default;

Result<FoxgloveFile> FoxgloveFile::create(const std::filesystem::path& path,
                                          std::string_view software) {
  protocol::McapWriterOptions options;
  options.library = software;
  options.chunk_bytes = 1U << 20;
  options.flush_interval_ns = kSecondNs;
  auto mcap = protocol::McapWriter::create(path, options);
  if (!mcap) return tl::unexpected(mcap.error());
  return FoxgloveFile(std::make_unique<Impl>(std::move(*mcap)));
}

Result<void> FoxgloveFile::pose(std::string_view topic, std::int64_t stamp_ns,
                                const physics::Pose& pose) {
  foxglove::PoseInFrame out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_frame_id(kWorldFrame);
  fill(pose.position_world_m, *out.mutable_pose()->mutable_position());
  fill(pose.world_from_body, *out.mutable_pose()->mutable_orientation());
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::transform(std::string_view topic, std::int64_t stamp_ns,
                                     std::string_view child_frame, const physics::Pose& pose) {
  foxglove::FrameTransform out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_parent_frame_id(kWorldFrame);
  out.set_child_frame_id(std::string(child_frame));
  fill(pose.position_world_m, *out.mutable_translation());
  fill(pose.world_from_body, *out.mutable_rotation());
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::location(std::string_view topic, std::int64_t stamp_ns,
                                    std::string_view frame, const physics::GeoPlace& place) {
  foxglove::LocationFix out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_frame_id(std::string(frame));
  out.set_latitude(place.latitude.value() / physics::kDegree);
  out.set_longitude(place.longitude.value() / physics::kDegree);
  out.set_altitude(place.height.value());
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::image(std::string_view topic, std::int64_t stamp_ns,
                                 std::string_view frame, std::uint32_t width_px,
                                 std::span<const float> values) {
  EMIT_CHECK_OP(width_px, >, 0U);
  EMIT_CHECK_OP(values.size() % width_px, ==, 0U);
  const auto height_px = static_cast<std::uint32_t>(values.size() / width_px);
  foxglove::RawImage out = raw_image(stamp_ns, frame, width_px, height_px, "32FC1", sizeof(float));
  out.set_data(values.data(), values.size_bytes());
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::image(std::string_view topic, std::int64_t stamp_ns,
                                 std::string_view frame, const image::RgbImage& picture) {
  foxglove::RawImage out =
      raw_image(stamp_ns, frame, picture.width_px, picture.height_px, "rgb8", sizeof(image::Rgb));
  out.set_data(picture.rgb.data(), picture.rgb.size());
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::calibration(std::string_view topic, std::int64_t stamp_ns,
                                       std::string_view frame, const PinholeCamera& camera) {
  foxglove::CameraCalibration out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_frame_id(std::string(frame));
  out.set_width(camera.width_px);
  out.set_height(camera.height_px);
  const double f = camera.focal_px;
  const auto [cx, cy] = camera.centre_px;
  const auto add = [](google::protobuf::RepeatedField<double>& field,
                      std::initializer_list<double> values) {
    for (const double value : values) field.Add(value);
  };
  add(*out.mutable_k(), {f, 0, cx, 0, f, cy, 0, 0, 1});
  add(*out.mutable_r(), {1, 0, 0, 0, 1, 0, 0, 0, 1});
  add(*out.mutable_p(), {f, 0, cx, 0, 0, f, cy, 0, 0, 0, 1, 0});
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::event(std::string_view topic, std::int64_t stamp_ns, EventLevel level,
                                 std::string_view name, const std::string& text) {
  foxglove::Log out;
  fill(stamp_ns, *out.mutable_timestamp());
  out.set_level(level == EventLevel::info      ? foxglove::Log::INFO
                : level == EventLevel::warning ? foxglove::Log::WARNING
                                               : foxglove::Log::ERROR);
  out.set_name(std::string(name));
  out.set_message(text);
  return impl_->write(topic, stamp_ns, out);
}

Result<void> FoxgloveFile::frame(std::string_view topic, std::int64_t stamp_ns,
                                 const v1::FrameDecision& decision) {
  return impl_->write(topic, stamp_ns, decision);
}

std::vector<FoxgloveTopic> FoxgloveFile::topics() const {
  std::vector<FoxgloveTopic> out;
  for (const auto& [name, topic] : impl_->topics) {
    out.push_back({name, topic.message, topic.messages});
  }
  return out;
}

Result<void> FoxgloveFile::close() {
  return impl_->mcap.close();
}

}  // namespace emit::tool
