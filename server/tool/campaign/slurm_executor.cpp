// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iterator>
#include <thread>

#include "tool/campaign/executor.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Elements of one job array. Slurm's own limit is 1001 unless it is configured higher.
constexpr std::size_t kArray = 1000;

/// A word for the shell.
std::string shell_quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string read_all(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

Result<void> write_file(const std::filesystem::path& path, const std::string& text) {
  auto file = ReplacingFile::create(path);
  if (!file) return tl::unexpected(std::move(file.error()));
  if (auto done = file->write(text); !done) return done;
  return file->commit();
}

class SlurmExecutor final : public Executor {
 public:
  SlurmExecutor(const config::CampaignDesc& campaign, const ElementStore& store,
                std::filesystem::path sbatch, std::filesystem::path squeue,
                std::filesystem::path scancel)
      : campaign_(campaign),
        store_(store),
        sbatch_(std::move(sbatch)),
        squeue_(std::move(squeue)),
        scancel_(std::move(scancel)) {}

  Result<void> run(std::span<const std::size_t> elements,
                   const std::function<void(std::size_t ended)>& ended) override {
    if (auto made = make_directory(folder()); !made) return made;
    for (std::size_t first = 0; first < elements.size(); first += kArray) {
      const auto part = elements.subspan(first, std::min(kArray, elements.size() - first));
      const auto job = submit(part);
      if (!job) return tl::unexpected(job.error());
      const auto of_part = [&](std::size_t count) { ended(first + count); };
      if (auto waited = wait_for(*job, part.size(), of_part); !waited) return waited;
    }
    return {};
  }

 private:
  [[nodiscard]] std::filesystem::path folder() const { return store_.folder() / "slurm"; }

  /// Runs a program of Slurm and returns what it prints. Errors: io, with what it says.
  [[nodiscard]] Result<std::string> call(const std::vector<std::string>& arguments) const {
    const auto log = folder() / "answer.txt";
    auto process = Subprocess::start(arguments, log);
    if (!process) return tl::unexpected(process.error());
    constexpr std::chrono::minutes kPatience(5);
    const auto status = process->wait(kPatience);
    const std::string text = read_all(log);
    if (!status || *status != 0) {
      return make_error(ErrorCode::io, fmt::format("{}: {}", arguments.front(),
                                                   status ? text : "no answer in five minutes"));
    }
    return text;
  }

  /// Submits an array of elements and returns the number of its job.
  [[nodiscard]] Result<std::string> submit(std::span<const std::size_t> elements) {
    const auto command = element_command(campaign_, store_);
    if (!command) return tl::unexpected(command.error());
    const auto list = folder() / fmt::format("array-{:03}.list", arrays_);
    const auto script = folder() / fmt::format("array-{:03}.sh", arrays_++);
    std::string numbers;
    for (const std::size_t element : elements) numbers += std::to_string(element) + "\n";
    if (auto done = write_file(list, numbers); !done) return tl::unexpected(done.error());
    std::string line;
    for (const std::string& word : *command) line += shell_quoted(word) + " ";
    const std::string text = fmt::format(
        "#!/bin/sh\n# An array of elements of the campaign {}: the list has their numbers.\n"
        "element=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {})\n"
        "log=$(printf '%s/%06d.log' {} \"$element\")\n"
        "exec {}\"$element\" >\"$log\" 2>&1\n",
        campaign_.name, shell_quoted(list.string()),
        shell_quoted(store_.log_file(0).parent_path().string()), line);
    if (auto done = write_file(script, text); !done) return tl::unexpected(done.error());

    const config::CampaignSlurm& slurm = campaign_.slurm;
    const std::string limit = slurm.at_once > 0 ? fmt::format("%{}", slurm.at_once) : "";
    std::vector<std::string> arguments{
        sbatch_.string(),
        "--parsable",
        fmt::format("--array=0-{}{}", elements.size() - 1, limit),
        fmt::format("--job-name=emit-{}", campaign_.name),
        fmt::format("--output={}/%A_%a.txt", folder().string()),
        "--ntasks=1",
        "--no-requeue",  // the campaign itself tries again, and counts it
        fmt::format("--cpus-per-task={}", slurm.cpus),
        fmt::format("--time={}", static_cast<std::int64_t>(std::ceil(campaign_.run.timeout_min)))};
    if (!slurm.partition.empty()) arguments.push_back("--partition=" + slurm.partition);
    if (slurm.memory_mib > 0) arguments.push_back(fmt::format("--mem={}M", slurm.memory_mib));
    arguments.insert(arguments.end(), slurm.options.begin(), slurm.options.end());
    arguments.push_back(script.string());
    auto answer = call(arguments);
    if (!answer) return answer;
    // "NUMBER" or "NUMBER;CLUSTER", behind warnings of sbatch.
    const std::string last = answer->substr(answer->find_last_of('\n') + 1);
    const std::string job = last.substr(0, last.find(';'));
    if (job.empty() || job.find_first_not_of("0123456789") != std::string::npos) {
      return make_error(ErrorCode::io,
                        fmt::format("sbatch: '{}' is not the number of a job", *answer));
    }
    return job;
  }

  /// Waits until no element of a job is waiting or running.
  [[nodiscard]] Result<void> wait_for(const std::string& job, std::size_t elements,
                                      const std::function<void(std::size_t ended)>& ended) const {
    std::size_t faults = 0;
    while (true) {
      if (InterruptGuard::interrupted()) {
        (void)call({scancel_.string(), job});
        return make_error(ErrorCode::internal,
                          fmt::format("interrupted; job {} is cancelled", job));
      }
      const auto answer = call({squeue_.string(), "-h", "-r", "-j", job, "-o", "%T"});
      if (answer && answer->empty()) return {};
      if (!answer && answer.error().text.find("Invalid job id") != std::string::npos) return {};
      // The controller may restart meanwhile.
      constexpr std::size_t kMostFaults = 60;
      if (!answer && ++faults > kMostFaults) return tl::unexpected(answer.error());
      if (answer) {
        faults = 0;
        const auto left = 1 + std::ranges::count(*answer, '\n');
        ended(elements - std::min(elements, static_cast<std::size_t>(left)));
      }
      constexpr std::chrono::milliseconds kPoll(1000);
      std::this_thread::sleep_for(kPoll);
    }
  }

  const config::CampaignDesc& campaign_;
  const ElementStore& store_;
  std::filesystem::path sbatch_;
  std::filesystem::path squeue_;
  std::filesystem::path scancel_;
  std::size_t arrays_ = 0;
};

}  // namespace

Result<std::unique_ptr<Executor>> slurm_executor(const config::CampaignDesc& campaign,
                                                 const ElementStore& store) {
  std::vector<std::filesystem::path> programs;
  for (const char* name : {"sbatch", "squeue", "scancel"}) {
    const auto program = find_program(name);
    if (!program) {
      return make_error(ErrorCode::not_found,
                        fmt::format("--slurm: the program {} is not found (Debian: package "
                                    "slurm-client)",
                                    name));
    }
    programs.push_back(*program);
  }
  return std::make_unique<SlurmExecutor>(campaign, store, programs[0], programs[1], programs[2]);
}

}  // namespace emit::tool
