// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/log_setup.hpp"

#include <fmt/format.h>

#include "emit/v1/control.pb.h"

namespace emit::tool {
namespace {

Json json_of(const google::protobuf::RepeatedPtrField<v1::ConfigValue>& values) {
  Json json = Json::object();
  for (const v1::ConfigValue& one : values) json.set(one.key(), one.value());
  return json;
}

}  // namespace

std::string setup_text(const protocol::LogRunOutline& run) {
  if (run.recording == nullptr) return "not recorded: the daemon was an older one";
  const v1::Recording& setup = *run.recording;
  std::string text = fmt::format(
      "{} values of the scenario, {} of the daemon, {} files, {} channels", setup.scenario_size(),
      setup.daemon_size(), setup.files_size(), setup.channels_size());
  if (setup.values_left_out() > 0) {
    text += fmt::format("; no room for {} more", setup.values_left_out());
  }
  return text + " (--json lists them)";
}

Json setup_json(const protocol::LogRunOutline& run) {
  if (run.recording == nullptr) return {};
  const v1::Recording& setup = *run.recording;
  Json json = Json::object();
  json.set("scenario", json_of(setup.scenario())).set("daemon", json_of(setup.daemon()));
  Json files = Json::array();
  for (const v1::SceneFile& file : setup.files()) {
    Json one = Json::object();
    one.set("name", file.name()).set("sha256", file.sha256()).set("bytes", file.bytes());
    files.push(std::move(one));
  }
  Json channels = Json::array();
  for (const v1::ChannelInfo& channel : setup.channels()) {
    Json one = Json::object();
    one.set("name", channel.name()).set("kind", channel.kind()).set("band", channel.band());
    one.set("width_px", channel.width_px()).set("height_px", channel.height_px());
    channels.push(std::move(one));
  }
  json.set("files", std::move(files)).set("channels", std::move(channels));
  json.set("values_left_out", setup.values_left_out());
  return json;
}

}  // namespace emit::tool
