// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/pose_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"

namespace emit::tool {
bool is_pose_csv(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".csv";
}

physics::Result<PoseLog> PoseLog::open(const std::filesystem::path& file, std::uint16_t host_port) {
  if (is_pose_csv(file)) {
    auto reader = protocol::PoseCsvReader::open(file);
    if (!reader) return tl::unexpected(reader.error());
    return PoseLog(std::move(*reader));
  }
  if (protocol::PosePcapReader::is_capture(file)) {
    auto reader = protocol::PosePcapReader::open(file, host_port);
    if (!reader) return tl::unexpected(reader.error());
    return PoseLog(std::move(*reader));
  }
  auto reader = protocol::LogReader::open(file);
  if (!reader) return tl::unexpected(reader.error());
  return PoseLog(std::move(*reader));
}

physics::Result<bool> PoseLog::next() {
  if (auto* csv = std::get_if<protocol::PoseCsvReader>(&reader_)) return csv->next();
  if (auto* pcap = std::get_if<protocol::PosePcapReader>(&reader_)) return pcap->next();
  auto& log = std::get<protocol::LogReader>(reader_);
  while (true) {
    auto more = log.next();
    if (!more || !*more) return more;
    in_journal_ = log.topic() == protocol::LogTopic::journal;
    if (!in_journal_) return more;
    if (!log.journal().has_host_frame()) continue;
    const auto status = protocol::from_proto(log.journal().host_frame(), *of_journal_);
    if (status == protocol::DecodeStatus::ok) return more;
    return physics::make_error(physics::ErrorCode::parse,
                               fmt::format("entry {} of the journal: {}", log.journal().sequence(),
                                           protocol::to_string(status)));
  }
}

const protocol::HostFrameData& PoseLog::host() const noexcept {
  if (const auto* csv = std::get_if<protocol::PoseCsvReader>(&reader_)) return csv->host();
  if (const auto* pcap = std::get_if<protocol::PosePcapReader>(&reader_)) return pcap->host();
  return in_journal_ ? *of_journal_ : std::get_if<protocol::LogReader>(&reader_)->host();
}

std::optional<std::string> PoseLog::notes() const {
  if (const auto* pcap = std::get_if<protocol::PosePcapReader>(&reader_)) return pcap->notes();
  const auto* log = std::get_if<protocol::LogReader>(&reader_);
  if (log == nullptr || !log->truncation()) return std::nullopt;
  return std::string(*log->truncation());
}

}  // namespace emit::tool
