// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "bench/stream/stream_benches.hpp"
#include "emit/image/exr_image.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/version.hpp"
#include "output/output_chain.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/json.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct OutputBenchOptions {
  std::optional<std::filesystem::path> json;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  std::uint32_t rounds = 200;
};

using physics::Result;

/// Returns the processor time of this thread: other programs take nothing of it.
double cpu_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Something that is done to a picture, with the times that it took.
struct Step {
  std::string name;
  std::optional<server::OutputChain> chain;  ///< empty: a plain copy, or a checksum
  Samples ms{1u << 18};
};

/// Measures what the steps of an output cost, in turns, so that a change of the machine's speed
/// meets all of them.
class OutputBench {
 public:
  OutputBench(const OutputBenchOptions& command, std::filesystem::path work)
      : command_(command), work_(std::move(work)) {}

  Result<void> run();
  void print(std::FILE* out) const;
  [[nodiscard]] Json json() const;

 private:
  [[nodiscard]] std::size_t pixels() const {
    return std::size_t{command_.width_px} * command_.height_px;
  }
  Result<void> make_steps();
  Result<void> add(std::string name, const scene::ChannelOutput& settings);
  Result<void> write_files(scene::ChannelOutput& settings) const;
  /// Runs one step on one image, and adds its time.
  void measure(Step& step, const std::vector<float>& image);
  [[nodiscard]] double ratio(const Step& step) const {
    return step.ms.median() / steps_.front().ms.median();
  }
  [[nodiscard]] double ms_per_megapixel(const Step& step) const {
    return step.ms.median() / (1e-6 * static_cast<double>(pixels()));
  }

  const OutputBenchOptions command_;
  const std::filesystem::path work_;
  std::vector<std::vector<float>> images_;
  std::vector<float> out_;
  std::vector<Step> steps_;
  std::uint64_t frame_number_ = 0;
  std::uint32_t sum_ = 0;  // of everything made, so that nothing is left out
};

Result<void> OutputBench::write_files(scene::ChannelOutput& settings) const {
  image::ExrImage gains;
  gains.width_px = command_.width_px;
  gains.height_px = command_.height_px;
  std::vector<float> gain(pixels());
  for (std::size_t i = 0; i < gain.size(); ++i) gain[i] = 1.0F + 1e-3F * static_cast<float>(i % 97);
  gains.add("gain", gain);
  gains.add("offset", std::vector<float>(pixels(), 0.25F));
  settings.nuc_file = work_ / "nuc.exr";
  if (auto written = image::write_exr(settings.nuc_file, gains); !written) return written;
  settings.drive_table_file = work_ / "drive.csv";
  std::ofstream table(settings.drive_table_file);
  table << "radiance_w_m2_sr,drive\n";
  constexpr int kPoints = 256;
  for (int i = 0; i < kPoints; ++i) {
    const double radiance = 0.5 * i;
    table << radiance << ',' << 4095.0 * std::pow(radiance / (0.5 * (kPoints - 1)), 0.6) << '\n';
  }
  table.close();
  if (!table) {
    return physics::make_error(physics::ErrorCode::io,
                               settings.drive_table_file.string() + ": writing failed");
  }
  return {};
}

Result<void> OutputBench::add(std::string name, const scene::ChannelOutput& settings) {
  auto chain = server::OutputChain::make(settings, {{command_.width_px, command_.height_px},
                                                    {0, 0, command_.width_px, command_.height_px},
                                                    static_cast<double>(command_.width_px),
                                                    scene::SpectralBand{"8-12", 8.0, 12.0, {}}});
  if (!chain) return tl::unexpected(std::move(chain.error()));
  steps_.push_back({std::move(name), std::move(*chain)});
  return {};
}

Result<void> OutputBench::make_steps() {
  scene::ChannelOutput files;
  if (auto written = write_files(files); !written) return written;
  steps_.push_back({"copy", std::nullopt});
  steps_.push_back({"checksum", std::nullopt});
  std::vector<std::pair<std::string, scene::ChannelOutput>> wanted(13);
  wanted[0].first = "mirror";
  wanted[0].second.mirror = scene::PictureMirror::horizontal;
  wanted[1].first = "rotate 90";
  wanted[1].second.rotate_deg = 90;
  wanted[2].first = "shift";
  wanted[2].second.apply_shift = true;
  wanted[3].first = "distortion";
  wanted[3].second.distortion_radial = {-0.1, 0.01, 0.0};
  wanted[4].first = "distortion, shift, rotate 90";
  wanted[4].second = wanted[3].second;
  wanted[4].second.apply_shift = true;
  wanted[4].second.rotate_deg = 90;
  wanted[5].first = "non-uniformity";
  wanted[5].second.nuc_file = files.nuc_file;
  wanted[6].first = "drive table";
  wanted[6].second.drive_table_file = files.drive_table_file;
  wanted[7].first = "everything but a rotation";
  wanted[7].second = files;
  wanted[7].second.mirror = scene::PictureMirror::horizontal;
  wanted[7].second.distortion_radial = wanted[3].second.distortion_radial;
  wanted[7].second.apply_shift = true;
  wanted[8].first = "spot, Gaussian 0.7 px";
  wanted[8].second.optics.spot = scene::SpotKind::gaussian;
  wanted[8].second.optics.sigma_px = 0.7;
  wanted[9].first = "spot, Airy 1 px";
  wanted[9].second.optics.spot = scene::SpotKind::airy;
  wanted[9].second.optics.airy_px = 1.0;
  wanted[10].first = "noise";
  wanted[10].second.detector.netd_k = 0.05;
  wanted[11].first = "detector: noise, pattern, drift, bad pixels, counts";
  wanted[11].second.detector = {.netd_k = 0.05,
                                .photon_frac = 0.5,
                                .row_noise_k = 0.01,
                                .column_noise_k = 0.01,
                                .gain_spread_frac = 0.01,
                                .offset_spread_k = 0.1,
                                .bad_px_frac = 1e-3,
                                .counts_per_w_m2_sr = 200.0};
  wanted[12].first = "Airy spot and detector";
  wanted[12].second.optics = wanted[9].second.optics;
  wanted[12].second.detector = wanted[11].second.detector;
  for (auto& [name, settings] : wanted) {
    if (auto added = add(std::move(name), settings); !added) return added;
  }
  return {};
}

void OutputBench::measure(Step& step, const std::vector<float>& image) {
  const double begun_ms = cpu_ms();
  if (step.chain) {
    sum_ += step.chain->apply(image, {{0.3125F, -0.6875F}, ++frame_number_}, out_);
  } else if (step.name == "copy") {
    std::ranges::copy(image, out_.begin());
  } else {
    sum_ += protocol::crc32c(std::as_bytes(std::span(image)));
  }
  step.ms.add(cpu_ms() - begun_ms);
  sum_ += static_cast<std::uint32_t>(out_[sum_ % out_.size()]);
}

Result<void> OutputBench::run() {
  if (auto made = make_steps(); !made) return made;
  // Smooth pictures with edges, as scenes have them; several, so that none stays in the cache.
  constexpr std::size_t kImages = 4;
  for (std::size_t i = 0; i < kImages; ++i) {
    std::vector<float>& image = images_.emplace_back(pixels());
    for (std::size_t at = 0; at < image.size(); ++at) {
      const auto x = static_cast<double>(at % command_.width_px);
      const auto y = static_cast<double>(at / command_.width_px);
      image[at] = static_cast<float>(
          40.0 + 20.0 * std::sin(0.05 * x + static_cast<double>(i)) * std::cos(0.04 * y) +
          (std::fmod(x + y, 64.0) < 8.0 ? 30.0 : 0.0));
    }
  }
  out_.resize(pixels());
  for (std::uint32_t round = 0; round < command_.rounds; ++round) {
    for (Step& step : steps_) measure(step, images_[round % kImages]);
  }
  return {};
}

void OutputBench::print(std::FILE* out) const {
  TextTable table({"step", "ms", "p99 ms", "ms a megapixel", "ratio to the copy"});
  for (const Step& step : steps_) {
    table.add({step.name, fmt::format("{:.3f}", step.ms.median()),
               fmt::format("{:.3f}", step.ms.percentile(0.99)),
               fmt::format("{:.2f}", ms_per_megapixel(step)), fmt::format("{:.1f}", ratio(step))});
  }
  fmt::print(out, "{}x{}, processor time of one thread, medians of {} rounds\n{}",
             command_.width_px, command_.height_px, command_.rounds, table.to_string());
}

Json OutputBench::json() const {
  Json results = Json::array();
  for (const Step& step : steps_) {
    Json result = Json::object();
    result.set("step", step.name).set("median_ms", step.ms.median());
    result.set("p99_ms", step.ms.percentile(0.99));
    result.set("ms_per_megapixel", ms_per_megapixel(step)).set("ratio_to_copy", ratio(step));
    results.push(std::move(result));
  }
  return results;
}

int run(const OutputBenchOptions& command) {
  std::error_code error;
  const auto work =
      std::filesystem::temp_directory_path(error) /
      fmt::format("emit-bench-{}", std::chrono::steady_clock::now().time_since_epoch().count());
  if (auto made = make_directory(work); !made) return fail(made.error());
  OutputBench bench(command, work);
  const auto done = bench.run();
  std::filesystem::remove_all(work, error);
  if (!done) return fail(done.error());
  bench.print(text_stream(command.json));
  if (command.json) {
    Json json = Json::object();
    json.set("commit", kCommit).set("suite", "output").set("width", command.width_px);
    json.set("height", command.height_px).set("rounds", command.rounds);
    json.set("results", bench.json());
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, OutputBenchOptions& options) {
  add_image_size(line, options.width_px, options.height_px);
  line.option("--rounds", options.rounds, "Times that each step is run, in turns")
      .in_range(1U, 100'000U)
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_bench_output(CommandLine& bench) {
  bench.command<OutputBenchOptions>(
      {.name = "output",
       .text = "What the steps of a channel's output cost (mirror, rotation, shift, distortion, "
               "non-uniformity, drive table), beside a copy and a checksum of the picture",
       .example = "emit bench output --json output.json"},
      add_options, run);
}

}  // namespace emit::tool
