// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "emit/config/daemon_config.hpp"
#include "emit/protocol/cigi/reader.hpp"
#include "emit/protocol/cigi/writer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gateway/cigi_clock.hpp"
#include "gateway/cigi_entities.hpp"
#include "gateway/cigi_heat.hpp"
#include "gateway/cigi_picture.hpp"
#include "gateway/cigi_queries.hpp"
#include "gateway/cigi_weather.hpp"
#include "gateway/georeference.hpp"
#include "gateway/host_gateway.hpp"
#include "gateway/scene_query.hpp"
#include "rt/counters.hpp"
#include "rt/picture_board.hpp"
#include "telemetry/event_log.hpp"

namespace emit::server {

/// emitd as the image generator of a CIGI host (docs/cigi.md): mode and database
/// handshakes, synchronous and asynchronous operation, entities, weather, time of day, and answers.
///
/// Synchronous operation (pacing mode host-step): a Start Of Frame goes out at a fixed rate, but
/// not before the image of the latest host frame; the host answers each with one message, which is
/// one image. Asynchronous operation: the host sends messages with time stamps when it likes, and
/// images show where things are by then.
class CigiHost final : public HostGateway {
 public:
  struct Options {
    config::CigiConfig cigi;
    bool synchronous = true;
    double rate_hz = 60.0;           ///< of Start Of Frame
    std::int64_t first_time_ns = 0;  ///< simulation time of the first message of a run
    const scene::ScenarioDesc* scenario = nullptr;  ///< null: there is none
    bool is_view_fixed = false;                     ///< hosts cannot set the field of view
    PictureBoard* picture = nullptr;                ///< takes Sensor Control; null: nobody looks
  };
  /// The scenario, the picture, the counters and the events outlive the object.
  /// @param scene  what questions are about; null: there are no answers
  CigiHost(const Options& options, std::unique_ptr<SceneQuery> scene, Counters& counters,
           EventLog& events);

  void take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept override;
  [[nodiscard]] bool next(protocol::HostFrameData& frame, std::int64_t now_ns) noexcept override;
  void report(const GatewayReport& report) noexcept override;
  [[nodiscard]] std::span<const std::byte> message(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override;

 private:
  // Messages of the host.
  /// Takes IG Control. Returns true when the rest of the message counts.
  bool take_control(const protocol::cigi::IgControl& control, std::int64_t received_ns) noexcept;
  /// Returns true when the message belongs to the run under way or begins one.
  bool take_time(const protocol::cigi::IgControl& control, std::int64_t received_ns) noexcept;
  void take_database(std::int8_t wanted) noexcept;
  void take_packet(const protocol::cigi::Packet& packet) noexcept;
  void take_view(const protocol::cigi::ViewDefinition& packet) noexcept;
  void take_sensor(const protocol::cigi::SensorControl& packet) noexcept;
  void take_sky(const protocol::cigi::CelestialSphereControl& packet) noexcept;
  void begin_run(std::int64_t received_ns, std::int64_t first_time_ns) noexcept;
  void forget() noexcept;
  void tell_unknown_entities() noexcept;
  /// Counts a packet without effect, and says so to the host and in the log once a run.
  template <class Packet>
  void no_effect(const Packet& /*packet*/, std::string_view why) noexcept {
    no_effect(Packet::kWire.of(version_).id, why);
  }
  void no_effect(std::uint16_t packet_id, std::string_view why) noexcept;
  /// Returns the id of the packet that says where an entity is.
  [[nodiscard]] std::uint16_t place_id() const noexcept {
    return version_ == protocol::cigi::Version::v3_3
               ? protocol::cigi::EntityControl::kWire.v3_3.id
               : protocol::cigi::EntityPosition::kWire.v4_0.id;
  }
  void refuse(const protocol::cigi::Fault& fault) noexcept;
  /// Keeps a text for the host. The newest is left out when there are too many.
  void tell(std::string_view text) noexcept;

  // Frames.
  /// Leaves out what emitd does not take. Returns false when that is the sensor.
  bool check(protocol::HostFrameData& frame) noexcept;
  [[nodiscard]] bool waits(std::int64_t now_ns) const noexcept;

  static constexpr std::size_t kMessageBytes = 8192;  ///< of a message to the host
  static constexpr std::size_t kMaxTexts = 8;
  static constexpr std::size_t kMaxTold = 64;

  Options options_;
  Counters& counters_;
  EventLog& events_;
  Georeference earth_;
  std::unique_ptr<SceneQuery> scene_;
  std::int64_t period_ns_;
  CigiClock clock_;
  CigiEntities entities_;
  CigiQueries queries_;
  CigiWeather weather_;
  CigiPicture picture_;
  CigiHeat heat_;

  protocol::cigi::IgMode mode_ = protocol::cigi::IgMode::standby;
  std::int8_t database_ = 0;      ///< as Start Of Frame has it
  bool database_told_ = false;    ///< the host has not answered that it knows of the loading yet
  std::uint32_t host_frame_ = 0;  ///< of the latest message of the host
  std::uint64_t run_id_ = 0;
  std::int64_t received_ns_ = 0;  ///< arrival of the latest message, wall
  bool frame_pending_ = false;
  bool awaits_ = false;  ///< synchronous: the image of a host frame is not there yet
  std::uint64_t awaited_number_ = 0;
  std::int64_t awaited_since_ns_ = 0;

  protocol::cigi::Version version_ = protocol::cigi::Version::v3_3;
  protocol::cigi::ByteOrder order_ = protocol::cigi::ByteOrder::little;
  std::uint32_t ig_frame_ = 0;
  std::int64_t due_ns_ = 0;  ///< of the next Start Of Frame, wall; 0: now
  std::array<std::byte, kMessageBytes> memory_;
  std::array<protocol::cigi::ImageGeneratorMessage, kMaxTexts> texts_;
  std::size_t text_count_ = 0;
  /// Packet ids and reasons that no_effect() has spoken of in this run.
  std::array<std::pair<std::uint16_t, const char*>, kMaxTold> told_{};
  std::size_t told_count_ = 0;
  std::optional<protocol::cigi::CelestialSphereControl> sky_;  ///< the latest of this run
  std::optional<double> fov_h_rad_;  ///< as View Definition has set it in this run
  bool told_no_seeker_ = false;
  bool told_timeless_ = false;
};

}  // namespace emit::server
