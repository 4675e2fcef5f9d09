// SPDX-License-Identifier: Apache-2.0
// Structs that C++ and GLSL share have the same offsets on both sides.
#include <gtest/gtest.h>

#include <cstddef>

#include "gl/egl_context.hpp"
#include "gl/program.hpp"
#include "shared/frame_params.glsl.h"
#include "shared/gas_params.glsl.h"
#include "shared/shade_params.glsl.h"
#include "shared/target_params.glsl.h"

namespace emit::renderer {
namespace {

#define EXPECT_OFFSET(program, instance, type, member)      \
  EXPECT_EQ((program).uniform_offset(instance "." #member), \
            static_cast<GLint>(offsetof(type, member)))

TEST(SharedStructs, have_the_offsets_that_the_driver_uses) {
  auto context = gl::EglContext::create(-1, false);
  ASSERT_TRUE(context) << context.error().text;
  const gl::Define taps[] = {{"EMIT_BLOCKER_TAPS", "8u"}, {"EMIT_FILTER_TAPS", "32u"}};
  auto thermal = gl::Program::compute("passes/thermal.comp", taps);
  ASSERT_TRUE(thermal) << thermal.error().text;
  const gl::Define modes[] = {taps[0], taps[1], {"EMIT_FOSTER_GROUPS", "2"}};
  auto foster = gl::Program::compute("passes/thermal_foster.comp", modes);
  ASSERT_TRUE(foster) << foster.error().text;
  // Use both kinds of air, so that no member of BandParams is optimised away.
  const gl::Define content[] = {{"EMIT_BANDS", "4u"},     {"EMIT_AIR_TERMS", "5u"},
                                {"EMIT_AIR_TABLE", "2u"}, {"EMIT_AIR_MODEL", "8u"},
                                {"EMIT_TERMS", "4"},      {"EMIT_OUTPUTS", "0u"},
                                {"EMIT_ROWS", "1u"},      {"EMIT_FOG", "1"}};
  auto radiance = gl::Program::compute("passes/radiance.comp", content);
  ASSERT_TRUE(radiance) << radiance.error().text;

  const gl::Define cached[] = {{"EMIT_CACHED", "1"},
                               {"EMIT_BANDS", "4u"},
                               {"EMIT_BANDS_VEC", "vec4"},
                               {"EMIT_BANDS_OF(v)", "(v)"}};
  auto geometry = gl::Program::graphics("passes/geometry.vert", "passes/geometry.frag", cached);
  ASSERT_TRUE(geometry) << geometry.error().text;

  const gl::Define rows[] = {{"EMIT_ROWS", "1u"}};
  auto shade = gl::Program::compute("passes/shade.comp", rows);
  ASSERT_TRUE(shade) << shade.error().text;

  const gl::Define planes[] = {{"EMIT_BANDS", "1u"}, {"EMIT_PLANES", "2u"}, {"EMIT_COVERAGE", "0"}};
  auto targets = gl::Program::compute("passes/target_pixels.comp", planes);
  ASSERT_TRUE(targets) << targets.error().text;
  auto target_rows = gl::Program::compute("passes/target_rows.comp", planes);
  ASSERT_TRUE(target_rows) << target_rows.error().text;

  auto gas = gl::Program::compute("passes/gas.comp", std::vector<gl::Define>{{"EMIT_BANDS", "4"}});
  ASSERT_TRUE(gas) << gas.error().text;
  EXPECT_OFFSET(*gas, "image", gpu::GasImage, px_per_tan);
  EXPECT_OFFSET(*gas, "image", gpu::GasImage, window_px);
  EXPECT_OFFSET(*gas, "image", gpu::GasImage, near_m);
  EXPECT_OFFSET(*gas, "image", gpu::GasImage, term_frac[0]);
  EXPECT_OFFSET(*targets, "targets", gpu::TargetsParams, targets[1].place_px);
  EXPECT_OFFSET(*targets, "targets", gpu::TargetsParams, targets[1].origin);
  EXPECT_OFFSET(*targets, "targets", gpu::TargetsParams, targets[1].per_px);
  EXPECT_OFFSET(*target_rows, "targets", gpu::TargetsParams, targets[1].object);
  EXPECT_OFFSET(*targets, "targets", gpu::TargetsParams, count);
  EXPECT_OFFSET(*targets, "targets", gpu::TargetsParams, samples_width);
  EXPECT_OFFSET(*shade, "shade", gpu::ShadeParams, slope);
  EXPECT_OFFSET(*shade, "shade", gpu::ShadeParams, taps[0]);
  EXPECT_OFFSET(*geometry, "draw", gpu::DrawParams, clip_from_mesh);
  EXPECT_OFFSET(*geometry, "draw", gpu::DrawParams, normal_from_mesh[0]);
  EXPECT_OFFSET(*geometry, "draw", gpu::DrawParams, material);
  EXPECT_OFFSET(*geometry, "draw", gpu::DrawParams, moves);
  EXPECT_OFFSET(*geometry, "draw", gpu::DrawParams, moved_frac);
  EXPECT_OFFSET(*geometry, "frame", gpu::FrameParams, node_frac);
  EXPECT_OFFSET(*geometry, "frame", gpu::FrameParams, reference_k);
  EXPECT_OFFSET(*geometry, "frame", gpu::FrameParams, to_sun);
  EXPECT_OFFSET(*geometry, "frame", gpu::FrameParams, sun_up);
  EXPECT_OFFSET(*thermal, "frame_uniform", gpu::FrameParams, relworld_from_sensor);
  EXPECT_OFFSET(*thermal, "frame_uniform", gpu::FrameParams, ray_per_px);
  EXPECT_OFFSET(*thermal, "frame_uniform", gpu::FrameParams, ray_at_corner);
  EXPECT_OFFSET(*thermal, "frame_uniform", gpu::FrameParams, rendered_window_px);
  EXPECT_OFFSET(*thermal, "frame_uniform", gpu::FrameParams, reference_k);
  EXPECT_OFFSET(*foster, "frame_uniform", gpu::FrameParams, step_tolerance_k);
  EXPECT_OFFSET(*foster, "frame_uniform", gpu::FrameParams, spin_up_nodes);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, rendered_px);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, rendered_plane_px);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, band_lut_nodes);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, first_emissivity);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, to_sun);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, fog_above_m);
  EXPECT_OFFSET(*radiance, "frame_uniform", gpu::FrameParams, fog_k);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, cascades[0].light_row0);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, cascades[0].drift_frac);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, cascades[3].scale_per_m);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, cascades[2].end_boresight_m);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, to_sun_start);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, sun_end_w_m2);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, environment_end_w_m2);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, casters_top_m);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, casters_sun_sine);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, cascade_count);
  EXPECT_OFFSET(*thermal, "step_params", gpu::StepParams, flags);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, film_start.upwind);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, film_end.stable_quarter);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, film_end.model_frac);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, moist_start.vapour_pa);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, moist_end.heat_j_m3_k);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, air_end_offset_k);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, reflected_end_w_m2);
  EXPECT_OFFSET(*foster, "step_params", gpu::StepParams, relaxation_offset);
  EXPECT_EQ(thermal->uniform_offset("taps.blocker[0]"), 0);
  EXPECT_EQ(thermal->uniform_offset("taps.filter_[0]"),
            static_cast<GLint>(offsetof(gpu::TapParams, filter_)));
  EXPECT_EQ(
      radiance->uniform_offset("band_uniforms[1].sun_irradiance_w_m2"),
      static_cast<GLint>(sizeof(gpu::BandParams) + offsetof(gpu::BandParams, sun_irradiance_w_m2)));
  EXPECT_EQ(
      radiance->uniform_offset("band_uniforms[3].lut_last_node"),
      static_cast<GLint>(3 * sizeof(gpu::BandParams) + offsetof(gpu::BandParams, lut_last_node)));
  EXPECT_EQ(radiance->uniform_offset("band_uniforms[2].air_table_elevations"),
            static_cast<GLint>(2 * sizeof(gpu::BandParams) +
                               offsetof(gpu::BandParams, air_table_elevations)));
  EXPECT_EQ(
      geometry->uniform_offset("bands[1].sky_by_tilt_w_m2_sr[0]"),
      static_cast<GLint>(sizeof(gpu::BandParams) + offsetof(gpu::BandParams, sky_by_tilt_w_m2_sr)));
  EXPECT_EQ(
      radiance->uniform_offset("band_uniforms[2].air_view_first"),
      static_cast<GLint>(2 * sizeof(gpu::BandParams) + offsetof(gpu::BandParams, air_view_first)));
  // Check tables that shaders fetch as texels of four floats.
  EXPECT_EQ(sizeof(gpu::MaterialParams), 6U * 16U);
  EXPECT_EQ(offsetof(gpu::MaterialParams, initial_offset_k), 16U);
  EXPECT_EQ(offsetof(gpu::MaterialParams, base_offset_k), 28U);
  EXPECT_EQ(offsetof(gpu::MaterialParams, resistance_m2k_w), 32U);
  EXPECT_EQ(sizeof(gpu::RelaxationParams), 2U * 16U);
}

}  // namespace
}  // namespace emit::renderer
