// SPDX-License-Identifier: Apache-2.0
#include "tool/support/replacing_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace emit::tool {

physics::Result<ReplacingFile> ReplacingFile::create(const std::filesystem::path& target) {
  ReplacingFile out(target);
  if (target == "-") {
    out.file_ = stdout;
    return out;
  }
  std::error_code none;
  const std::filesystem::file_status status = std::filesystem::status(target, none);
  std::filesystem::path written = target;
  if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status)) {
    auto part = protocol::PartFile::begin(target, {});
    if (!part) return tl::unexpected<physics::Error>(std::move(part.error()));
    written = part->path();
    out.part_.emplace(std::move(*part));
  }
  out.file_ = std::fopen(written.c_str(), "wb");
  if (out.file_ == nullptr) return out.failure(errno);
  return out;
}

ReplacingFile::ReplacingFile(ReplacingFile&& other) noexcept
    : target_(std::move(other.target_)),
      part_(std::move(other.part_)),
      file_(std::exchange(other.file_, nullptr)) {
  other.part_.reset();
}

ReplacingFile::~ReplacingFile() {
  if (file_ != nullptr && file_ != stdout) std::fclose(file_);
}

tl::unexpected<physics::Error> ReplacingFile::failure(int error_number) const {
  return physics::make_error(physics::ErrorCode::io,
                             fmt::format("{}: cannot write: {}", target_.string(),
                                         std::generic_category().message(error_number)));
}

physics::Result<void> ReplacingFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) return failure(errno);
  return {};
}

physics::Result<void> ReplacingFile::commit() {
  if (std::fflush(file_) != 0) return failure(errno);
  std::FILE* const file = std::exchange(file_, nullptr);
  if (file != stdout && std::fclose(file) != 0) return failure(errno);
  if (part_) return part_->commit();
  return {};
}

}  // namespace emit::tool
