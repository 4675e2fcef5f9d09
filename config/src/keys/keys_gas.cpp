// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of hot gas, flares and smoke.
namespace emit::config {
namespace {

using scene::FireDesc;
using scene::FlareDesc;
using scene::PlumeDesc;
using scene::SmokeDesc;

const Range kTimes = between(-1e9, 1e9);

template <class T>
Key<T> name_key() {
  return text<T>("name", EMIT_FIELD(name),
                 "Name for messages; absent: kind and place in the list.");
}

template <class T>
void append_times(KeyTable<T>& table) {
  table.push_back(nanoseconds<T>("start_s", "s", 1e9, kTimes, EMIT_FIELD(start_ns),
                                 "Sim time from which it burns."));
  table.push_back(nanoseconds<T>("stop_s", "s", 1e9, kTimes, EMIT_FIELD(stop_ns),
                                 "Sim time at which its source goes out."));
}

}  // namespace

const KeyTable<PlumeDesc>& plume_keys() {
  static const KeyTable<PlumeDesc> keys = {
      name_key<PlumeDesc>(),
      required(text<PlumeDesc>("object", EMIT_FIELD(object), "Object that carries the engine.")),
      text<PlumeDesc>("part", EMIT_FIELD(part),
                      "Part of the object whose throttle drives the plume; it needs idle_k and "
                      "full_k. Empty: full power always."),
      vector3<PlumeDesc>("nozzle_m", "m", EMIT_FIELD(nozzle_body_m),
                         "Middle of the nozzle in the object's body: forward, right, down."),
      vector3<PlumeDesc>("direction", "", EMIT_FIELD(direction_body),
                         "Direction of the flow in the same axes, of any length."),
      number<PlumeDesc>("radius_m", "m", between(0.005, 20), EMIT_FIELD(radius_m),
                        "Radius of the jet at the nozzle, expanded to the pressure of the air."),
      number<PlumeDesc>("exit_k", "K", between(250, 3400), EMIT_FIELD(full.exit_k),
                        "Static temperature of the exhaust at full power."),
      number<PlumeDesc>("exit_m_s", "m s-1", between(1, 4000), EMIT_FIELD(full.exit_m_s),
                        "Speed of the exhaust against the nozzle at full power."),
      number<PlumeDesc>("idle_exit_k", "K", between(250, 3400), EMIT_FIELD(idle.exit_k),
                        "Static temperature at throttle 0."),
      number<PlumeDesc>("idle_exit_m_s", "m s-1", between(1, 4000), EMIT_FIELD(idle.exit_m_s),
                        "Speed at throttle 0."),
      number<PlumeDesc>("co2_frac", "", between(0, 1), EMIT_FIELD(exhaust.co2_frac),
                        "Mole fraction of carbon dioxide: kerosene burnt with four times the air "
                        "it needs gives 0.033, with just enough 0.13."),
      number<PlumeDesc>("h2o_frac", "", between(0, 1), EMIT_FIELD(exhaust.h2o_frac),
                        "Mole fraction of water vapour, as much as of carbon dioxide for "
                        "kerosene."),
      number<PlumeDesc>("soot_per_m", "m-1", between(0, 1000), EMIT_FIELD(soot_per_m),
                        "Absorption of soot at the nozzle, alike in all bands."),
  };
  return keys;
}

const KeyTable<FlareDesc>& flare_keys() {
  static const KeyTable<FlareDesc> keys = {
      name_key<FlareDesc>(),
      required(text<FlareDesc>("object", EMIT_FIELD(object),
                               "Entity that burns. It burns anew each time it appears.")),
      number<FlareDesc>("temperature_k", "K", between(300, 5500), EMIT_FIELD(kelvin),
                        "Temperature of the flame."),
      number<FlareDesc>("area_m2", "m2", between(0, 100), EMIT_FIELD(area_m2),
                        "Emissivity times area of the flame as seen from any side: with the "
                        "temperature it gives the intensity."),
      band_numbers<FlareDesc>("intensity_w_sr", "W sr-1", between(0, 1e9),
                              EMIT_FIELD(intensity_w_sr), &scene::BandValue::value,
                              "Radiant intensity by name of the band, in place of temperature "
                              "and area."),
      number<FlareDesc>("radius_m", "m", between(0.001, 50), EMIT_FIELD(radius_m),
                        "Radius of the flame: two standard deviations of a Gaussian."),
      number<FlareDesc>("rise_s", "s", between(0, 1000), EMIT_FIELD(rise_s),
                        "Time from ignition to full intensity."),
      number<FlareDesc>("burn_s", "s", between(0, 1e6), EMIT_FIELD(burn_s),
                        "Time at full intensity."),
      number<FlareDesc>("fall_s", "s", between(0, 1000), EMIT_FIELD(fall_s),
                        "Time from there to nothing."),
  };
  return keys;
}

const KeyTable<SmokeDesc>& smoke_keys() {
  static const KeyTable<SmokeDesc> keys = [] {
    KeyTable<SmokeDesc> table = {
        name_key<SmokeDesc>(),
        text<SmokeDesc>("object", EMIT_FIELD(object),
                        "Object that carries the source, while it is on. Empty: the source stands "
                        "in the world."),
        vector3<SmokeDesc>("position_m", "m", EMIT_FIELD(position_m),
                           "Source in the world, or in the body of the object."),
    };
    append_times(table);
    table.push_back(number<SmokeDesc>("rate_g_s", "g s-1", between(0, 1e6), EMIT_FIELD(rate_g_s),
                                      "Mass of smoke given off."));
    table.push_back(number<SmokeDesc>("radius_m", "m", between(0.01, 100), EMIT_FIELD(radius_m),
                                      "Radius of the cloud at the source: two standard "
                                      "deviations. It grows by 0.14 of its way through the air."));
    table.push_back(number<SmokeDesc>("lifetime_s", "s", between(0.1, 36000),
                                      EMIT_FIELD(lifetime_s),
                                      "Age at which smoke is gone; it fades in the last fifth."));
    table.push_back(number<SmokeDesc>("rise_m_s", "m s-1", between(-50, 50), EMIT_FIELD(rise_m_s),
                                      "Speed upwards."));
    table.push_back(number<SmokeDesc>("source_k", "K", between(200, 3000), EMIT_FIELD(source_k),
                                      "Temperature at the source, which mixing with air lowers; "
                                      "absent: that of the air."));
    table.push_back(number<SmokeDesc>("extinction_m2_g", "m2 g-1", between(0, 100),
                                      EMIT_FIELD(extinction_m2_g),
                                      "Mass extinction coefficient in bands that are not listed."));
    table.push_back(number<SmokeDesc>("albedo_frac", "", between(0, 1), EMIT_FIELD(albedo_frac),
                                      "Share of it that scatters, in bands that are not listed."));
    table.push_back(band_numbers<SmokeDesc>(
        "band_extinction_m2_g", "m2 g-1", between(0, 100), EMIT_FIELD(band_extinction_m2_g),
        &scene::BandValue::value, "Mass extinction coefficient by name of the band."));
    table.push_back(band_numbers<SmokeDesc>("band_albedo_frac", "", between(0, 1),
                                            EMIT_FIELD(band_albedo_frac), &scene::BandValue::value,
                                            "Share of it that scatters, by name of the band."));
    return table;
  }();
  return keys;
}

const KeyTable<FireDesc>& fire_keys() {
  static const KeyTable<FireDesc> keys = [] {
    KeyTable<FireDesc> table = {
        name_key<FireDesc>(),
        text<FireDesc>("object", EMIT_FIELD(object),
                       "Object that burns. Empty: the fire stands in the world."),
        vector3<FireDesc>("position_m", "m", EMIT_FIELD(position_m),
                          "Middle of its base in the world, or in the body of the object."),
    };
    append_times(table);
    table.push_back(number<FireDesc>("diameter_m", "m", between(0.05, 100), EMIT_FIELD(diameter_m),
                                     "Diameter of the base."));
    table.push_back(number<FireDesc>("heat_release_w", "W", between(1e3, 1e10),
                                     EMIT_FIELD(heat_release_w),
                                     "Heat that burning sets free; the height of the flame "
                                     "follows."));
    table.push_back(number<FireDesc>("flame_k", "K", between(600, 2500), EMIT_FIELD(kelvin),
                                     "Temperature of the flame."));
    table.push_back(number<FireDesc>("absorption_per_m", "m-1", between(0.01, 100),
                                     EMIT_FIELD(absorption_per_m),
                                     "Absorption of the sooty flame, alike in all bands."));
    return table;
  }();
  return keys;
}

}  // namespace emit::config
