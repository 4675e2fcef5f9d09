// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <list>
#include <thread>
#include <utility>

#include "tool/campaign/executor.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

class LocalExecutor final : public Executor {
 public:
  LocalExecutor(const config::CampaignDesc& campaign, const ElementStore& store, std::uint32_t jobs)
      : campaign_(campaign), store_(store), jobs_(jobs) {}

  Result<void> run(std::span<const std::size_t> elements,
                   const std::function<void(std::size_t ended)>& ended) override {
    auto command = element_command(campaign_, store_);
    if (!command) return tl::unexpected(command.error());
    std::list<Running> running;
    std::size_t next = 0;
    while (next < elements.size() || !running.empty()) {
      if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
      while (next < elements.size() && running.size() < jobs_) {
        std::vector<std::string> call = *command;
        call.push_back(std::to_string(elements[next]));
        auto process = Subprocess::start(call, store_.log_file(elements[next]));
        if (!process) return tl::unexpected(process.error());
        running.push_back({std::move(*process), Clock::now()});
        ++next;
      }
      constexpr auto kPoll = std::chrono::milliseconds(20);
      std::this_thread::sleep_for(kPoll);
      const std::chrono::duration<double, std::ratio<60>> limit(campaign_.run.timeout_min);
      std::erase_if(running, [&](Running& each) {
        if (each.process.poll()) return true;
        if (Clock::now() - each.start > limit) each.process.send_signal(SIGKILL);
        return false;
      });
      ended(next - running.size());
    }
    return {};
  }

 private:
  struct Running {
    Subprocess process;
    Clock::time_point start;
  };
  const config::CampaignDesc& campaign_;
  const ElementStore& store_;
  std::uint32_t jobs_;
};

}  // namespace

Result<std::vector<std::string>> element_command(const config::CampaignDesc& campaign,
                                                 const ElementStore& store) {
  const auto bin = executable_dir();
  if (!bin) return tl::unexpected(bin.error());
  return std::vector<std::string>{(*bin / "emit").string(), "campaign",
                                  campaign.file.string(),   "--out",
                                  store.folder().string(),  "--element"};
}

std::unique_ptr<Executor> local_executor(const config::CampaignDesc& campaign,
                                         const ElementStore& store, std::uint32_t jobs) {
  return std::make_unique<LocalExecutor>(campaign, store, jobs);
}

}  // namespace emit::tool
