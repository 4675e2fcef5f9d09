// SPDX-License-Identifier: Apache-2.0
#include "app/recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <span>
#include <string_view>
#include <utility>

#include "agents/receiver/channel_info.hpp"
#include "app/sha256.hpp"
#include "emit/config/load.hpp"
#include "emit/v1/control.pb.h"
#include "emit/version.hpp"

namespace emit::server {
namespace {

using Kind = SetupDifference::Kind;
using Values = google::protobuf::RepeatedPtrField<v1::ConfigValue>;

/// Returns the value, or its hash where it is long.
std::string shortened(std::string value) {
  if (value.size() <= kMaxRecordedValueBytes) return value;
  Sha256 hash;
  hash.update(std::as_bytes(std::span(value)));
  return fmt::format("sha256:{} ({} bytes)", hash.finish(), value.size());
}

/// Adds the values of a printed configuration while there is room. Returns how many found none.
std::uint32_t add_values(std::string_view printed, std::size_t& room_bytes, Values& out) {
  constexpr std::size_t kFramingBytes = 8;
  std::uint32_t left_out = 0;
  for (config::ConfigValue& one : config::list_values(printed)) {
    std::string value = shortened(std::move(one.value));
    const std::size_t bytes = one.key.size() + value.size() + kFramingBytes;
    if (left_out > 0 || bytes > room_bytes) {
      ++left_out;
      continue;
    }
    room_bytes -= bytes;
    v1::ConfigValue& added = *out.Add();
    added.set_key(std::move(one.key));
    added.set_value(std::move(value));
  }
  return left_out;
}

/// Version and commit of what build_text() wrote; both are the text where it is another.
std::pair<std::string, std::string> build_of(const std::string& software) {
  const std::size_t space = software.find(' ');
  const std::size_t open = software.find(" (", space + 1);
  if (space == std::string::npos || open == std::string::npos || !software.ends_with(')')) {
    return {software, software};
  }
  return {software.substr(space + 1, open - space - 1),
          software.substr(open + 2, software.size() - open - 3)};
}

using NamedTexts = std::vector<std::pair<std::string, std::string>>;

NamedTexts texts_of(const Values& values) {
  NamedTexts out;
  for (const v1::ConfigValue& one : values) out.emplace_back(one.key(), one.value());
  return out;
}

NamedTexts texts_of(const google::protobuf::RepeatedPtrField<v1::SceneFile>& files) {
  NamedTexts out;
  for (const v1::SceneFile& file : files) {
    out.emplace_back(file.name(), fmt::format("{} bytes, SHA-256 {}", file.bytes(), file.sha256()));
  }
  return out;
}

NamedTexts texts_of(const google::protobuf::RepeatedPtrField<v1::ChannelInfo>& channels) {
  NamedTexts out;
  for (const v1::ChannelInfo& one : channels) {
    out.emplace_back(
        one.name(), fmt::format("number {}, {} of sensor {}, band {} ({:g} to {:g} um, {} response "
                                "samples), {} x {} px at {},{} of {} x {}, every {}, {} ahead",
                                one.index(), one.kind(), one.sensor(), one.band(), one.band_lo_um(),
                                one.band_hi_um(), one.response_um_size(), one.width_px(),
                                one.height_px(), one.window_x_px(), one.window_y_px(),
                                one.sensor_width_px(), one.sensor_height_px(),
                                std::max(one.every_nth(), 1U), one.look_ahead_frames()));
  }
  return out;
}

/// Adds what differs between two lists, by name. The order is that of the recording, then what is
/// only here. A name that comes twice stands for its last text.
void compare(Kind kind, const NamedTexts& recorded, const NamedTexts& here,
             std::vector<SetupDifference>& out) {
  std::map<std::string, std::string> own(here.begin(), here.end());
  for (const auto& [name, text] : here) own[name] = text;
  std::map<std::string, std::string> theirs;
  for (const auto& [name, text] : recorded) theirs[name] = text;
  for (const auto& [name, last] : recorded) {
    const auto found = theirs.find(name);
    if (found == theirs.end()) continue;  // compared before
    const auto same = own.find(name);
    if (same == own.end()) {
      out.push_back({kind, name, found->second, {}});
    } else if (same->second != found->second) {
      out.push_back({kind, name, found->second, same->second});
    }
    if (same != own.end()) own.erase(same);
    theirs.erase(found);
  }
  for (const auto& [name, text] : here) {
    if (own.erase(name) > 0) out.push_back({kind, name, {}, text});
  }
}

}  // namespace

std::string build_text(std::string_view program) {
  return fmt::format("{} {} ({})", program, kVersion, kCommit);
}

void fill(const ScenarioIdentity* identity, const config::DaemonConfig* daemon,
          const std::vector<Channel>& channels, v1::Recording& out) {
  for (const Channel& channel : channels) fill(channel, *out.add_channels());
  std::size_t room_bytes = kMaxRecordedBytes - std::min(out.ByteSizeLong(), kMaxRecordedBytes);
  std::uint32_t left_out = 0;
  // The daemon's keys are few, and a large scene must not push them out.
  if (daemon != nullptr) {
    left_out += add_values(config::print_daemon(*daemon), room_bytes, *out.mutable_daemon());
  }
  if (identity != nullptr) {
    left_out += add_values(identity->printed, room_bytes, *out.mutable_scenario());
    for (const SceneFile& file : identity->files) {
      const std::size_t bytes = file.name.size() + file.sha256.size() + 24;
      if (bytes > room_bytes) {
        ++left_out;
        continue;
      }
      room_bytes -= bytes;
      v1::SceneFile& added = *out.add_files();
      added.set_name(file.name);
      added.set_sha256(file.sha256);
      added.set_bytes(file.bytes);
    }
  }
  out.set_values_left_out(left_out);
}

bool SetupDifference::is_decisive() const noexcept {
  return kind == Kind::scenario || kind == Kind::channel;
}

std::string SetupDifference::text() const {
  const auto or_none = [](const std::string& text) { return text.empty() ? "nothing" : text; };
  const auto named = [&]() -> std::string {
    switch (kind) {
      case Kind::version:
        return "version";
      case Kind::commit:
        return "commit";
      case Kind::device:
        return "device";
      case Kind::scenario:
        return "scenario";
      case Kind::file:
        return "file " + name;
      case Kind::channel:
        return "channel " + name;
      case Kind::value:
        break;
    }
    return name;
  };
  return fmt::format("{}: recorded {}, here {}", named(), or_none(recorded), or_none(here));
}

std::vector<SetupDifference> compare_setup(const RunOrigin& recorded,
                                           const v1::Recording* recording, const RunOrigin& here,
                                           const v1::Recording& own) {
  std::vector<SetupDifference> out;
  const auto add = [&](Kind kind, const std::string& theirs, const std::string& ours) {
    if (theirs != ours) out.push_back({kind, {}, theirs, ours});
  };
  const auto [version, commit] = build_of(recorded.software);
  const auto [own_version, own_commit] = build_of(here.software);
  add(Kind::version, version, own_version);
  if (commit != version) add(Kind::commit, commit, own_commit);
  add(Kind::device, recorded.device, here.device);
  const bool same_scenario = recorded.scenario_sha256 == here.scenario_sha256;
  if (!same_scenario) {
    const auto scenario = [](const RunOrigin& origin) {
      return origin.scenario_sha256.empty()
                 ? std::string("canned frames")
                 : fmt::format("{} (SHA-256 {})", origin.scenario_name, origin.scenario_sha256);
    };
    out.push_back({Kind::scenario, {}, scenario(recorded), scenario(here)});
  }
  if (recording == nullptr) return out;
  if (!same_scenario) {
    compare(Kind::value, texts_of(recording->scenario()), texts_of(own.scenario()), out);
    compare(Kind::file, texts_of(recording->files()), texts_of(own.files()), out);
  }
  compare(Kind::channel, texts_of(recording->channels()), texts_of(own.channels()), out);
  return out;
}

}  // namespace emit::server
