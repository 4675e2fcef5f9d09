// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <limits>

#include "emit/physics/constants.hpp"
#include "keys.hpp"

/// Keys of a scenario's channels.
namespace emit::config {

using scene::ChannelDesc;
using scene::ChannelKind;
using scene::PictureMirror;

namespace {

void read_window(ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
  std::array<std::int64_t, 4> values{};
  if (node.kind != Node::Kind::array || node.items.size() != values.size()) {
    diagnostics.add(node.at, "'window_px' must be an array of 4 integers: x, y, width, height");
    return;
  }
  const std::size_t faults = diagnostics.size();
  for (std::size_t i = 0; i < values.size(); ++i) {
    read_integer(node.items[i], "window_px", i < 2 ? 0 : 1, limits::kSensorPx.hi, values[i],
                 diagnostics);
  }
  if (diagnostics.size() == faults) {
    out.window_px = {static_cast<std::uint32_t>(values[0]), static_cast<std::uint32_t>(values[1]),
                     static_cast<std::uint32_t>(values[2]), static_cast<std::uint32_t>(values[3])};
  }
}

/// Key of coefficients, written only where one is not 0.
template <std::size_t count, class Field>
Key<ChannelDesc> coefficients(std::string name, std::string range, Field field,
                              std::string meaning) {
  return custom<ChannelDesc>(
      {name, fmt::format("array of {} floats", count), "", std::move(range), std::move(meaning),
       false},
      [name, field](ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
        read_vector(node, name, count, field(out).data(), diagnostics);
      },
      [field](const ChannelDesc& in) -> std::optional<std::string> {
        if (field(in) == std::array<double, count>{}) {
          return std::nullopt;
        }
        return toml_vector(field(in).data(), count);
      });
}

void read_rotation(ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
  std::int64_t angle_deg = 0;
  const std::size_t faults = diagnostics.size();
  read_integer(node, "rotate_deg", 0, 270, angle_deg, diagnostics);
  if (diagnostics.size() != faults) {
    return;
  }
  if (angle_deg % 90 != 0) {
    diagnostics.add(node.at,
                    fmt::format("'rotate_deg' is {}, must be one of: 0, 90, 180, 270", angle_deg));
    return;
  }
  out.output.rotate_deg = static_cast<std::uint32_t>(angle_deg);
}

/// Adds the keys of what is done to a picture.
void add_output_keys(KeyTable<ChannelDesc>& keys) {
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.output.mirror != PictureMirror::none; },
      choice<ChannelDesc>("mirror",
                          std::vector<std::pair<std::string, PictureMirror>>{
                              {"none", PictureMirror::none},
                              {"horizontal", PictureMirror::horizontal},
                              {"vertical", PictureMirror::vertical},
                              {"both", PictureMirror::both}},
                          EMIT_FIELD(output.mirror),
                          "Reverses the columns (horizontal), the rows (vertical) or both of the "
                          "window's picture.")));
  keys.push_back(custom<ChannelDesc>(
      {"rotate_deg", "integer", "deg", "0, 90, 180, 270",
       "Clockwise rotation of the picture, after the mirror. 90 and 270 exchange width and height.",
       false},
      read_rotation, [](const ChannelDesc& in) -> std::optional<std::string> {
        if (in.output.rotate_deg == 0) {
          return std::nullopt;
        }
        return std::to_string(in.output.rotate_deg);
      }));
  keys.push_back(path<ChannelDesc>("distortion_file", EMIT_FIELD(output.distortion_file),
                                   "EXR map with channels `x` and `y`: the place in the turned "
                                   "picture that each pixel shows, px "
                                   "from the top left corner."));
  keys.push_back(coefficients<3>(
      "distortion_radial", "finite", EMIT_FIELD(output.distortion_radial),
      "In place of a map: k1, k2, k3 of Brown's polynomial about the picture's centre."));
  keys.push_back(coefficients<2>("distortion_tangential", "finite",
                                 EMIT_FIELD(output.distortion_tangential),
                                 "p1, p2 of the same polynomial."));
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.output.outside_w_m2_sr != 0.0; },
      number<ChannelDesc>("outside_w_m2_sr", "W m-2 sr-1", between(0.0, 1e9),
                          EMIT_FIELD(output.outside_w_m2_sr),
                          "Radiance of pixels that show nothing of the picture. Without it 0.")));
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.output.apply_shift; },
      boolean<ChannelDesc>("apply_shift", EMIT_FIELD(output.apply_shift),
                           "emitd moves the picture by the shift of the motion simulator, so that "
                           "the projector need not. Needs `[motion]`; projector channels only.")));
  keys.push_back(path<ChannelDesc>(
      "nuc_file", EMIT_FIELD(output.nuc_file),
      "EXR with channels `gain` and `offset` (W m-2 sr-1) of the frame's size: each pixel becomes "
      "gain L + offset."));
  keys.push_back(path<ChannelDesc>(
      "drive_table_file", EMIT_FIELD(output.drive_table_file),
      "CSV file `radiance_w_m2_sr,drive`: frames hold drive, linear between the points, in place "
      "of radiance."));
}

/// Adds the key of what the pixels are.
void add_quantity_key(KeyTable<ChannelDesc>& keys) {
  using scene::PictureQuantity;
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.output.quantity != PictureQuantity::radiance; },
      choice<ChannelDesc>(
          "quantity",
          std::vector<std::pair<std::string, PictureQuantity>>{
              {"radiance", PictureQuantity::radiance},
              {"apparent_temperature", PictureQuantity::apparent_temperature},
              {"photon_radiance", PictureQuantity::photon_radiance}},
          EMIT_FIELD(output.quantity),
          "Unit of the pixels: W m-2 sr-1, K (150 to 3000) or photons s-1 m-2 sr-1. Photons need a "
          "`[[band]]` with `photons = true`.")));
}

/// Adds the tables of the optics and the detector.
void add_detector_keys(KeyTable<ChannelDesc>& keys) {
  keys.push_back(custom<ChannelDesc>(
      {"optics", "table", "", "", "Optics that an injected image lacks (`[channel.optics]`).",
       false},
      [](ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
        if (expect_table(node, "optics", diagnostics)) {
          read_table(node, optics_keys(), out.output.optics, diagnostics);
        }
      },
      [](const ChannelDesc& in) -> std::optional<std::string> {
        if (in.output.optics == scene::ChannelOptics{}) return std::nullopt;
        return inline_table(in.output.optics, optics_keys());
      }));
  keys.push_back(custom<ChannelDesc>(
      {"detector", "table", "", "", "Detector that reads the image (`[channel.detector]`).", false},
      [](ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
        if (expect_table(node, "detector", diagnostics)) {
          read_table(node, detector_keys(), out.output.detector, diagnostics);
        }
      },
      [](const ChannelDesc& in) -> std::optional<std::string> {
        if (in.output.detector == scene::ChannelDetector{}) return std::nullopt;
        return inline_table(in.output.detector, detector_keys());
      }));
}

/// Adds the keys of a channel that does not look as the sensor does.
void add_camera_keys(KeyTable<ChannelDesc>& keys) {
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.camera.fov_h_rad != 0.0; },
      number<ChannelDesc>("fov_h_deg", "deg", between(0, 170), EMIT_FIELD(camera.fov_h_rad),
                          "Horizontal field of view of the whole image from which `window_px` is "
                          "cut: `sensor.fov_h_min_deg` to `sensor.fov_h_deg`. 0: that of the "
                          "sensor, which hosts may set.",
                          physics::kDegree)));
  const auto add = [&](Key<ChannelDesc> key, glm::dvec3 scene::ChannelCamera::*member) {
    keys.push_back(written_if<ChannelDesc>(
        [member](const ChannelDesc& in) { return in.camera.*member != glm::dvec3(0.0); },
        std::move(key)));
  };
  add(vector3<ChannelDesc>("offset_m", "m", EMIT_FIELD(camera.offset_body_m),
                           "Place of the camera from the seeker, forward, right and down. Without "
                           "it the same."),
      &scene::ChannelCamera::offset_body_m);
  add(vector3<ChannelDesc>("yaw_pitch_roll_deg", "deg", EMIT_FIELD(camera.yaw_pitch_roll_rad),
                           "Turn of the camera against the seeker: yaw right, then pitch up, then "
                           "roll right.",
                           physics::kDegree),
      &scene::ChannelCamera::yaw_pitch_roll_rad);
  keys.push_back(custom<ChannelDesc>(
      {"carrier_entity", "integer", "", "an entity",
       "Entity that carries the camera in place of the seeker; offset and turn are in its axes.",
       false},
      [](ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
        std::int64_t id = 0;
        const std::size_t faults = diagnostics.size();
        read_integer(node, "carrier_entity", 0, std::numeric_limits<std::uint32_t>::max(), id,
                     diagnostics);
        if (diagnostics.size() == faults) out.camera.entity_id = static_cast<std::uint32_t>(id);
      },
      [](const ChannelDesc& in) -> std::optional<std::string> {
        if (!in.camera.entity_id) return std::nullopt;
        return std::to_string(*in.camera.entity_id);
      }));
  keys.push_back(written_if<ChannelDesc>(
      [](const ChannelDesc& in) { return in.camera.look_ahead_frames != 0; },
      integer<ChannelDesc>("look_ahead_frames", "", 0, limits::kMaxLookAheadFrames,
                           EMIT_FIELD(camera.look_ahead_frames),
                           "The channel shows the scene so many frames later, by predicted poses, "
                           "for arrays that need the next frame early. Needs `pacing.mode` "
                           "`ig-clock` or `trigger`.")));
}

}  // namespace

const KeyTable<scene::ChannelOptics>& optics_keys() {
  using scene::ChannelOptics;
  using scene::SpotKind;
  static const KeyTable<ChannelOptics> keys = {
      choice<ChannelOptics>(
          "spot",
          std::vector<std::pair<std::string, SpotKind>>{{"none", SpotKind::none},
                                                        {"gaussian", SpotKind::gaussian},
                                                        {"airy", SpotKind::airy},
                                                        {"file", SpotKind::file}},
          EMIT_FIELD(spot), "Spot that a point makes on the detector."),
      written_if<ChannelOptics>(
          [](const ChannelOptics& in) { return in.sigma_px != 0.0; },
          number<ChannelOptics>("sigma_px", "px", between(0.1, 5.0), EMIT_FIELD(sigma_px),
                                "gaussian: standard deviation of the spot.")),
      written_if<ChannelOptics>(
          [](const ChannelOptics& in) { return in.airy_px != 0.0; },
          number<ChannelOptics>("airy_px", "px", between(0.1, 4.0), EMIT_FIELD(airy_px),
                                "airy: wavelength times f-number over the pixel's pitch. The first "
                                "dark ring has 1.22 times this radius.")),
      written_if<ChannelOptics>(
          [](const ChannelOptics& in) { return in.obscuration_frac != 0.0; },
          number<ChannelOptics>("obscuration_frac", "", between(0.0, 0.9),
                                EMIT_FIELD(obscuration_frac),
                                "airy: diameter of the central obscuration over the aperture's.")),
      path<ChannelOptics>("spot_file", EMIT_FIELD(spot_file),
                          "file: EXR with the channel `spot`, an odd number of columns and rows. "
                          "It is scaled to 1."),
      written_if<ChannelOptics>(
          [](const ChannelOptics& in) { return in.vignetting; },
          boolean<ChannelOptics>("vignetting", EMIT_FIELD(vignetting),
                                 "Irradiance falls with the fourth power of the cosine of the "
                                 "angle to the axis.")),
  };
  return keys;
}

const KeyTable<scene::ChannelDetector>& detector_keys() {
  using scene::ChannelDetector;
  static const KeyTable<ChannelDetector> keys = {
      number<ChannelDetector>("reference_k", "K", between(100.0, 3000.0), EMIT_FIELD(reference_k),
                              "Temperature of the blackbody before which noise is stated."),
      number<ChannelDetector>("netd_k", "K", between(0.0, 100.0), EMIT_FIELD(netd_k),
                              "Temporal noise of each pixel: its standard deviation before the "
                              "reference."),
      number<ChannelDetector>("photon_frac", "", between(0.0, 1.0), EMIT_FIELD(photon_frac),
                              "Share of that noise's variance that grows with radiance, as photon "
                              "noise does."),
      number<ChannelDetector>("row_noise_k", "K", between(0.0, 100.0), EMIT_FIELD(row_noise_k),
                              "1/f noise in time that the pixels of a row share."),
      number<ChannelDetector>("column_noise_k", "K", between(0.0, 100.0),
                              EMIT_FIELD(column_noise_k),
                              "1/f noise in time that the pixels of a column share."),
      number<ChannelDetector>("gain_spread_frac", "", between(0.0, 0.3),
                              EMIT_FIELD(gain_spread_frac),
                              "Fixed pattern: standard deviation of the pixels' gains."),
      number<ChannelDetector>("offset_spread_k", "K", between(0.0, 100.0),
                              EMIT_FIELD(offset_spread_k),
                              "Fixed pattern: standard deviation of the pixels' offsets."),
      number<ChannelDetector>("bad_px_frac", "", between(0.0, 0.5), EMIT_FIELD(bad_px_frac),
                              "Share of pixels that see nothing. Half of them are dead, half hot."),
      integer<ChannelDetector>("seed", "", 0, std::numeric_limits<std::uint32_t>::max(),
                               EMIT_FIELD(seed),
                               "Of the fixed pattern and, with the number of the frame, of noise."),
      number<ChannelDetector>("counts_per_w_m2_sr", "m2 sr W-1", between(0.0, 1e9),
                              EMIT_FIELD(counts_per_w_m2_sr),
                              "Above 0: frames hold whole counts in place of radiance."),
      number<ChannelDetector>("counts_offset", "", between(0.0, 65535.0), EMIT_FIELD(counts_offset),
                              "Counts of radiance 0."),
      integer<ChannelDetector>("counts_bits", "", 8, 16, EMIT_FIELD(counts_bits),
                               "Counts end at 2^bits - 1. Pixels beyond are counted and flagged."),
  };
  return keys;
}

const KeyTable<ChannelDesc>& channel_keys() {
  static const KeyTable<ChannelDesc> keys = [] {
    KeyTable<ChannelDesc> all = {
        required(text<ChannelDesc>("name", EMIT_FIELD(name), "Name that a client subscribes to.")),
        choice<ChannelDesc>(
            "kind",
            std::vector<std::pair<std::string, ChannelKind>>{{"injection", ChannelKind::injection},
                                                             {"projector", ChannelKind::projector}},
            EMIT_FIELD(kind), "Device that the channel feeds."),
        required(
            text<ChannelDesc>("band", EMIT_FIELD(band),
                              "Spectral band: `3-5`, `3.4-4.1`, `8-12`, `7.7-9.3` (um, perfect "
                              "rectangles) or one of `[[band]]`.")),
        custom<ChannelDesc>({"window_px", "array of 4 integers", "px", "within the sensor's image",
                             "Window of the sensor's image: `[x, y, width, height]` from the top "
                             "left. Frames hold only these pixels. Without it they hold all.",
                             false},
                            read_window,
                            [](const ChannelDesc& in) -> std::optional<std::string> {
                              if (in.window_px.empty()) {
                                return std::nullopt;
                              }
                              return fmt::format("[{}, {}, {}, {}]", in.window_px.x_px,
                                                 in.window_px.y_px, in.window_px.width_px,
                                                 in.window_px.height_px);
                            }),
        written_if<ChannelDesc>(
            [](const ChannelDesc& in) { return in.every_nth != 1; },
            integer<ChannelDesc>(
                "every_nth", "", 1, limits::kMaxEveryNth, EMIT_FIELD(every_nth),
                "The channel shows frames 1, 1 + n, 1 + 2 n and so on of every run. "
                "At least one channel shows all.")),
    };
    add_camera_keys(all);
    add_output_keys(all);
    add_detector_keys(all);
    add_quantity_key(all);
    return all;
  }();
  return keys;
}

}  // namespace emit::config
