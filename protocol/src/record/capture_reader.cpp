// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/capture_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "captured_datagram.hpp"
#include "pcap_file.hpp"

namespace emit::protocol {

using physics::Error;
using physics::ErrorCode;
using physics::Result;

struct CaptureReader::Impl {
  Impl(std::filesystem::path file, PcapFile reader, std::uint16_t udp_port)
      : path(std::move(file)), capture(std::move(reader)), port(udp_port) {}

  std::filesystem::path path;
  PcapFile capture;
  std::uint16_t port;
  std::vector<std::byte> payload;  // of the newest datagram to the port
  std::uint64_t datagrams = 0;
  std::uint64_t repeated = 0;
  std::uint64_t later_fragments = 0;
  std::uint64_t unread = 0;  // packets of network layers that are not handled
  std::string first_unread;
  std::optional<Error> failure;

  tl::unexpected<Error> fail(ErrorCode code, std::string_view text) {
    failure =
        Error{code, fmt::format("{}: packet {}: {}", path.string(), capture.packet().number, text)};
    return tl::unexpected(*failure);
  }
  /// Returns true when the datagram is not the one before once more.
  bool take(std::span<const std::byte> bytes) {
    // Captures on the "any" interface hold local datagrams twice.
    if (datagrams > 0 && std::ranges::equal(bytes, payload)) {
      ++repeated;
      return false;
    }
    payload.assign(bytes.begin(), bytes.end());
    ++datagrams;
    return true;
  }
};

CaptureReader::CaptureReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CaptureReader::CaptureReader(CaptureReader&&) noexcept = default;
CaptureReader& CaptureReader::operator=(CaptureReader&&) noexcept = default;
CaptureReader::~CaptureReader() = default;

bool CaptureReader::is_capture(const std::filesystem::path& path) {
  return PcapFile::is_capture(path);
}

Result<CaptureReader> CaptureReader::open(const std::filesystem::path& path,
                                          std::uint16_t udp_port) {
  auto capture = PcapFile::open(path);
  if (!capture) return tl::unexpected(capture.error());
  return CaptureReader(std::make_unique<Impl>(path, std::move(*capture), udp_port));
}

Result<bool> CaptureReader::next() {
  using Kind = CapturedDatagram::Kind;
  if (impl_->failure) return tl::unexpected(*impl_->failure);
  for (;;) {
    const auto more = impl_->capture.next();
    if (!more || !*more) return more;
    const CapturedPacket& packet = impl_->capture.packet();
    const CapturedDatagram found = find_datagram(packet);
    if (found.kind == Kind::unknown_link_layer) {
      return impl_->fail(ErrorCode::unsupported,
                         fmt::format("link type {} is not handled: Ethernet, Linux cooked, "
                                     "loopback and raw IP are",
                                     packet.link_type));
    }
    if (found.kind == Kind::later_fragment) ++impl_->later_fragments;
    if (found.kind == Kind::unknown_network && ++impl_->unread == 1) {
      impl_->first_unread =
          fmt::format("packet {}: Ethernet type 0x{:04x}", packet.number, found.ether_type);
    }
    if (found.kind == Kind::none || found.kind == Kind::later_fragment ||
        found.kind == Kind::unknown_network || found.destination_port != impl_->port)
      continue;
    if (found.kind == Kind::fragment) {
      return impl_->fail(ErrorCode::unsupported,
                         fmt::format("a datagram to port {} in IP fragments, which are not put "
                                     "together here: capture where host frames fit the link's MTU "
                                     "(loopback, jumbo frames)",
                                     impl_->port));
    }
    if (found.kind == Kind::cut) {
      return impl_->fail(ErrorCode::unsupported,
                         fmt::format("only {} of {} bytes were captured: capture whole packets "
                                     "(tcpdump -s 0)",
                                     packet.data.size(), packet.wire_bytes));
    }
    if (impl_->take(found.payload)) return true;
  }
}

std::span<const std::byte> CaptureReader::payload() const noexcept {
  return impl_->payload;
}

std::optional<std::int64_t> CaptureReader::time_ns() const noexcept {
  return impl_->capture.packet().time_ns;
}

std::uint64_t CaptureReader::packet() const noexcept {
  return impl_->capture.packet().number;
}

std::optional<std::string> CaptureReader::notes() const {
  std::string out;
  const auto add = [&](const std::string& text) {
    out += (out.empty() ? "" : "; ") + impl_->path.string() + ": " + text;
  };
  if (impl_->repeated > 0) {
    add(fmt::format("{} datagrams stand there twice and are used once", impl_->repeated));
  }
  if (impl_->datagrams == 0) {
    add(fmt::format("none of {} packets is a datagram to port {}", impl_->capture.packet().number,
                    impl_->port));
  }
  if (impl_->later_fragments > 0) {
    add(fmt::format("{} later IP fragments of UDP datagrams, whose port is not known, are left out",
                    impl_->later_fragments));
  }
  if (impl_->unread > 0) {
    add(fmt::format("{} packets are neither IP nor ARP and are left out ({})", impl_->unread,
                    impl_->first_unread));
  }
  if (impl_->capture.truncation()) {
    out += (out.empty() ? "" : "; ") + *impl_->capture.truncation();
  }
  return out.empty() ? std::nullopt : std::optional(out);
}

}  // namespace emit::protocol
