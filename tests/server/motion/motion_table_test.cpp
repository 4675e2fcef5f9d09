// SPDX-License-Identifier: Apache-2.0
#include "motion/motion_table.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/ext/quaternion_double.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <random>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"

namespace emit::server {
namespace {

using physics::kDegree;

constexpr double kFocalPx = 2000.0;
constexpr glm::dvec2 kSizePx(640.0, 512.0);

struct Table {
  std::string name;
  std::array<GimbalAxis, 3> order;
  std::optional<TwoAxisGimbal> target;
};

std::vector<Table> all_tables() {
  using enum GimbalAxis;
  std::vector<Table> out;
  for (const auto& order : std::vector<std::array<GimbalAxis, 3>>{{roll, pitch, yaw},
                                                                  {roll, yaw, pitch},
                                                                  {pitch, roll, yaw},
                                                                  {pitch, yaw, roll},
                                                                  {yaw, roll, pitch},
                                                                  {yaw, pitch, roll}}) {
    const std::string name = testing::PrintToString(std::array{
        static_cast<int>(order[0]), static_cast<int>(order[1]), static_cast<int>(order[2])});
    out.push_back({name + " azimuth outer", order, TwoAxisGimbal(TwoAxisGimbal::Outer::azimuth)});
    out.push_back(
        {name + " elevation outer", order, TwoAxisGimbal(TwoAxisGimbal::Outer::elevation)});
    out.push_back({name + " three axes", order, std::nullopt});
  }
  return out;
}

glm::dmat3 small_turn(double x_deg, double y_deg, double z_deg) {
  const glm::dvec3 turn = kDegree * glm::dvec3(x_deg, y_deg, z_deg);
  return glm::mat3_cast(glm::angleAxis(glm::length(turn), glm::normalize(turn)));
}

/// Misaligned as a real table is, with the laboratory turned to the east.
TableAlignment alignment() {
  TableAlignment out;
  out.lab_from_world =
      glm::transpose(glm::mat3_cast(physics::world_from_body_heading_pitch_roll(1.3, 0.0, 0.0)));
  out.lab_from_unit_base = small_turn(0.3, -0.2, 0.5);
  out.unit_payload_from_seeker = small_turn(-0.4, 0.1, 0.2);
  out.lab_from_target_base = small_turn(0.2, 0.3, -0.6);
  out.target_payload_from_projector = small_turn(1.5, 0.05, -0.08);
  return out;
}

SeekerState state_at(double heading_deg, double pitch_deg, double roll_deg) {
  SeekerState out;
  out.world_from_seeker = glm::mat3_cast(physics::world_from_body_heading_pitch_roll(
      kDegree * heading_deg, kDegree * pitch_deg, kDegree * roll_deg));
  out.target_m = out.world_from_seeker * glm::dvec3(800.0, 30.0, -40.0);
  return out;
}

MotionTable table_of(const Table& table) {
  return {*ThreeAxisGimbal::create(table.order), table.target, alignment()};
}

/// Returns the pixel of a direction, from the centre of an image of a camera with a body frame.
glm::dvec2 pixel_of(const glm::dvec3& direction_body) {
  return kFocalPx * glm::dvec2(direction_body.y, direction_body.z) / direction_body.x;
}

TEST(MotionTable, perfect_axes_turn_the_seeker_and_point_at_the_target) {
  for (const Table& each : all_tables()) {
    SCOPED_TRACE(each.name);
    const MotionTable table = table_of(each);
    const SeekerState state = state_at(70.0, 12.0, 35.0);
    const TableMotion motion = table.command(state, {});
    const TableAlignment parts = alignment();
    const glm::dmat3 lab_from_seeker =
        parts.lab_from_unit_base *
        ThreeAxisGimbal::create(each.order)->base_from_payload(angles_of(motion).unit_rad) *
        parts.unit_payload_from_seeker;
    const glm::dmat3 wanted = parts.lab_from_world * state.world_from_seeker;
    for (glm::length_t axis = 0; axis < 3; ++axis) {
      EXPECT_LT(glm::length(lab_from_seeker[axis] - wanted[axis]), 1e-12);
    }
    if (!each.target) continue;
    // The innermost target ring points at the target. The mount of the projector tilts its image by
    // a tenth of a degree, which is taken out by rendering.
    const glm::dvec3 sight = parts.lab_from_target_base *
                             each.target->base_from_payload(motion.target.azimuth.angle_rad,
                                                            motion.target.elevation.angle_rad)[0];
    EXPECT_LT(glm::length(sight - parts.lab_from_world * glm::normalize(state.target_m)), 1e-12);
  }
}

/// Follows light from a thing in the world: the projected image shows it in some pixel, the
/// projector throws that pixel's ray into the laboratory, and the seeker on its rings sees it. It
/// must come from where the flight simulation says that the thing is, whatever the axes do.
TEST(MotionTable, a_seeker_on_lagging_axes_sees_each_thing_where_it_is) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> lag_rad(-0.02, 0.02);
  std::uniform_real_distribution<double> place_px(-0.5, 0.5);
  for (const Table& each : all_tables()) {
    SCOPED_TRACE(each.name);
    const MotionTable table = table_of(each);
    const TableAlignment parts = alignment();
    const SeekerState state = state_at(-40.0, 25.0, 110.0);
    TableAngles measured = angles_of(table.command(state, {}));
    measured.unit_rad += glm::dvec3(lag_rad(random), lag_rad(random), lag_rad(random));
    if (each.target) measured.target_rad += glm::dvec2(lag_rad(random), lag_rad(random));
    const glm::dmat3 world_from_projector =
        table.world_from_projector(state.world_from_seeker, measured);
    // The hardware really is where its parts put it.
    const glm::dmat3 lab_from_seeker =
        parts.lab_from_unit_base *
        ThreeAxisGimbal::create(each.order)->base_from_payload(measured.unit_rad) *
        parts.unit_payload_from_seeker;
    glm::dmat3 lab_from_projector = parts.lab_from_target_base;
    if (each.target) {
      lab_from_projector = lab_from_projector * each.target->base_from_payload(
                                                    measured.target_rad.x, measured.target_rad.y);
    }
    lab_from_projector = lab_from_projector * parts.target_payload_from_projector;
    for (int i = 0; i < 200; ++i) {
      // A thing somewhere in the field of view of the projector.
      const glm::dvec2 shown_px = kSizePx * glm::dvec2(place_px(random), place_px(random));
      const glm::dvec3 in_image(1.0, shown_px.x / kFocalPx, shown_px.y / kFocalPx);
      const glm::dvec3 thing_world = world_from_projector * in_image;
      const glm::dvec3 seen = glm::transpose(lab_from_seeker) * lab_from_projector * in_image;
      const glm::dvec3 true_seen = glm::transpose(state.world_from_seeker) * thing_world;
      EXPECT_LT(glm::length(glm::normalize(seen) - glm::normalize(true_seen)), 1e-12);
    }
  }
}

TEST(MotionTable, the_table_is_not_turned_twice) {
  // The classic mistake renders a projected image along the seeker's own attitude.
  for (const Table& each : all_tables()) {
    if (!each.target) continue;
    SCOPED_TRACE(each.name);
    const MotionTable table = table_of(each);
    const SeekerState state = state_at(0.0, 0.0, 50.0);
    const TableAngles angles = angles_of(table.command(state, {}));
    const glm::dmat3 world_from_projector =
        table.world_from_projector(state.world_from_seeker, angles);
    // A roll of the seeker turns the table, not the projected image.
    const glm::dvec3 right_in_lab = alignment().lab_from_world * world_from_projector[1];
    EXPECT_LT(std::abs(right_in_lab.z), 0.1);
    EXPECT_GT(std::abs((alignment().lab_from_world * state.world_from_seeker[1]).z), 0.7);
  }
}

TEST(ImageShift, moves_the_image_to_where_the_axes_are) {
  const glm::dmat3 rendered = state_at(30.0, 5.0, 0.0).world_from_seeker;
  // The projector has moved on by 3 pixels to the right and 2 up.
  const glm::dmat3 shown =
      rendered * glm::mat3_cast(glm::angleAxis(3.0 / kFocalPx, glm::dvec3(0.0, 0.0, 1.0))) *
      glm::mat3_cast(glm::angleAxis(2.0 / kFocalPx, glm::dvec3(0.0, 1.0, 0.0)));
  const ImageShift shift = image_shift(rendered, shown, kSizePx, kFocalPx);
  EXPECT_NEAR(shift.shift_px.x, -3.0, 1e-3);
  EXPECT_NEAR(shift.shift_px.y, 2.0, 1e-3);
  EXPECT_LT(shift.residual_px, 0.2);
  // A thing in the rendered image, moved by the shift, stands where the shown image has it.
  for (const glm::dvec2& at_px : {glm::dvec2(0.0), glm::dvec2(300.0, -250.0)}) {
    const glm::dvec3 thing = rendered * glm::dvec3(1.0, at_px / kFocalPx);
    const glm::dvec2 truth_px = pixel_of(glm::transpose(shown) * thing);
    EXPECT_LE(glm::length(at_px + shift.shift_px - truth_px), shift.residual_px + 1e-9);
  }
}

TEST(ImageShift, says_what_a_shift_cannot_mend) {
  const glm::dmat3 rendered = state_at(0.0, 0.0, 0.0).world_from_seeker;
  const glm::dmat3 rolled =
      rendered * glm::mat3_cast(glm::angleAxis(1.0 * kDegree, glm::dvec3(1.0, 0.0, 0.0)));
  const ImageShift shift = image_shift(rendered, rolled, kSizePx, kFocalPx);
  EXPECT_LT(glm::length(shift.shift_px), 1e-9);
  EXPECT_NEAR(shift.residual_px, kDegree * 0.5 * glm::length(kSizePx), 0.01);
}

}  // namespace
}  // namespace emit::server
