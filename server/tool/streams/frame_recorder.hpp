// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "emit/client/client.hpp"
#include "emit/protocol/pixel_codec.hpp"
#include "emit/protocol/record/log.hpp"

namespace emit::tool {

/// Writes the images of one channel into a log, beside the journal, and compares their checksums
/// with those of the journal.
/// Thread: one owner.
class FrameRecorder {
 public:
  /// Subscribes to every frame of a channel. Errors: those of FrameClient::connect() and
  /// subscribe().
  /// @param channel_name  empty: the first channel
  [[nodiscard]] static physics::Result<FrameRecorder> connect(const std::string& url,
                                                              const std::string& channel_name,
                                                              const client::Security& security);

  /// Writes the images that have come; waits up to `timeout_ns` for the first one. Returns whether
  /// there was one. Errors: those of the log; those of FrameClient::receive(), after which no
  /// further image comes.
  [[nodiscard]] physics::Result<bool> take(protocol::LogWriter& log, std::int64_t timeout_ns);
  /// Takes note of an entry of the journal.
  void note(const v1::JournalEntry& entry);
  /// Returns true while the newest frame of the journal that the channel shows has no image yet.
  [[nodiscard]] bool waits() const noexcept;

  [[nodiscard]] std::uint64_t images() const noexcept { return images_; }
  [[nodiscard]] std::uint64_t raw_bytes() const noexcept { return raw_bytes_; }
  [[nodiscard]] std::uint64_t stored_bytes() const noexcept { return stored_bytes_; }
  /// Images whose checksum was compared with the journal's, and those that differ.
  [[nodiscard]] std::uint64_t compared() const noexcept { return compared_; }
  [[nodiscard]] std::uint64_t differ() const noexcept { return differ_; }
  /// Frames of the channel that did not come or came damaged.
  [[nodiscard]] std::uint64_t lost() const noexcept;

 private:
  /// Run and number of a frame.
  using Key = std::pair<std::uint64_t, std::uint64_t>;

  FrameRecorder(std::unique_ptr<client::FrameClient> client, client::ChannelDescription channel);
  [[nodiscard]] physics::Result<void> write(protocol::LogWriter& log,
                                            const client::ReceivedFrame& frame);
  void compare(std::map<Key, std::uint32_t>& with, std::map<Key, std::uint32_t>& keep_in,
               const Key& key, std::uint32_t crc);

  std::unique_ptr<client::FrameClient> client_;
  client::ChannelDescription channel_;
  protocol::PixelEncoder encoder_;
  std::uint64_t run_id_ = 0;              // of the newest run start in the journal
  std::optional<Key> newest_in_journal_;  // frame that the channel shows
  std::optional<Key> newest_image_;
  std::map<Key, std::uint32_t> of_journal_;  // checksums that wait for the image
  std::map<Key, std::uint32_t> of_images_;   // checksums that wait for the journal
  std::uint64_t images_ = 0;
  std::uint64_t raw_bytes_ = 0;
  std::uint64_t stored_bytes_ = 0;
  std::uint64_t compared_ = 0;
  std::uint64_t differ_ = 0;
};

}  // namespace emit::tool
