// SPDX-License-Identifier: Apache-2.0
// Sends poses to a daemon and receives the frames that show them.
#include <cstdio>
#include <emit/client/client.hpp>
#include <string>

namespace {

constexpr std::int64_t kTimeoutNs = 10'000'000'000;
constexpr std::uint64_t kFrames = 5;

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return fail("usage: outside tcp://HOST:PORT");

  // Subscribe to the first channel, so that no frame of the run is missed.
  auto frames = emit::client::FrameClient::connect(argv[1], kTimeoutNs);
  if (!frames) return fail(frames.error().text);
  const auto channel = (*frames)->subscribe({});
  if (!channel) return fail(channel.error().text);

  // Send one pose after the other and receive the frame of each.
  auto host = emit::client::HostClient::connect(argv[1], kTimeoutNs);
  if (!host) return fail(host.error().text);
  for (std::uint64_t number = 1; number <= kFrames; ++number) {
    emit::protocol::HostFrameData pose;
    pose.run_id = 1;
    pose.frame_number = number;
    pose.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
    if (const auto sent = (*host)->send(pose, kTimeoutNs); !sent) return fail(sent.error().text);
    const auto frame = (*frames)->receive(kTimeoutNs);
    if (!frame) return fail(frame.error().text);
    if (*frame == nullptr) return fail("no frame within ten seconds");
    if ((*frame)->pixels.size() != std::size_t{channel->width_px} * channel->height_px) {
      return fail("the frame has another size than its channel");
    }
    std::printf("frame %llu: host frame %llu, %zu pixels\n",
                static_cast<unsigned long long>((*frame)->header.frame_number),
                static_cast<unsigned long long>((*frame)->header.host_frame_number),
                (*frame)->pixels.size());
  }
  return 0;
}
