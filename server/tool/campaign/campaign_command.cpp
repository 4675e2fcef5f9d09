// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/campaign_command.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "emit/config/campaign.hpp"
#include "tool/campaign/campaign_elements.hpp"
#include "tool/campaign/campaign_report.hpp"
#include "tool/campaign/element_run.hpp"
#include "tool/campaign/element_store.hpp"
#include "tool/campaign/executor.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct CampaignOptions {
  std::filesystem::path file;
  std::filesystem::path out;
  bool slurm = false;
  bool list = false;
  std::optional<std::uint32_t> jobs;
  std::optional<std::uint64_t> element;
  std::optional<std::filesystem::path> json;
};

/// A campaign with its elements.
struct Loaded {
  config::CampaignDesc campaign;
  std::vector<CampaignElement> elements;
};

/// Errors: those of load_campaign(), element_scenario() and campaign_elements(), as config.
Result<Loaded> load(const std::filesystem::path& file) {
  auto campaign = config::load_campaign(file);
  if (!campaign) return tl::unexpected(campaign.error());
  // The epoch decides which instant a time of the day is. It belongs to the campaign as a whole.
  const auto scenario = element_scenario(*campaign, {});
  if (!scenario) return tl::unexpected(scenario.error());
  auto elements = campaign_elements(*campaign, scenario->epoch_utc_ns);
  if (!elements) return tl::unexpected(elements.error());
  return Loaded{std::move(*campaign), std::move(*elements)};
}

std::string condition_text(const CampaignElement& element) {
  std::string text;
  for (const auto& [key, value] : element.conditions) text += fmt::format("{}={}, ", key, value);
  return text + fmt::format("time_s={}", element.time_s);
}

/// One run of the command: it finds what is to do, has it done, and reports.
class Campaign {
 public:
  Campaign(const CampaignOptions& command, const Loaded& loaded, const ElementStore& store)
      : command_(command), campaign_(loaded.campaign), elements_(loaded.elements), store_(store) {}
  /// Errors: config (an element), those of the executor and of the files.
  [[nodiscard]] Result<void> run();
  [[nodiscard]] bool complete() const noexcept { return results_.missing.empty(); }

 private:
  [[nodiscard]] Result<void> check_elements();
  [[nodiscard]] std::vector<std::size_t> pending(bool with_final) const;
  [[nodiscard]] Result<void> execute();
  /// Says why an element has no result.
  [[nodiscard]] std::string reason_of(std::size_t element) const;
  void collect();
  [[nodiscard]] Result<void> report() const;

  const CampaignOptions& command_;
  const config::CampaignDesc& campaign_;
  const std::vector<CampaignElement>& elements_;
  const ElementStore& store_;
  std::vector<std::string> identities_;  ///< empty for an element whose files are missing here
  std::size_t resumed_ = 0;
  std::size_t tries_ = 0;
  CampaignResults results_;
};

/// Checks the scenario of every element, so that a wrong key does not show hours later.
Result<void> Campaign::check_elements() {
  Progress bar("elements checked", elements_.size());
  for (const CampaignElement& element : elements_) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
    const auto scenario = element_scenario(campaign_, element);
    if (!scenario) {
      return make_error(ErrorCode::config,
                        fmt::format("element {} ({}): {}", element.number, condition_text(element),
                                    scenario.error().text));
    }
    identities_.push_back(element_identity(campaign_, element).value_or(std::string()));
    bar.advance_to(element.number + 1);
  }
  return {};
}

/// Elements without result; with `with_final` those too that no further try would help.
std::vector<std::size_t> Campaign::pending(bool with_final) const {
  std::vector<std::size_t> out;
  for (const CampaignElement& element : elements_) {
    if (store_.row(element.number, identities_[element.number])) continue;
    const auto failure = store_.failure(element.number);
    if (!with_final && failure && failure->final) continue;
    out.push_back(element.number);
  }
  return out;
}

Result<void> Campaign::execute() {
  std::unique_ptr<Executor> executor;
  if (command_.slurm) {
    auto made = slurm_executor(campaign_, store_);
    if (!made) return tl::unexpected(made.error());
    executor = std::move(*made);
  } else {
    executor = local_executor(campaign_, store_, command_.jobs.value_or(campaign_.run.jobs));
  }
  std::vector<std::size_t> todo = pending(true);
  resumed_ = elements_.size() - todo.size();
  for (; !todo.empty() && tries_ <= campaign_.run.retries; ++tries_) {
    for (const std::size_t element : todo) store_.forget(element);
    Progress bar(tries_ == 0 ? "elements" : "elements tried again", todo.size());
    auto done = executor->run(todo, [&bar](std::size_t ended) { bar.advance_to(ended); });
    if (!done) return done;
    todo = pending(false);
  }
  return {};
}

std::string Campaign::reason_of(std::size_t element) const {
  if (const auto failure = store_.failure(element)) return failure->text;
  if (store_.has_row(element)) {
    return "its result is of other conditions or of another version of emit: a file of the "
           "campaign or the program was changed while it ran";
  }
  return fmt::format("it ended without a word, as a process does that is killed; see {}",
                     store_.log_file(element).string());
}

void Campaign::collect() {
  for (const auto& [key, value] : elements_.front().conditions) results_.keys.push_back(key);
  for (const CampaignElement& element : elements_) {
    if (auto row = store_.row(element.number, identities_[element.number])) {
      results_.rows.push_back(std::move(*row));
      continue;
    }
    results_.missing.push_back({element.number, reason_of(element.number)});
  }
}

Result<void> Campaign::report() const {
  const auto table = store_.folder() / "results.csv";
  const auto page = store_.folder() / "report.html";
  if (auto done = write_campaign_table(table, results_); !done) return done;
  if (auto done = write_campaign_html(page, campaign_, results_); !done) return done;
  std::FILE* out = text_stream(command_.json);
  fmt::print(out, "{} elements: {} done ({} of them before), {} without result, {} tries\n",
             elements_.size(), results_.rows.size(), resumed_, results_.missing.size(), tries_);
  for (const MissingElement& missing : results_.missing) {
    warn(fmt::format("element {} ({}): {}", missing.element,
                     condition_text(elements_[missing.element]), missing.reason));
  }
  fmt::print(out, "table: {}\nreport: {}\n", table.string(), page.string());
  if (!command_.json) return {};
  Json json = Json::object();
  json.set("campaign", campaign_.name).set("elements", elements_.size());
  json.set("done", results_.rows.size()).set("resumed", resumed_).set("tries", tries_);
  Json missing = Json::array();
  for (const MissingElement& each : results_.missing) {
    Json one = Json::object();
    one.set("element", each.element).set("reason", each.reason);
    missing.push(std::move(one));
  }
  json.set("missing", std::move(missing));
  json.set("table", table.string()).set("report", page.string());
  return write_json(*command_.json, json);
}

Result<void> Campaign::run() {
  if (auto checked = check_elements(); !checked) return checked;
  if (auto executed = execute(); !executed) return executed;
  collect();
  return report();
}

int run_one(const Loaded& loaded, const ElementStore& store, std::uint64_t element) {
  if (element >= loaded.elements.size()) {
    return fail(kExitUsage, fmt::format("--element {}: the campaign has elements 0 to {}", element,
                                        loaded.elements.size() - 1));
  }
  const auto done = store.run(loaded.campaign, loaded.elements[element]);
  return done ? kExitOk : fail(done.error());
}

int run(const CampaignOptions& command) {
  const auto loaded = load(command.file);
  if (!loaded) return fail_config(loaded.error());
  if (command.list) {
    for (const CampaignElement& element : loaded->elements) {
      fmt::print("{} {}\n", element.number, condition_text(element));
    }
    return kExitOk;
  }
  if (command.out.empty()) return fail(kExitUsage, "--out DIR is needed, or --list");
  const auto store = ElementStore::open(command.out);
  if (!store) return fail(store.error());
  const InterruptGuard interrupt;
  if (command.element) return run_one(*loaded, *store, *command.element);
  const auto claim = store->claim();
  if (!claim) return fail(claim.error());
  Campaign campaign(command, *loaded, *store);
  if (auto done = campaign.run(); !done) return fail(done.error());
  return campaign.complete() ? kExitOk : kExitFailure;
}

void add_options(CommandLine& line, CampaignOptions& options) {
  line.path("campaign", options.file, "Campaign file (.toml); config/README.md has its keys")
      .required();
  line.output_folder("--out", options.out,
                     "Folder for results.csv, report.html, and files and logs of the elements. "
                     "Elements that are done there already are not run again");
  line.flag("--slurm", options.slurm,
            "Run the elements as job arrays of Slurm; --out lies on a file system that all nodes "
            "share. Otherwise they run on local cores");
  line.option("--jobs", options.jobs, "Local: elements at a time, in place of run.jobs")
      .in_range(1U, 1024U)
      .type_name("N");
  line.flag("--list", options.list, "Print the elements and run nothing");
  line.option("--element", options.element,
              "Run this element alone in this process, as a job of the cluster does")
      .type_name("N");
  add_json(line, options.json);
}

}  // namespace

void add_campaign(CommandLine& tool) {
  tool.command<CampaignOptions>(
      {.name = "campaign",
       .text = "Run a scenario with many variations, locally or by Slurm, and report error and "
               "lateness by condition",
       .example = "emit campaign morning.toml --out runs --jobs 2"},
      add_options, run);
}

}  // namespace emit::tool
