// SPDX-License-Identifier: Apache-2.0
// Short runs of the stability sweeps: the shader functions themselves under random and hostile
// inputs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "emit/verify/stability.hpp"

namespace emit {
namespace {

using verify::SweepOptions;
using verify::SweepReport;
using verify::SweepResult;

SweepOptions reduced(std::uint64_t cases) {
  SweepOptions options;
  options.cases = cases;
  return options;
}

const SweepResult& row(const SweepReport& report, const std::string& test,
                       const std::string& computed_by = "shader") {
  const auto found = std::find_if(
      report.results.begin(), report.results.end(),
      [&](const SweepResult& r) { return r.test == test && r.computed_by == computed_by; });
  if (found != report.results.end()) return *found;
  static const SweepResult kMissing{
      .test = "missing", .computed_by = {}, .worst_input = {}, .note = {}};
  ADD_FAILURE() << "no row " << test;
  return kMissing;
}

const SweepReport& equilibrium() {
  static const auto report = verify::sweep_equilibrium(reduced(400'000));
  static const SweepReport kNone;
  if (!report) ADD_FAILURE() << report.error().text;
  return report ? *report : kNone;
}

const std::vector<verify::NamedBand>& bands() {
  static const std::vector<verify::NamedBand> kBands{{"3-5", {3.0, 5.0, {}}},
                                                     {"8-12", {8.0, 12.0, {}}}};
  return kBands;
}

TEST(StabilitySweep, EquilibriumStaysWithinAMillikelvinOverTheBox) {
  const SweepResult& r = row(equilibrium(), "equilibrium");
  EXPECT_EQ(r.cases, 400'000U);
  EXPECT_EQ(r.nan_count + r.inf_count + r.below_zero_count, 0U);
  EXPECT_EQ(r.clamped_count, 0U);
  EXPECT_LE(r.max_error_k, 1e-3) << r.worst_input;
  EXPECT_GT(r.max_error_k, 1e-6) << "a float32 result without error was not compared with double";
}

TEST(StabilitySweep, EquilibriumUpTo6000KelvinStaysNearTheRoundingOfFloat32) {
  const SweepResult& r = row(equilibrium(), "equilibrium-extended");
  EXPECT_EQ(r.nan_count + r.inf_count + r.below_zero_count + r.unflagged_count, 0U);
  EXPECT_LE(r.max_error_k, 3e-3) << r.worst_input;
}

TEST(StabilitySweep, HostileSurfacesAreFlaggedAndNeverGiveNaN) {
  for (const char* test : {"equilibrium-hostile", "equilibrium-any-bits"}) {
    const SweepResult& r = row(equilibrium(), test);
    EXPECT_EQ(r.cases, 50'000U) << test;
    EXPECT_EQ(r.nan_count + r.inf_count + r.below_zero_count, 0U) << test;
    EXPECT_EQ(r.unflagged_count, 0U) << test;
    EXPECT_GT(r.clamped_count, r.cases / 4) << test << ": the draws were not hostile";
    EXPECT_LT(r.clamped_count, r.cases) << test << ": everything was flagged";
  }
  EXPECT_LE(row(equilibrium(), "equilibrium-any-bits").max_error_frac, 1e-6);
}

TEST(StabilitySweep, PublishedClosedFormFailsWhereTheSolverDoesNot) {
  // The formula as typeset is wrong by tens of kelvin everywhere; the corrected one loses its
  // digits.
  for (const char* by : {"shader", "cpu float32"}) {
    EXPECT_GT(row(equilibrium(), "printed-eq6", by).p99_error_k, 10.0) << by;
    const SweepResult& corrected = row(equilibrium(), "corrected-eq6", by);
    EXPECT_GT(corrected.max_error_k, 10.0) << by;
    EXPECT_GT(corrected.nan_count + corrected.inf_count, 0U) << by;
    EXPECT_LT(row(equilibrium(), "stable-closed-form", by).max_error_k, 0.1) << by;
  }
}

TEST(StabilitySweep, BandRadianceHoldsItsPromiseAndFlagsNonsense) {
  const auto report = verify::sweep_band_radiance(reduced(20'000), bands());
  ASSERT_TRUE(report.has_value()) << report.error().text;
  for (const verify::NamedBand& band : bands()) {
    const SweepResult& promised = row(*report, "band-radiance " + band.name);
    EXPECT_LE(promised.max_error_frac, 1e-4) << band.name;
    EXPECT_GT(promised.cases, 1000U);
    for (const char* test : {"band-radiance-0-6000 ", "band-radiance-hostile "}) {
      const SweepResult& r = row(*report, test + band.name);
      EXPECT_EQ(r.nan_count + r.inf_count + r.below_zero_count, 0U) << r.test;
      EXPECT_EQ(r.unflagged_count, 0U) << r.test;
      EXPECT_GT(r.clamped_count, 0U) << r.test;
    }
  }
}

TEST(StabilitySweep, RelaxationStaysWithinAUnitInTheLastPlacePerStep) {
  const auto report = verify::sweep_relaxation(reduced(500));
  ASSERT_TRUE(report.has_value()) << report.error().text;
  for (const char* test : {"relaxation-constant", "relaxation-linear"}) {
    const SweepResult& r = row(*report, test);
    EXPECT_GT(r.cases, 100U);
    EXPECT_EQ(r.nan_count + r.inf_count, 0U) << test;
    EXPECT_EQ(r.unflagged_count, 0U) << test << ": " << r.note;
    EXPECT_GT(r.max_error_k, 0.0) << test;
  }
}

TEST(StabilitySweep, RepeatsExactlyWhateverTheNumberOfThreads) {
  SweepOptions options = reduced(10'000);
  options.threads = 1;
  const auto one = verify::sweep_equilibrium(options);
  options.threads = 3;
  const auto three = verify::sweep_equilibrium(options);
  ASSERT_TRUE(one.has_value() && three.has_value());
  ASSERT_EQ(one->results.size(), three->results.size());
  for (std::size_t i = 0; i < one->results.size(); ++i) {
    EXPECT_EQ(one->results[i].worst_input, three->results[i].worst_input);
    EXPECT_EQ(one->results[i].clamped_count, three->results[i].clamped_count);
    if (std::isfinite(one->results[i].max_error_k)) {
      EXPECT_EQ(one->results[i].max_error_k, three->results[i].max_error_k);
      EXPECT_EQ(one->results[i].p99_error_k, three->results[i].p99_error_k);
    }
  }
}

TEST(StabilitySweep, CanBeStopped) {
  SweepOptions options = reduced(10'000);
  options.progress = [](double) { return false; };
  EXPECT_FALSE(verify::sweep_equilibrium(options).has_value());
}

}  // namespace
}  // namespace emit
