// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "keys.hpp"

/// Keys of the variation of materials from place to place.
namespace emit::config {

const KeyTable<ClutterDraft>& clutter_keys() {
  static const KeyTable<ClutterDraft> keys = {
      required(text<ClutterDraft>("material", EMIT_FIELD(material),
                                  "Material of the scenario or of a library that varies.")),
      number<ClutterDraft>("shortest_m", "m", between(0.005, 1000), EMIT_FIELD(clutter.shortest_m),
                           "Shortest wavelength of the variation. The field repeats after 256 of "
                           "them."),
      number<ClutterDraft>("longest_m", "m", between(0.01, 32000), EMIT_FIELD(clutter.longest_m),
                           "Longest wavelength: at most 32 times the shortest."),
      number<ClutterDraft>(
          "slope", "", between(0, 6), EMIT_FIELD(clutter.slope),
          "Power spectral density over the plane goes with k^-slope: 3 where correlation "
          "falls exponentially with distance, 2 for octaves of equal variance."),
      integer<ClutterDraft>("seed", "", 0, std::numeric_limits<std::uint32_t>::max(),
                            EMIT_FIELD(clutter.seed), "Another seed gives another field."),
      number<ClutterDraft>("solar_absorptance_sd_frac", "", between(-0.3, 0.3),
                           EMIT_FIELD(clutter.solar_absorptance_sd_frac),
                           "Change of the solar absorptance per standard deviation of the field."),
      number<ClutterDraft>("emissivity_sd_frac", "", between(-0.1, 0.1),
                           EMIT_FIELD(clutter.emissivity_sd_frac),
                           "Change of the emissivity, in total and in bands that are not listed."),
      band_numbers<ClutterDraft>("band_emissivity_sd_frac", "", between(-0.1, 0.1),
                                 EMIT_FIELD(clutter.band_emissivity_sd_frac),
                                 &scene::BandValue::value,
                                 "Change of the emissivity by name of the band."),
      number<ClutterDraft>("inertia_sd_ln", "", between(-0.5, 0.5),
                           EMIT_FIELD(clutter.inertia_sd_ln),
                           "Change of the natural logarithm of the thermal inertia: 0.2 stands "
                           "for a factor 1.22 per standard deviation."),
  };
  return keys;
}

}  // namespace emit::config
