// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/pose_pcap.hpp"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/record/capture_reader.hpp"
#include "quiet_protobuf.hpp"

namespace emit::protocol {

using physics::Result;

struct PosePcapReader::Impl {
  Impl(std::filesystem::path file, CaptureReader reader, std::uint16_t udp_port)
      : path(std::move(file)), capture(std::move(reader)), port(udp_port) {}

  std::filesystem::path path;
  CaptureReader capture;
  std::uint16_t port;
  std::optional<HostFrameDecoder> decoder;  // made for the first datagram: it is large
  HostFrameData host;
  std::uint64_t refused = 0;
  std::string first_refusal;
};

PosePcapReader::PosePcapReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PosePcapReader::PosePcapReader(PosePcapReader&&) noexcept = default;
PosePcapReader& PosePcapReader::operator=(PosePcapReader&&) noexcept = default;
PosePcapReader::~PosePcapReader() = default;

bool PosePcapReader::is_capture(const std::filesystem::path& path) {
  return CaptureReader::is_capture(path);
}

Result<PosePcapReader> PosePcapReader::open(const std::filesystem::path& path,
                                            std::uint16_t udp_port) {
  quiet_protobuf();
  auto capture = CaptureReader::open(path, udp_port);
  if (!capture) return tl::unexpected(capture.error());
  return PosePcapReader(std::make_unique<Impl>(path, std::move(*capture), udp_port));
}

Result<bool> PosePcapReader::next() {
  for (;;) {
    const auto more = impl_->capture.next();
    if (!more || !*more) return more;
    if (!impl_->decoder) impl_->decoder.emplace();
    const DecodeStatus status =
        decode_host_frame(impl_->capture.payload(), *impl_->decoder, impl_->host);
    if (status == DecodeStatus::ok) return true;
    if (++impl_->refused == 1) {
      impl_->first_refusal =
          fmt::format("packet {}: {}", impl_->capture.packet(), to_string(status));
    }
  }
}

const HostFrameData& PosePcapReader::host() const noexcept {
  return impl_->host;
}

std::optional<std::string> PosePcapReader::notes() const {
  const std::optional<std::string> of_capture = impl_->capture.notes();
  if (impl_->refused == 0) return of_capture;
  return fmt::format("{}: {} datagrams to port {} are no host frames ({}){}", impl_->path.string(),
                     impl_->refused, impl_->port, impl_->first_refusal,
                     of_capture ? "; " + *of_capture : "");
}

}  // namespace emit::protocol
