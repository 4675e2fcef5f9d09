// SPDX-License-Identifier: Apache-2.0
#include "tool/support/replacing_file.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace emit::tool {

physics::Result<ReplacingFile> ReplacingFile::create(const std::filesystem::path& target) {
  if (target == "-") return ReplacingFile(target, {}, stdout);
  std::error_code error;
  // A link stays one: the file that it leads to is replaced.
  std::filesystem::path file = std::filesystem::canonical(target, error);
  if (error) file = target;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  std::filesystem::path written;
  if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status)) {
    written = file;
    written += fmt::format(".{}.part", ::getpid());
  }
  std::FILE* stream = std::fopen((written.empty() ? file : written).c_str(), "wb");
  ReplacingFile out(file, written, stream);
  if (stream == nullptr) return out.failure(errno);
  return out;
}

ReplacingFile::ReplacingFile(ReplacingFile&& other) noexcept
    : target_(std::move(other.target_)),
      written_(std::move(other.written_)),
      file_(std::exchange(other.file_, nullptr)) {}

ReplacingFile::~ReplacingFile() {
  if (file_ == nullptr) return;
  if (file_ != stdout) std::fclose(file_);
  std::error_code ignored;
  if (!written_.empty()) std::filesystem::remove(written_, ignored);
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
  std::error_code error;
  if (file != stdout && std::fclose(file) != 0) {
    error = std::error_code(errno, std::generic_category());
  }
  if (!written_.empty() && !error) std::filesystem::rename(written_, target_, error);
  if (!error) return {};
  std::error_code ignored;
  if (!written_.empty()) std::filesystem::remove(written_, ignored);
  return failure(error.value());
}

}  // namespace emit::tool
