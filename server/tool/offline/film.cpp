// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/film.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <system_error>
#include <vector>

#include "tool/support/interrupt.hpp"
#include "tool/support/output_check.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<void> Film::check(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  if (extension != ".webp" && extension != ".mp4") {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: a film ends with .webp or .mp4", file.string()));
  }
  if (!find_program("ffmpeg")) {
    return make_error(ErrorCode::not_found,
                      fmt::format("{}: the program ffmpeg, which encodes films, is not found "
                                  "(Debian: apt-get install ffmpeg)",
                                  file.string()));
  }
  return check_output_file(file);
}

Result<void> Film::begin() {
  const auto parent = file_.has_parent_path() ? file_.parent_path() : std::filesystem::path(".");
  return folder_.create(parent);
}

std::filesystem::path Film::next_picture() {
  return folder_.path() / fmt::format("{:06}.png", pictures_++);
}

Result<void> Film::finish() {
  const auto program = find_program("ffmpeg");
  if (!program) return make_error(ErrorCode::not_found, "ffmpeg is not found any more");
  const bool webp = file_.extension() == ".webp";
  const std::filesystem::path made = folder_.path() / (webp ? "film.webp" : "film.mp4");
  std::vector<std::string> call{program->string(),
                                "-nostdin",
                                "-v",
                                "error",
                                "-y",
                                "-framerate",
                                fmt::format("{}", rate_hz_),
                                "-i",
                                (folder_.path() / "%06d.png").string()};
  // WebP keeps every pixel. MP4 needs even numbers of pixels for players of all kinds.
  const std::vector<std::string> coding =
      webp ? std::vector<std::string>{"-c:v", "libwebp_anim", "-lossless", "1", "-loop", "0"}
           : std::vector<std::string>{"-vf",       "pad=ceil(iw/2)*2:ceil(ih/2)*2",
                                      "-c:v",      "libx264",
                                      "-crf",      "16",
                                      "-pix_fmt",  "yuv420p",
                                      "-movflags", "+faststart"};
  call.insert(call.end(), coding.begin(), coding.end());
  call.push_back(made.string());
  const auto log = folder_.path() / "ffmpeg.log";
  auto process = Subprocess::start(call, log);
  if (!process) return tl::unexpected(process.error());
  std::optional<int> status;
  while (!(status = process->wait(std::chrono::milliseconds(200)))) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
  }
  if (*status != 0) {
    std::ifstream text(log);
    const std::string said{std::istreambuf_iterator<char>(text), std::istreambuf_iterator<char>()};
    return make_error(ErrorCode::io, fmt::format("{}: ffmpeg ended with exit code {}: {}",
                                                 file_.string(), *status, said));
  }
  std::error_code error;
  std::filesystem::rename(made, file_, error);
  if (error) {
    return make_error(ErrorCode::io,
                      fmt::format("{}: cannot write: {}", file_.string(), error.message()));
  }
  return {};
}

}  // namespace emit::tool
