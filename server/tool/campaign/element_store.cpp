// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/element_store.hpp"

#include <fmt/format.h>
#include <sys/file.h>

#include <fcntl.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "tool/campaign/element_run.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/work_folder.hpp"

namespace emit::tool {
namespace {

constexpr std::string_view kFinal = "config: ";

}  // namespace

physics::Result<ElementStore> ElementStore::open(const std::filesystem::path& folder) {
  std::error_code ignored;
  ElementStore store(std::filesystem::absolute(folder, ignored).lexically_normal());
  for (const char* below : {"elements", "logs"}) {
    if (auto made = make_directory(store.folder_ / below); !made) {
      return tl::unexpected(made.error());
    }
  }
  return store;
}

physics::Result<server::Fd> ElementStore::claim() const {
  const auto file = folder_ / "campaign.lock";
  const auto failure = [&file](const std::string& what) {
    return physics::make_error(physics::ErrorCode::io, fmt::format("{}: {}", file.string(), what));
  };
  server::Fd lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!lock) return failure(std::generic_category().message(errno));
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) == 0) return lock;
  if (errno != EWOULDBLOCK) return failure(std::generic_category().message(errno));
  return failure("another campaign runs in this folder: wait for it, or take another --out");
}

std::filesystem::path ElementStore::file(std::size_t element, const char* extension) const {
  return folder_ / "elements" / fmt::format("{:06}{}", element, extension);
}

std::filesystem::path ElementStore::log_file(std::size_t element) const {
  return folder_ / "logs" / fmt::format("{:06}.log", element);
}

physics::Result<void> ElementStore::run(const config::CampaignDesc& campaign,
                                        const CampaignElement& element) const {
  WorkFolder work(false);
  if (auto made = work.create(folder_); !made) return made;
  const auto once = [&]() -> physics::Result<void> {
    const auto identity = element_identity(campaign, element);
    if (!identity) return tl::unexpected(identity.error());
    const auto row = run_element(campaign, element, work.path());
    if (!row) return tl::unexpected(row.error());
    return write_result_row(file(element.number, ".csv"), *identity, *row);
  };
  auto done = once();
  if (done) return done;
  const bool final = done.error().code == physics::ErrorCode::config;
  if (auto note = ReplacingFile::create(file(element.number, ".error")); note) {
    if (note->write(fmt::format("{}{}\n", final ? kFinal : "", done.error().text))) {
      (void)note->commit();
    }
  }
  return done;
}

std::optional<ResultRow> ElementStore::row(std::size_t element, const std::string& identity) const {
  return read_result_row(file(element, ".csv"), identity);
}

std::optional<ElementStore::Failure> ElementStore::failure(std::size_t element) const {
  std::ifstream in(file(element, ".error"));
  if (!in) return std::nullopt;
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  while (text.ends_with('\n')) text.pop_back();
  const bool final = text.starts_with(kFinal);
  return Failure{final, final ? text.substr(kFinal.size()) : text};
}

bool ElementStore::has_row(std::size_t element) const {
  std::error_code ignored;
  return std::filesystem::exists(file(element, ".csv"), ignored);
}

void ElementStore::forget(std::size_t element) const {
  std::error_code ignored;
  std::filesystem::remove(file(element, ".error"), ignored);
  std::filesystem::remove(file(element, ".csv"), ignored);
}

}  // namespace emit::tool
