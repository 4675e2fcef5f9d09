// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "emit/config/motion_controller.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/shared_ring.hpp"
#include "keys/data_files.hpp"
#include "overrides.hpp"
#include "resolve/resolve.hpp"

namespace emit::config {

using physics::Result;

namespace {

/// Message to who gives a scenario where a configuration of the daemon is due.
std::string text_of_scenario(const std::filesystem::path& file) {
  const Result<std::filesystem::path> profile = find_data_file("profiles/default.toml");
  return fmt::format(
      "{0}: this is a scenario, not a configuration of the daemon; `emitd --config {1} --set "
      "scenario={0}` serves it, and so does the key 'scenario' of a configuration",
      file.string(), profile ? profile->string() : "PROFILE");
}

void check_endpoint(const Node& table, std::string_view key, const std::string& value,
                    bool may_be_empty, Diagnostics& diagnostics) {
  if ((may_be_empty && value.empty()) || is_endpoint(value)) {
    return;
  }
  diagnostics.add(key_location(table, key), fmt::format("'{}' is '{}', must be address:port{}", key,
                                                        value, may_be_empty ? " or empty" : ""));
}

void resolve_daemon_scenario(const Node& root, const std::string& text, DaemonConfig& daemon,
                             Diagnostics& diagnostics) {
  if (text.empty()) {
    if (daemon.source.kind == SourceKind::renderer) {
      diagnostics.add(key_location(root, "scenario"),
                      "key 'scenario' is missing (only a canned source goes without)");
    }
    return;
  }
  const Location& at = key_location(root, "scenario");
  std::error_code code;
  Result<std::filesystem::path> path =
      resolve_path(text, at.source ? at.source->directory : std::filesystem::path());
  if (!path || !std::filesystem::is_regular_file(*path, code)) {
    path = resolve_scenario(text);
  }
  if (!path) {
    diagnostics.add(at, path.error().text);
    return;
  }
  daemon.scenario = std::filesystem::absolute(*path, code).lexically_normal();
}

/// Checks that the axes of the motion simulator fit its rings.
void check_motion(const Node& table, const MotionConfig& motion, Diagnostics& diagnostics) {
  if (const auto controller = parse_motion_controller(motion.controller); !controller) {
    diagnostics.add(key_location(table, "controller"),
                    fmt::format("'controller': {}", controller.error().text));
  }
  const bool has_target = motion.target_rings != TargetRings::none;
  const std::size_t wanted = has_target ? 5 : 3;
  if (motion.axes.size() != wanted) {
    diagnostics.add(key_location(table, "axes"),
                    fmt::format("'axes' has {} axes, must have {}: three rings of the unit{}",
                                motion.axes.size(), wanted,
                                has_target ? ", then azimuth and elevation of the target" : ""));
  }
  for (std::size_t i = 0; i < motion.axes.size(); ++i) {
    const MotionAxisConfig& axis = motion.axes[i];
    if (!(axis.min_rad < axis.max_rad)) {
      diagnostics.add(
          key_location(table, "axes"),
          fmt::format("'axes': axis {} has no travel: 'min_deg' must be below 'max_deg'", i + 1));
    } else if (!(axis.park_rad >= axis.min_rad && axis.park_rad <= axis.max_rad)) {
      diagnostics.add(key_location(table, "axes"),
                      fmt::format("'axes': 'park_deg' of axis {} is outside of its travel", i + 1));
    }
  }
  if (has_target && motion.target_entity == 0) {
    diagnostics.add(key_location(table, "target_entity"),
                    "'target_entity' is missing: the target rings need the entity to point to");
  }
}

/// Checks that every part has one number and one entity, and hangs on a part of its own entity.
void check_cigi_parts(const Node& table, const CigiConfig& cigi, Diagnostics& diagnostics) {
  const auto fault = [&](const std::string& text) {
    diagnostics.add(key_location(table, "parts"), "'parts': " + text);
  };
  constexpr std::size_t kMaxParts = protocol::kMaxEntitiesPerFrame;
  if (cigi.parts.size() > kMaxParts) {
    fault(fmt::format("has {} parts, must have {} at most", cigi.parts.size(), kMaxParts));
    return;
  }
  const auto find = [&](std::uint32_t id, std::uint32_t number) {
    return std::ranges::find_if(cigi.parts, [&](const CigiPartConfig& other) {
      return other.id == id && other.part == number;
    });
  };
  for (auto part = cigi.parts.begin(); part != cigi.parts.end(); ++part) {
    const std::string name = fmt::format("part {} of entity {}", part->part, part->id);
    if (find(part->id, part->part) != part) fault(name + " stands twice");
    const auto is_same = [&](const auto& other) { return other.entity == part->entity; };
    if (std::find_if(cigi.parts.begin(), part, is_same) != part ||
        std::ranges::any_of(cigi.entities, is_same)) {
      fault(fmt::format("entity {} stands twice", part->entity));
    }
    // Follow what carries the part, which ends at the entity.
    auto link = part;
    for (std::size_t steps = 0; link != cigi.parts.end() && link->on_part >= 0; ++steps) {
      if (steps == cigi.parts.size()) {
        fault(name + " hangs on itself");
        break;
      }
      const auto number = static_cast<std::uint32_t>(link->on_part);
      const auto carrier = find(part->id, number);
      if (carrier == cigi.parts.end() && link == part) {
        fault(fmt::format("{} hangs on part {}, which is not there", name, number));
      }
      link = carrier;
    }
  }
}

/// Checks that every entity of the host has one number, and the other way round.
void check_cigi(const Node& table, const CigiConfig& cigi, Diagnostics& diagnostics) {
  check_endpoint(table, "listen", cigi.listen, false, diagnostics);
  check_endpoint(table, "host", cigi.host, false, diagnostics);
  for (std::size_t i = 0; i < cigi.entities.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const bool same_id = cigi.entities[i].id == cigi.entities[k].id;
      if (!same_id && cigi.entities[i].entity != cigi.entities[k].entity) continue;
      diagnostics.add(key_location(table, "entities"),
                      fmt::format("'entities': {} {} stands twice", same_id ? "id" : "entity",
                                  same_id ? cigi.entities[i].id : cigi.entities[i].entity));
    }
  }
  check_cigi_parts(table, cigi, diagnostics);
}

void check_dis(const Node& table, const DisConfig& dis, Diagnostics& diagnostics) {
  check_endpoint(table, "listen", dis.listen, false, diagnostics);
  const auto check_id = [&](const char* key, const std::string& id) {
    if (parse_dis_id(id)) return;
    diagnostics.add(
        key_location(table, key),
        fmt::format("'{}': '{}' must be site:application:entity, each 0 to 65535", key, id));
  };
  check_id("seeker", dis.seeker);
  if (dis.entities.size() > protocol::kMaxEntitiesPerFrame) {
    diagnostics.add(key_location(table, "entities"),
                    fmt::format("'entities' has {} entities, must have {} at most",
                                dis.entities.size(), protocol::kMaxEntitiesPerFrame));
  }
  for (std::size_t i = 0; i < dis.entities.size(); ++i) {
    check_id("entities", dis.entities[i].id);
    if (dis.entities[i].id == dis.seeker) {
      diagnostics.add(key_location(table, "entities"),
                      fmt::format("'entities': {} is the seeker", dis.seeker));
    }
    for (std::size_t k = 0; k < i; ++k) {
      const bool same_id = dis.entities[i].id == dis.entities[k].id;
      if (!same_id && dis.entities[i].entity != dis.entities[k].entity) continue;
      diagnostics.add(key_location(table, "entities"),
                      fmt::format("'entities': {} stands twice",
                                  same_id ? dis.entities[i].id
                                          : fmt::format("entity {}", dis.entities[i].entity)));
    }
  }
}

/// Checks the hosts that do not speak emitd's own messages, of which there is one at most.
void check_gateways(const Node& root, const DaemonConfig& daemon, Diagnostics& diagnostics) {
  Diagnostics reported_before;
  const Node& net_fdm = section(root, "net_fdm", reported_before);
  if (daemon.cigi.enabled()) {
    check_cigi(section(root, "cigi", reported_before), daemon.cigi, diagnostics);
  }
  if (daemon.dis.enabled()) {
    check_dis(section(root, "dis", reported_before), daemon.dis, diagnostics);
  }
  if (daemon.net_fdm.enabled()) {
    check_endpoint(net_fdm, "listen", daemon.net_fdm.listen, false, diagnostics);
  }
  const int count =
      int{daemon.cigi.enabled()} + int{daemon.dis.enabled()} + int{daemon.net_fdm.enabled()};
  if (count > 1) {
    diagnostics.add(root.at,
                    "more than one of 'cigi.listen', 'dis.listen' and 'net_fdm.listen' is set: a "
                    "run has one host");
  }
}

void check_combinations(const Node& root, const DaemonConfig& daemon, Diagnostics& diagnostics) {
  Diagnostics reported_before;  // section() has reported wrong kinds
  const Node& pacing = section(root, "pacing", reported_before);
  if ((daemon.pacing.mode != PacingMode::host_step || daemon.motion.enabled()) &&
      daemon.pacing.display_delay_ns > daemon.pacing.horizon_ns) {
    diagnostics.add(key_location(pacing, "display_delay_ms"),
                    fmt::format("'display_delay_ms' ({}) is beyond 'horizon_ms' ({}): every frame "
                                "would be stale",
                                static_cast<double>(daemon.pacing.display_delay_ns) / 1e6,
                                static_cast<double>(daemon.pacing.horizon_ns) / 1e6));
  }
  check_endpoint(section(root, "control", reported_before), "tcp", daemon.control.tcp, false,
                 diagnostics);
  check_endpoint(section(root, "host", reported_before), "udp", daemon.host.udp, true, diagnostics);
  if (!daemon.stream.shm.empty() && !protocol::is_shm_name(daemon.stream.shm)) {
    diagnostics.add(key_location(section(root, "stream", reported_before), "shm"),
                    fmt::format("'shm' is '{}', must be 1 to 64 letters, digits, '_', '-' or '.', "
                                "beginning with a letter or digit",
                                daemon.stream.shm));
  }
  check_endpoint(section(root, "trigger", reported_before), "udp", daemon.trigger.udp, false,
                 diagnostics);
  if (const auto cpus = parse_agent_cpus(daemon.realtime.cpus); !cpus) {
    diagnostics.add(key_location(section(root, "realtime", reported_before), "cpus"),
                    cpus.error().text);
  }
  check_endpoint(section(root, "metrics", reported_before), "listen", daemon.metrics.listen, true,
                 diagnostics);
  check_endpoint(section(root, "console", reported_before), "listen", daemon.console.listen, true,
                 diagnostics);
  if (daemon.motion.enabled()) {
    const Node& motion = section(root, "motion", reported_before);
    check_motion(motion, daemon.motion, diagnostics);
    // Each measurement and each prediction has to last until the next command.
    const auto least_ns = static_cast<std::int64_t>(2e9 / daemon.motion.rate_hz);
    const auto too_short = [&](const Node& table, const char* key, std::int64_t value_ns) {
      if (value_ns >= least_ns) return;
      diagnostics.add(
          key_location(table, key),
          fmt::format("'{}' ({}) is less than two periods of 'motion.rate_hz' ({})", key,
                      static_cast<double>(value_ns) / 1e6, static_cast<double>(least_ns) / 1e6));
    };
    too_short(motion, "feedback_timeout_ms", daemon.motion.feedback_timeout_ns);
    too_short(motion, "host_timeout_ms", daemon.motion.host_timeout_ns);
    too_short(pacing, "horizon_ms", daemon.pacing.horizon_ns);
  }
  check_gateways(root, daemon, diagnostics);
  check_access(root, daemon, diagnostics);
  if (daemon.source.kind == SourceKind::canned && !daemon.source.canned_dir.empty()) {
    std::error_code code;
    if (!std::filesystem::is_directory(daemon.source.canned_dir, code)) {
      diagnostics.add(
          key_location(section(root, "source", reported_before), "canned_dir"),
          fmt::format("'canned_dir': {}: no such folder", daemon.source.canned_dir.string()));
    }
  }
}

}  // namespace

bool is_endpoint(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0) {
    return false;
  }
  const std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  const bool bracketed = host.front() == '[' && host.back() == ']' && host.size() > 2;
  if (!bracketed && host.find_first_of(":[] ") != std::string_view::npos) {
    return false;
  }
  unsigned value = 0;
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), value);
  return parsed.ec == std::errc() && parsed.ptr == port.data() + port.size() && value <= 65535;
}

std::optional<std::array<std::uint16_t, 3>> parse_dis_id(std::string_view text) {
  std::array<std::uint16_t, 3> out{};
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (i > 0 && (at == end || *at++ != ':')) return std::nullopt;
    const auto parsed = std::from_chars(at, end, out[i]);
    if (parsed.ec != std::errc()) return std::nullopt;
    at = parsed.ptr;
  }
  if (at != end) return std::nullopt;
  return out;
}

Result<DaemonConfig> load_daemon(const std::filesystem::path& file,
                                 std::span<const std::string> overrides,
                                 const LoadOptions& options) {
  Result<Node> parsed = parse_toml_file(file);
  if (!parsed) {
    return tl::unexpected<physics::Error>(parsed.error());
  }
  Node& root = *parsed;
  if (const FileKind kind = kind_of(root); kind == FileKind::scenario) {
    return physics::make_error(physics::ErrorCode::config, text_of_scenario(file));
  } else if (kind == FileKind::materials) {
    return physics::make_error(
        physics::ErrorCode::config,
        fmt::format("{}: this is a library of materials, not a configuration of the daemon; a "
                    "scenario names it in the key 'materials'",
                    file.string()));
  }
  Diagnostics diagnostics;
  apply_environment(root, daemon_sections(), options, diagnostics);
  for (const std::string& text : overrides) {
    apply_override(root, text, diagnostics);
  }
  std::vector<std::string_view> names;
  for (const SectionDoc& doc : daemon_sections()) {
    if (!doc.path.empty()) {
      names.push_back(doc.path);
    }
  }
  DaemonConfig daemon;
  daemon.file = file;
  DaemonHead head;
  read_table(root, daemon_head_keys(), head, diagnostics, names, place_of_scenario_key);
  read_table(section(root, "source", diagnostics), source_keys(), daemon.source, diagnostics);
  read_table(section(root, "pacing", diagnostics), pacing_keys(), daemon.pacing, diagnostics);
  read_table(section(root, "trigger", diagnostics), trigger_keys(), daemon.trigger, diagnostics);
  read_table(section(root, "motion", diagnostics), motion_keys(), daemon.motion, diagnostics);
  read_table(section(root, "cigi", diagnostics), cigi_keys(), daemon.cigi, diagnostics);
  read_table(section(root, "dis", diagnostics), dis_keys(), daemon.dis, diagnostics);
  read_table(section(root, "net_fdm", diagnostics), net_fdm_keys(), daemon.net_fdm, diagnostics);
  read_table(section(root, "clock", diagnostics), clock_keys(), daemon.clock, diagnostics);
  read_table(section(root, "realtime", diagnostics), realtime_keys(), daemon.realtime, diagnostics);
  read_table(section(root, "host", diagnostics), host_keys(), daemon.host, diagnostics);
  read_table(section(root, "control", diagnostics), control_keys(), daemon.control, diagnostics);
  read_table(section(root, "stream", diagnostics), stream_keys(), daemon.stream, diagnostics);
  read_table(section(root, "metrics", diagnostics), metrics_keys(), daemon.metrics, diagnostics);
  read_table(section(root, "console", diagnostics), console_keys(), daemon.console, diagnostics);
  read_table(section(root, "access", diagnostics), access_keys(), daemon.access, diagnostics);
  read_table(section(root, "tls", diagnostics), tls_keys(), daemon.tls, diagnostics);
  read_table(section(root, "journal", diagnostics), journal_keys(), daemon.journal, diagnostics);
  read_table(section(root, "device", diagnostics), device_keys(), daemon.device, diagnostics);
  read_table(section(root, "log", diagnostics), log_keys(), daemon.log, diagnostics);
  resolve_daemon_scenario(root, head.scenario, daemon, diagnostics);
  check_combinations(root, daemon, diagnostics);
  if (!diagnostics.empty()) {
    return tl::unexpected<physics::Error>(diagnostics.error());
  }
  return daemon;
}

}  // namespace emit::config
