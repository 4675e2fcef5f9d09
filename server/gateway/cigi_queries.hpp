// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>

#include "emit/protocol/cigi/host_requests.hpp"
#include "emit/protocol/cigi/writer.hpp"
#include "gateway/cigi_entities.hpp"
#include "gateway/georeference.hpp"
#include "gateway/scene_query.hpp"

namespace emit::server {

/// Questions of a CIGI host for the ground, lines of sight and positions, and their answers.
///
/// A question is answered in the next message to the host, and then once in as many messages as it
/// asks for until another question has its number. Every question gets an answer: where there is
/// none, it says that it is not valid. Answers hold for entities where they were at the latest
/// message. The number of a material in an answer is its place in SceneQuery::materials(), from 1.
///
/// Thread: one owner. Real time: RT-safe after construction.
class CigiQueries {
 public:
  /// Questions that may wait or repeat at a time.
  static constexpr std::size_t kMaxQuestions = 256;

  /// `scene` may be null: no answer about it is valid then. The arguments outlive the object.
  CigiQueries(const Georeference& earth, const CigiEntities& entities, const SceneQuery* scene)
      : earth_(earth), entities_(entities), scene_(scene) {}

  /// Forgets every question.
  void clear() noexcept { count_ = 0; }
  /// Takes a question of the host frame `host_frame`. Returns false where there is no room.
  template <class Request>
  bool take(const Request& request, std::uint32_t host_frame) noexcept {
    return add({request, static_cast<std::uint8_t>(host_frame & 0xfU), 0});
  }
  /// Appends the answers that are due now. Those without room in the message come with the next
  /// one.
  /// @return the number of answers, and of those that no packet can hold
  struct Answered {
    std::size_t answers = 0;
    std::size_t dropped = 0;
  };
  Answered answer(protocol::cigi::Writer& writer) noexcept;

 private:
  using Request = std::variant<protocol::cigi::HatHotRequest, protocol::cigi::LosSegmentRequest,
                               protocol::cigi::LosVectorRequest, protocol::cigi::PositionRequest>;
  struct Question {
    Request request;
    std::uint8_t lsn = 0;          ///< low four bits of the host frame that asked
    std::uint8_t wait_frames = 0;  ///< messages until it is due
  };
  /// A line of sight with what it met.
  struct Sight {
    std::uint16_t request_id = 0;
    bool extended = false;
    bool relative = false;  ///< the answer is in the frame of the entity that was hit
    bool visible = false;
    std::optional<SceneQuery::Hit> hit;
  };

  bool add(const Question& question) noexcept;
  /// @param blind  gives the answer that there is none
  [[nodiscard]] protocol::cigi::Packet answer_to(const protocol::cigi::HatHotRequest& request,
                                                 std::uint8_t lsn, bool blind) const noexcept;
  [[nodiscard]] protocol::cigi::Packet answer_to(const protocol::cigi::LosSegmentRequest& request,
                                                 std::uint8_t lsn, bool blind) const noexcept;
  [[nodiscard]] protocol::cigi::Packet answer_to(const protocol::cigi::LosVectorRequest& request,
                                                 std::uint8_t lsn, bool blind) const noexcept;
  [[nodiscard]] protocol::cigi::Packet answer_to(const protocol::cigi::PositionRequest& request,
                                                 std::uint8_t lsn, bool blind) const noexcept;
  [[nodiscard]] protocol::cigi::Packet packet_of(const Sight& sight,
                                                 std::uint8_t lsn) const noexcept;
  /// Returns a point of a request in the world; none: its entity has no pose.
  [[nodiscard]] std::optional<glm::dvec3> point_of(const protocol::cigi::Place& place,
                                                   bool relative,
                                                   std::uint16_t entity_id) const noexcept;
  /// Writes azimuth and elevation of a unit normal, by north, east and down where the point is.
  void write_normal(const SceneQuery::Hit& hit, float& azimuth_deg,
                    float& elevation_deg) const noexcept;

  const Georeference& earth_;
  const CigiEntities& entities_;
  const SceneQuery* scene_;
  std::array<Question, kMaxQuestions> questions_;
  std::size_t count_ = 0;
};

}  // namespace emit::server
