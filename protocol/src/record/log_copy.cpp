// SPDX-License-Identifier: Apache-2.0
#include "record/log_copy.hpp"

#include <algorithm>
#include <limits>

#include "record/log_message.hpp"

namespace emit::protocol {
namespace {

using physics::Result;

/// MCAP times are unsigned. The writer refuses what does not fit as negative.
std::int64_t signed_ns(std::uint64_t time_ns) noexcept {
  return time_ns > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())
             ? -1
             : static_cast<std::int64_t>(time_ns);
}

}  // namespace

Result<LogCopier> LogCopier::create(const std::filesystem::path& target,
                                    std::span<const std::filesystem::path> inputs,
                                    const McapWriterOptions& options) {
  auto part = PartFile::begin(target, inputs);
  if (!part) return tl::unexpected(part.error());
  auto mcap = McapWriter::create(part->path(), options);
  if (!mcap) return tl::unexpected(mcap.error());
  return LogCopier(std::move(*part), std::move(*mcap));
}

Result<void> LogCopier::copy(std::size_t source, const McapReader& from,
                             std::optional<std::span<const std::byte>> data) {
  const McapMessage& message = from.message();
  const auto target = target_of(source, from, message.channel_id);
  if (!target) return tl::unexpected(target.error());
  const std::uint32_t sequence = target->renumbered ? ++sequences_[target->id] : message.sequence;
  auto written = mcap_.write(target->id, sequence, signed_ns(message.log_time_ns),
                             signed_ns(message.publish_time_ns), data.value_or(message.data));
  if (written) ++messages_;
  return written;
}

Result<void> LogCopier::finish() {
  if (auto closed = mcap_.close(); !closed) return closed;
  return part_.commit();
}

Result<LogCopier::Target> LogCopier::target_of(std::size_t source, const McapReader& from,
                                               std::uint16_t channel_id) {
  const auto known = targets_.find({source, channel_id});
  if (known != targets_.end()) return known->second;
  // Declare all channels that the file has shown, so that those of emitd's logs stand in front of
  // the messages as in the file.
  for (const auto& [id, channel] : from.channels()) {
    if (targets_.contains({source, id})) continue;
    const auto added = add_channel(from, channel);
    if (!added) return added;
    targets_.emplace(std::pair(source, id), *added);
  }
  return targets_.at({source, channel_id});
}

Result<std::uint16_t> LogCopier::add_schema(const McapSchema* schema) {
  if (schema == nullptr) return std::uint16_t{0};
  const auto same = std::ranges::find_if(schemas_, [&](const KnownSchema& known) {
    return known.schema.name == schema->name && known.schema.encoding == schema->encoding &&
           known.schema.data == schema->data;
  });
  if (same != schemas_.end()) return same->id;
  const auto id = mcap_.add_schema(schema->name, schema->encoding, schema->data);
  if (id) schemas_.push_back({*schema, *id});
  return id;
}

Result<LogCopier::Target> LogCopier::add_channel(const McapReader& from,
                                                 const McapChannel& channel) {
  const bool renumbered = log_topic_of(channel).has_value();
  const auto schema_id = add_schema(from.schema(channel.schema_id));
  if (!schema_id) return tl::unexpected(schema_id.error());
  const auto same = std::ranges::find_if(channels_, [&](const KnownChannel& known) {
    return known.channel.schema_id == *schema_id && known.channel.topic == channel.topic &&
           known.channel.message_encoding == channel.message_encoding;
  });
  if (same != channels_.end()) return Target{same->id, renumbered};
  const auto id = mcap_.add_channel(*schema_id, channel.topic, channel.message_encoding);
  if (!id) return tl::unexpected(id.error());
  channels_.push_back({{*schema_id, channel.topic, channel.message_encoding}, *id});
  return Target{*id, renumbered};
}

}  // namespace emit::protocol
