// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/atmosphere_table.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

/// Place on an axis: a cell and the fraction of it, 0..1.
struct Cell {
  std::size_t index = 0;
  double fraction = 0.0;
  bool clamped = false;
};

/// Returns the cell of `x` on an ascending axis of at least two nodes. NaN counts as below the
/// axis.
Cell find_cell(const std::vector<double>& nodes, double x) noexcept {
  if (!(x >= nodes.front())) return {0, 0.0, true};
  if (x > nodes.back()) return {nodes.size() - 2, 1.0, true};
  const auto above = std::upper_bound(nodes.begin(), nodes.end(), x);
  const auto index =
      std::min(static_cast<std::size_t>(above - nodes.begin()) - 1, nodes.size() - 2);
  return {index, (x - nodes[index]) / (nodes[index + 1] - nodes[index]), false};
}

/// Returns the share of a cell's emission that comes from its first part u, physics.md eq. 15: (1 -
/// e^(-u d)) / (1 - e^(-d)).
double emitted_share(double u, double d) noexcept {
  return d > 1e-12 ? std::expm1(-u * d) / std::expm1(-d) : u;
}

/// Prints a number without trailing zeros.
std::string number_text(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (!text.empty() && text.back() == '.') text.pop_back();
  return text;
}

tl::unexpected<Error> fault(std::string text) {
  return make_error(ErrorCode::invalid_argument, "atmosphere table: " + std::move(text));
}

}  // namespace

Result<void> validate(const AtmosphereGrid& grid) {
  const std::size_t ranges = grid.range_m.size();
  const std::size_t elevations = grid.elevation_rad.size();
  if (ranges == 0 || elevations == 0) return fault("no ranges or no elevations");
  if (grid.transmittance_frac.size() != ranges * elevations ||
      grid.path_radiance_w_m2_sr.size() != ranges * elevations) {
    return fault(std::to_string(grid.transmittance_frac.size()) + " transmittances and " +
                 std::to_string(grid.path_radiance_w_m2_sr.size()) + " path radiances for " +
                 std::to_string(ranges) + " ranges at " + std::to_string(elevations) +
                 " elevations");
  }
  for (std::size_t r = 0; r < ranges; ++r) {
    if (!(grid.range_m[r] >= 0.0 && std::isfinite(grid.range_m[r]))) {
      return fault("range " + number_text(grid.range_m[r]) + " m is not 0 or more");
    }
    if (r > 0 && !(grid.range_m[r] > grid.range_m[r - 1])) {
      return fault("range " + number_text(grid.range_m[r]) + " m is not above the one before");
    }
  }
  if (!(grid.range_m.back() > 0.0)) return fault("no range beyond 0 m");
  for (std::size_t e = 0; e < elevations; ++e) {
    const double elevation_deg = grid.elevation_rad[e] / kDegree;
    if (!(std::abs(elevation_deg) <= 90.0 + 1e-9)) {
      return fault("elevation " + number_text(elevation_deg) + " deg is not -90 .. 90");
    }
    if (e > 0 && !(grid.elevation_rad[e] > grid.elevation_rad[e - 1])) {
      return fault("elevation " + number_text(elevation_deg) + " deg is not above the one before");
    }
    for (std::size_t r = 0; r < ranges; ++r) {
      const double tau = grid.transmittance_frac[e * ranges + r];
      const double path = grid.path_radiance_w_m2_sr[e * ranges + r];
      const std::string where = " at range " + number_text(grid.range_m[r]) + " m, elevation " +
                                number_text(elevation_deg) + " deg";
      if (!(tau >= 0.0 && tau <= 1.0)) return fault("transmittance is not 0 .. 1" + where);
      if (!(path >= 0.0 && std::isfinite(path))) {
        return fault("path radiance is not 0 or more" + where);
      }
      if (r > 0 && tau > grid.transmittance_frac[e * ranges + r - 1]) {
        return fault("transmittance rises" + where);
      }
      if (grid.range_m[r] == 0.0 && (tau != 1.0 || path != 0.0)) {
        return fault("transmittance must be 1 and path radiance 0" + where);
      }
    }
  }
  return {};
}

Result<AtmosphereTable> AtmosphereTable::build(const AtmosphereGrid& grid) {
  if (auto ok = validate(grid); !ok) return tl::unexpected(ok.error());
  AtmosphereTable table;
  const std::size_t ranges = grid.range_m.size();
  const bool starts_beyond_zero = grid.range_m.front() > 0.0;
  if (starts_beyond_zero) table.range_m_.push_back(0.0);
  table.range_m_.insert(table.range_m_.end(), grid.range_m.begin(), grid.range_m.end());
  for (std::size_t e = 0; e < grid.elevation_rad.size(); ++e) {
    table.sin_elevation_.push_back(std::sin(grid.elevation_rad[e]));
    if (starts_beyond_zero) table.nodes_.push_back({});
    for (std::size_t i = e * ranges; i < (e + 1) * ranges; ++i) {
      table.nodes_.push_back(
          {std::max(0.0, -std::log(std::max(grid.transmittance_frac[i], kMinTransmittance))),
           grid.path_radiance_w_m2_sr[i]});
    }
  }
  return table;
}

AtmosphereTable::Node AtmosphereTable::at_elevation(std::size_t elevation, std::size_t cell,
                                                    double fraction) const noexcept {
  const Node& a = nodes_[elevation * range_m_.size() + cell];
  const Node& b = nodes_[elevation * range_m_.size() + cell + 1];
  // Interpolate along range by physics.md eq. 14 and 15.
  const double depth = b.optical_depth - a.optical_depth;
  return {a.optical_depth + fraction * depth,
          a.path_radiance_w_m2_sr +
              emitted_share(fraction, depth) * (b.path_radiance_w_m2_sr - a.path_radiance_w_m2_sr)};
}

AtmosphereTable::Air AtmosphereTable::along(double range_m, double sin_elevation) const noexcept {
  const Cell range = find_cell(range_m_, range_m);
  if (elevations() == 1) {
    const Node node = at_elevation(0, range.index, range.fraction);
    return {std::exp(-node.optical_depth), node.path_radiance_w_m2_sr, range.clamped};
  }
  // Interpolate both quantities linearly in the sine of the elevation.
  const Cell elevation = find_cell(sin_elevation_, sin_elevation);
  const Node low = at_elevation(elevation.index, range.index, range.fraction);
  const Node high = at_elevation(elevation.index + 1, range.index, range.fraction);
  const auto between = [&](double a, double b) { return a + elevation.fraction * (b - a); };
  return {std::exp(-between(low.optical_depth, high.optical_depth)),
          between(low.path_radiance_w_m2_sr, high.path_radiance_w_m2_sr),
          range.clamped || elevation.clamped};
}

AtmosphereTable::Air AtmosphereTable::out(double sin_elevation) const noexcept {
  return along(range_m_.back(), sin_elevation);
}

std::vector<float> AtmosphereTable::shader_nodes() const {
  std::vector<float> out;
  out.reserve(range_m_.size() + sin_elevation_.size() + 2 * nodes_.size());
  for (const double range_m : range_m_) out.push_back(static_cast<float>(range_m));
  for (const double sine : sin_elevation_) out.push_back(static_cast<float>(sine));
  for (const Node& node : nodes_) {
    out.push_back(static_cast<float>(node.optical_depth));
    out.push_back(static_cast<float>(node.path_radiance_w_m2_sr));
  }
  return out;
}

}  // namespace emit::physics
