// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "emit/physics/relaxation.hpp"
#include "gpu_rows.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::size_t kModes = 3;
/// Number of intervals from which the GPU refuses a row. Mesa's software rasteriser leaves a loop
/// of an invocation after 65535 iterations without any message.
constexpr std::size_t kMaxGpuIntervals = 65'536;

struct Node {
  double time_s = 0.0;
  double drive_k = 0.0;
};

/// Case of the table of cases. The state is given at t = 0. The drive is given by its nodes and
/// constant outside them.
struct Case {
  bool linear = false;
  std::size_t modes = 1;
  std::array<double, kModes> tau_s{};
  std::array<double, kModes> weight_frac{};
  std::array<double, kModes> start_k{};
  std::vector<Node> nodes;
};
using Cases = std::map<std::string, Case, std::less<>>;

/// Interval over which the drive is linear, or constant when both ends are equal.
struct Interval {
  double length_s = 0.0;
  double drive_start_k = 0.0;
  double drive_end_k = 0.0;
};

Result<Cases> read_cases(const std::filesystem::path& file) {
  const auto table = physics::CsvTable::read(file);
  if (!table) return tl::unexpected(table.error());
  const auto names = table->texts("case");
  if (!names) return tl::unexpected(names.error());
  const auto kinds = table->texts("kind");
  if (!kinds) return tl::unexpected(kinds.error());
  const auto columns = read_columns<10>(
      *table, {"n", "tau1", "tau2", "tau3", "w1", "w2", "w3", "x0_1", "x0_2", "x0_3"});
  if (!columns) return tl::unexpected(columns.error());

  Cases cases;
  for (std::size_t row = 0; row < table->rows(); ++row) {
    const auto fail = [&](std::string_view what) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: {}", table->name(), table->line_of(row), what));
    };
    const std::string_view kind = (*kinds)[row];
    if (kind != "const" && kind != "linear") {
      return fail(fmt::format("column 'kind': '{}' is neither 'const' nor 'linear'", kind));
    }
    const double n = (*columns)[0][row];
    if (!(n == 1.0 || n == 2.0 || n == 3.0)) return fail("column 'n': must be 1, 2 or 3");
    Case c;
    c.linear = kind == "linear";
    c.modes = static_cast<std::size_t>(n);
    for (std::size_t mode = 0; mode < c.modes; ++mode) {
      c.tau_s[mode] = (*columns)[1 + mode][row];
      c.weight_frac[mode] = (*columns)[4 + mode][row];
      c.start_k[mode] = (*columns)[7 + mode][row];
      if (!(c.tau_s[mode] > 0.0))
        return fail(fmt::format("column 'tau{}': must be positive", mode + 1));
    }
    if (!cases.emplace((*names)[row], std::move(c)).second) {
      return fail(fmt::format("case '{}' appears twice", (*names)[row]));
    }
  }
  return cases;
}

Result<void> read_nodes(const std::filesystem::path& file, Cases& cases) {
  const auto table = physics::CsvTable::read(file);
  if (!table) return tl::unexpected(table.error());
  const auto names = table->texts("case");
  if (!names) return tl::unexpected(names.error());
  const auto columns = read_columns<2>(*table, {"t_s", "u_K"});
  if (!columns) return tl::unexpected(columns.error());
  for (std::size_t row = 0; row < table->rows(); ++row) {
    const double time_s = (*columns)[0][row];
    if (!std::isfinite(time_s)) {
      return make_error(ErrorCode::parse, fmt::format("{}:{}: column 't_s': must be finite",
                                                      table->name(), table->line_of(row)));
    }
    // A node of an unknown case is ignored, like an unknown column.
    if (const auto found = cases.find((*names)[row]); found != cases.end()) {
      found->second.nodes.push_back({time_s, (*columns)[1][row]});
    }
  }
  for (auto& [name, c] : cases) {
    // The sort is stable: two nodes at one instant are a jump, in the order of the file.
    std::stable_sort(c.nodes.begin(), c.nodes.end(),
                     [](const Node& a, const Node& b) { return a.time_s < b.time_s; });
  }
  return {};
}

/// Returns the drive between 0 and `time_s`, cut at the nodes. Lengths are differences in double,
/// because float32 would not resolve them for late times.
std::vector<Interval> intervals_until(const Case& c, double time_s) {
  std::vector<Interval> intervals;
  const std::vector<Node>& nodes = c.nodes;
  const auto add = [&](double from_s, double to_s, double drive_from_k, double drive_to_k) {
    if (to_s > from_s) intervals.push_back({to_s - from_s, drive_from_k, drive_to_k});
  };
  if (nodes.front().time_s > 0.0) {
    const double u = nodes.front().drive_k;
    add(0.0, std::min(time_s, nodes.front().time_s), u, u);
  }
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i) {
    const Node& a = nodes[i];
    const Node& b = nodes[i + 1];
    const double from_s = std::max(0.0, a.time_s);
    const double to_s = std::min(time_s, b.time_s);
    if (!(to_s > from_s)) continue;
    if (c.linear) {
      const double slope = (b.drive_k - a.drive_k) / (b.time_s - a.time_s);
      add(from_s, to_s, a.drive_k + slope * (from_s - a.time_s),
          to_s == b.time_s ? b.drive_k : a.drive_k + slope * (to_s - a.time_s));
    } else {
      add(from_s, to_s, a.drive_k, a.drive_k);
    }
  }
  add(std::max(0.0, nodes.back().time_s), time_s, nodes.back().drive_k, nodes.back().drive_k);
  return intervals;
}

struct Query {
  const Case* c = nullptr;
  double time_s = 0.0;
  std::vector<Interval> intervals;
  bool defined = false;  ///< true when the time is not before that of the given state
};

Result<std::vector<Query>> read_queries(const physics::CsvTable& table, const Cases& cases,
                                        const std::filesystem::path& cases_file,
                                        const std::filesystem::path& nodes_file) {
  const auto names = table.texts("case");
  if (!names) return tl::unexpected(names.error());
  const auto times_s = table.numbers("t_s");
  if (!times_s) return tl::unexpected(times_s.error());
  std::vector<Query> queries(table.rows());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const auto fail = [&](const std::filesystem::path& file) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: case '{}' is not in '{}'", table.name(),
                                    table.line_of(i), (*names)[i], file.string()));
    };
    const auto found = cases.find((*names)[i]);
    if (found == cases.end()) return fail(cases_file);
    if (found->second.nodes.empty()) return fail(nodes_file);
    Query& query = queries[i];
    query.c = &found->second;
    query.time_s = (*times_s)[i];
    query.defined = query.time_s >= 0.0 && std::isfinite(query.time_s);
    if (query.defined) query.intervals = intervals_until(*query.c, query.time_s);
  }
  return queries;
}

/// Returns the reference temperature, K. Offsets from it stay small, so float32 keeps its digits.
double reference_k(const Case& c) {
  return c.nodes.front().drive_k;
}

template <class Real>
std::vector<Real> on_cpu(const std::vector<Query>& queries) {
  std::vector<Real> result(queries.size(), kUndefined<Real>);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Query& query = queries[i];
    if (!query.defined) continue;
    const double reference = reference_k(*query.c);
    Real sum = 0;
    for (std::size_t mode = 0; mode < query.c->modes; ++mode) {
      Real x = static_cast<Real>(query.c->start_k[mode] - reference);
      for (const Interval& interval : query.intervals) {
        const auto gains = physics::relaxation_gains(interval.length_s, query.c->tau_s[mode]);
        x = physics::relax_linear(
            x, static_cast<Real>(interval.drive_start_k - reference),
            static_cast<Real>(interval.drive_end_k - reference),
            {static_cast<Real>(gains.start_frac), static_cast<Real>(gains.end_frac)});
      }
      sum += static_cast<Real>(query.c->weight_frac[mode]) * x;
    }
    double weights = 0.0;
    for (std::size_t mode = 0; mode < query.c->modes; ++mode) weights += query.c->weight_frac[mode];
    result[i] = static_cast<Real>(reference * weights + static_cast<double>(sum));
  }
  return result;
}

Result<std::vector<float>> on_gpu(const std::vector<Query>& queries, int gpu_index) {
  // A row is: index of the first interval, number of intervals, kind, then weight and start per
  // mode.
  constexpr std::size_t kStride = 3 + 2 * kModes;
  // An interval is: the drive at both ends, then the two gains of each mode.
  constexpr std::size_t kIntervalStride = 2 + 2 * kModes;
  std::vector<float> rows;
  std::vector<float> intervals;
  for (const Query& query : queries) {
    // Indices are float32, exact up to 2^24 intervals.
    rows.push_back(static_cast<float>(intervals.size() / kIntervalStride));
    rows.push_back(static_cast<float>(query.intervals.size()));
    rows.push_back(query.c->linear ? 1.0F : 0.0F);
    const double reference = reference_k(*query.c);
    for (std::size_t mode = 0; mode < kModes; ++mode) {
      const bool used = mode < query.c->modes;
      rows.push_back(used ? static_cast<float>(query.c->weight_frac[mode]) : 0.0F);
      rows.push_back(used ? static_cast<float>(query.c->start_k[mode] - reference) : 0.0F);
    }
    for (const Interval& interval : query.intervals) {
      intervals.push_back(static_cast<float>(interval.drive_start_k - reference));
      intervals.push_back(static_cast<float>(interval.drive_end_k - reference));
      for (std::size_t mode = 0; mode < kModes; ++mode) {
        const auto gains = mode < query.c->modes
                               ? physics::relaxation_gains(interval.length_s, query.c->tau_s[mode])
                               : physics::RelaxationGains<double>{};
        intervals.push_back(static_cast<float>(gains.start_frac));
        intervals.push_back(static_cast<float>(gains.end_frac));
      }
    }
  }
  for (std::size_t i = 0; i < queries.size(); ++i) {
    if (queries[i].intervals.size() < kMaxGpuIntervals) continue;
    return make_error(ErrorCode::unsupported,
                      fmt::format("relaxation on the GPU: query {} spans {} intervals, {} are "
                                  "possible: use --device cpu",
                                  i + 1, queries[i].intervals.size(), kMaxGpuIntervals - 1));
  }
  if (intervals.size() / kIntervalStride >= (1U << 24)) {
    return make_error(ErrorCode::unsupported,
                      "relaxation on the GPU: more than 16777216 intervals in one table");
  }
  GpuRows job;
  job.shader = "passes/evaluate_relaxation.comp";
  job.inputs = rows;
  job.input_stride = kStride;
  job.constants = intervals;
  job.gpu_index = gpu_index;
  const auto raw = run_gpu_rows(job);
  if (!raw) return tl::unexpected(raw.error());
  std::vector<float> result(queries.size(), kUndefined<float>);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    if (!queries[i].defined) continue;
    const Case& c = *queries[i].c;
    const double weights = std::accumulate(
        c.weight_frac.begin(), c.weight_frac.begin() + static_cast<std::ptrdiff_t>(c.modes), 0.0);
    result[i] = static_cast<float>(reference_k(c) * weights + static_cast<double>((*raw)[i]));
  }
  return result;
}

}  // namespace

Result<std::string> run_relaxation(const EvaluateRequest& request, const physics::CsvTable& table) {
  if (request.cases.empty() || request.nodes.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      "model 'relaxation' needs --cases FILE and --nodes FILE");
  }
  auto cases = read_cases(request.cases);
  if (!cases) return tl::unexpected(std::move(cases.error()));
  if (auto nodes = read_nodes(request.nodes, *cases); !nodes) {
    return tl::unexpected(std::move(nodes.error()));
  }
  const auto queries = read_queries(table, *cases, request.cases, request.nodes);
  if (!queries) return tl::unexpected(queries.error());
  if (request.device == Device::gpu) {
    const auto result = on_gpu(*queries, request.gpu_index);
    if (!result) return tl::unexpected(result.error());
    return write_csv(kRelaxationOutputs, std::span(&*result, 1));
  }
  if (request.precision == Precision::float32) {
    const auto result = on_cpu<float>(*queries);
    return write_csv(kRelaxationOutputs, std::span(&result, 1));
  }
  const auto result = on_cpu<double>(*queries);
  return write_csv(kRelaxationOutputs, std::span(&result, 1));
}

}  // namespace emit::verify
