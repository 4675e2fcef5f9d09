// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "emit/physics/foster.hpp"
#include "emit/physics/nnls.hpp"

namespace emit::physics {
namespace {

constexpr std::size_t kFrequencies = 40;
constexpr double kTausPerDecade = 8.0;
// Modes with a smaller share of the resistance are left out: 6 mK in a sheet under full sun.
constexpr double kMinShare = 1e-4;

/// Impedance that the modes must meet: its samples, the weights that turn an error of the impedance
/// into one of the temperature, and the resistance that the modes must add up to.
struct Target {
  std::vector<double> angular_rad_s;
  std::vector<std::complex<double>> impedance;
  std::vector<double> weight;
  double resistance_m2k_w = 0.0;
  double sum_weight = 0.0;
};

Target make_target(std::span<const StackLayer> layers, const NetworkOptions& options) {
  Target target;
  for (const StackLayer& layer : layers) {
    target.resistance_m2k_w += layer.thickness_m / layer.conductivity_w_m_k;
  }
  double scale = 0.0;
  for (std::size_t i = 0; i < kFrequencies; ++i) {
    const double f = static_cast<double>(i) / (kFrequencies - 1);
    const double period_s = options.longest_period_s *
                            std::pow(options.shortest_period_s / options.longest_period_s, f);
    const double angular = 2.0 * kPi / period_s;
    const std::complex<double> z = stack_impedance_m2k_w(layers, angular);
    // The weight is the derivative of T / drive = 1 / (h + 1/Z) by Z.
    const double weight = 1.0 / std::norm(1.0 + options.film_w_m2_k * z);
    target.angular_rad_s.push_back(angular);
    target.impedance.push_back(z);
    target.weight.push_back(weight);
    scale = std::max(scale, weight);
  }
  // The sum's weight is heavy enough to hold the sum and light enough not to swamp the rest in
  // rounding.
  target.sum_weight = 1e3 * scale;
  return target;
}

/// Finds the non-negative resistances of modes with given time constants. Returns the cost.
double solve_resistances(const Target& target, std::span<const double> taus_s,
                         std::vector<double>& resistances) {
  const std::size_t columns = taus_s.size();
  const std::size_t rows = 2 * target.angular_rad_s.size() + 1;
  std::vector<double> matrix(rows * columns);
  std::vector<double> rhs(rows);
  // Fill two rows per frequency: the real and the imaginary part of r / (1 + i w tau).
  for (std::size_t i = 0; i < target.angular_rad_s.size(); ++i) {
    const double w = target.weight[i];
    for (std::size_t j = 0; j < columns; ++j) {
      const std::complex<double> unit =
          w / std::complex<double>(1.0, target.angular_rad_s[i] * taus_s[j]);
      matrix[2 * i * columns + j] = unit.real();
      matrix[(2 * i + 1) * columns + j] = unit.imag();
    }
    rhs[2 * i] = w * target.impedance[i].real();
    rhs[2 * i + 1] = w * target.impedance[i].imag();
  }
  // Add one heavy row that holds the sum of the resistances.
  for (std::size_t j = 0; j < columns; ++j) {
    matrix[(rows - 1) * columns + j] = target.sum_weight;
  }
  rhs[rows - 1] = target.sum_weight * target.resistance_m2k_w;
  resistances = solve_nnls(matrix, rhs, columns);
  // The cost is the squared residual of all rows.
  double cost = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    double residual = rhs[i];
    for (std::size_t j = 0; j < columns; ++j) {
      residual -= matrix[i * columns + j] * resistances[j];
    }
    cost += residual * residual;
  }
  return cost;
}

/// Minimises the cost over the logarithms of the time constants by the simplex of Nelder and Mead.
/// Returns the logarithms.
std::vector<double> minimise(const Target& target, std::vector<double> start) {
  const std::size_t n = start.size();
  std::vector<double> unused;
  const auto cost_of = [&](const std::vector<double>& logs) {
    std::vector<double> taus(n);
    for (std::size_t i = 0; i < n; ++i) taus[i] = std::exp(std::clamp(logs[i], -7.0, 23.0));
    return solve_resistances(target, taus, unused);
  };
  struct Vertex {
    std::vector<double> at;
    double cost = 0.0;
  };
  std::vector<Vertex> simplex(n + 1, {start, 0.0});
  for (std::size_t i = 0; i < n; ++i) simplex[i + 1].at[i] += 0.4;
  for (Vertex& vertex : simplex) vertex.cost = cost_of(vertex.at);
  const auto by_cost = [](const Vertex& a, const Vertex& b) { return a.cost < b.cost; };
  for (int round = 0; round < 250; ++round) {
    std::sort(simplex.begin(), simplex.end(), by_cost);
    if (simplex.back().cost - simplex.front().cost <= 1e-9 * simplex.front().cost) break;
    // Take the centre of all vertices but the worst.
    std::vector<double> centre(n, 0.0);
    for (std::size_t v = 0; v < n; ++v) {
      for (std::size_t i = 0; i < n; ++i) centre[i] += simplex[v].at[i] / static_cast<double>(n);
    }
    const auto along = [&](double f) {
      Vertex vertex{centre, 0.0};
      for (std::size_t i = 0; i < n; ++i) vertex.at[i] += f * (simplex.back().at[i] - centre[i]);
      vertex.cost = cost_of(vertex.at);
      return vertex;
    };
    // Reflect the worst vertex; then expand, accept, contract or shrink.
    Vertex next = along(-1.0);
    if (next.cost < simplex.front().cost) {
      Vertex farther = along(-2.0);
      simplex.back() = farther.cost < next.cost ? std::move(farther) : std::move(next);
    } else if (next.cost < simplex[n - 1].cost) {
      simplex.back() = std::move(next);
    } else {
      next = along(next.cost < simplex.back().cost ? -0.5 : 0.5);
      if (next.cost < simplex.back().cost) {
        simplex.back() = std::move(next);
      } else {
        for (std::size_t v = 1; v <= n; ++v) {
          for (std::size_t i = 0; i < n; ++i) {
            simplex[v].at[i] = 0.5 * (simplex[v].at[i] + simplex[0].at[i]);
          }
          simplex[v].cost = cost_of(simplex[v].at);
        }
      }
    }
  }
  return std::min_element(simplex.begin(), simplex.end(), by_cost)->at;
}

/// Joins modes with similar time constants until `count` are left. It goes on while a further join
/// costs less than `tolerance_m2k_w` of impedance.
void merge(std::vector<NetworkMode>& modes, std::size_t count, double tolerance_m2k_w) {
  while (modes.size() > 1) {
    // Find the two neighbours whose join costs least.
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i + 1 < modes.size(); ++i) {
      const double a = modes[i].resistance_m2k_w;
      const double b = modes[i + 1].resistance_m2k_w;
      const double apart = std::log(modes[i + 1].tau_s / modes[i].tau_s);
      const double loss = a * b / (a + b) * apart * apart;
      if (loss < least) {
        least = loss;
        best = i;
      }
    }
    if (modes.size() <= count && !(least < tolerance_m2k_w)) return;
    // Join them at the mean of their logarithms, weighted by resistance.
    NetworkMode& a = modes[best];
    const NetworkMode& b = modes[best + 1];
    const double sum = a.resistance_m2k_w + b.resistance_m2k_w;
    a.tau_s = std::exp(
        (a.resistance_m2k_w * std::log(a.tau_s) + b.resistance_m2k_w * std::log(b.tau_s)) / sum);
    a.resistance_m2k_w = sum;
    modes.erase(modes.begin() + static_cast<std::ptrdiff_t>(best) + 1);
  }
}

/// Returns the modes whose resistance is above `least`, fastest first.
std::vector<NetworkMode> modes_of(const std::vector<double>& taus_s,
                                  const std::vector<double>& resistances, double least) {
  std::vector<NetworkMode> modes;
  for (std::size_t i = 0; i < taus_s.size(); ++i) {
    if (resistances[i] > least) modes.push_back({taus_s[i], resistances[i]});
  }
  std::sort(modes.begin(), modes.end(),
            [](const NetworkMode& a, const NetworkMode& b) { return a.tau_s < b.tau_s; });
  return modes;
}

/// Checks the ranges of layers and options.
Result<void> check(std::span<const StackLayer> layers, const NetworkOptions& options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (layers.empty()) return make_error(ErrorCode::config, "a stack needs at least one layer");
  for (const StackLayer& layer : layers) {
    if (!positive(layer.thickness_m) || !positive(layer.conductivity_w_m_k) ||
        !positive(layer.volumetric_heat_j_m3_k)) {
      return make_error(ErrorCode::config,
                        "thickness, conductivity and heat capacity of a layer must be positive");
    }
  }
  if (options.modes < 1 || options.modes > kMaxFosterModes ||
      !positive(options.shortest_period_s) || !positive(options.longest_period_s) ||
      !(options.film_w_m2_k >= 0.0)) {
    return make_error(ErrorCode::config, "a thermal network has 1 to 6 modes and positive periods");
  }
  return {};
}

}  // namespace

Result<FosterNetwork> network_of_stack(std::span<const StackLayer> layers,
                                       const NetworkOptions& options) {
  if (auto ok = check(layers, options); !ok) return tl::unexpected(ok.error());
  const Target target = make_target(layers, options);
  double capacity_j_m2_k = 0.0;
  for (const StackLayer& layer : layers) {
    capacity_j_m2_k += layer.thickness_m * layer.volumetric_heat_j_m3_k;
  }
  // No mode of the stack is slower than all its heat over all its resistance.
  const double slowest_s = target.resistance_m2k_w * capacity_j_m2_k;
  const double fastest_s = std::min(options.shortest_period_s / (20.0 * kPi), 0.05 * slowest_s);
  const auto count =
      static_cast<std::size_t>(std::ceil(kTausPerDecade * std::log10(slowest_s / fastest_s)) + 1.0);
  // Solve for the resistances on a fine grid of time constants and merge the result.
  std::vector<double> taus(count);
  for (std::size_t i = 0; i < count; ++i) {
    taus[i] = fastest_s * std::pow(slowest_s / fastest_s,
                                   static_cast<double>(i) / static_cast<double>(count - 1));
  }
  std::vector<double> resistances;
  solve_resistances(target, taus, resistances);
  const double least = kMinShare * target.resistance_m2k_w;
  std::vector<NetworkMode> modes = modes_of(taus, resistances, least);
  merge(modes, options.modes, 0.0);

  // Search from two starts: the merged modes, and as many spread evenly over the stack's time
  // scales.
  std::vector<std::vector<double>> starts(2);
  for (const NetworkMode& mode : modes) starts[0].push_back(std::log(mode.tau_s));
  for (std::size_t i = 0; i < options.modes; ++i) {
    const double f = (static_cast<double>(i) + 0.5) / static_cast<double>(options.modes);
    starts[1].push_back(std::log(fastest_s) + f * std::log(slowest_s / fastest_s));
  }
  double best_cost = std::numeric_limits<double>::infinity();
  for (const std::vector<double>& start : starts) {
    // Run the search a second time from its own result. This frees a collapsed simplex.
    const std::vector<double> logs = minimise(target, minimise(target, start));
    std::vector<double> found(logs.size());
    for (std::size_t i = 0; i < logs.size(); ++i) {
      found[i] = std::exp(std::clamp(logs[i], -7.0, 23.0));
    }
    const double cost = solve_resistances(target, found, resistances);
    if (!(cost < best_cost)) continue;
    best_cost = cost;
    modes = modes_of(found, resistances, least);
  }
  merge(modes, options.modes, least);  // join modes that moved together in the search
  double sum = 0.0;
  for (const NetworkMode& mode : modes) sum += mode.resistance_m2k_w;
  if (modes.empty() || !(sum > 0.0)) {
    return make_error(ErrorCode::config, "the layers have no thermal network");
  }
  // Scale the resistances so that their sum is exact.
  FosterNetwork network;
  for (const NetworkMode& mode : modes) {
    network.modes[network.count] = {mode.tau_s,
                                    mode.resistance_m2k_w * target.resistance_m2k_w / sum};
    ++network.count;
  }
  return network;
}

}  // namespace emit::physics
