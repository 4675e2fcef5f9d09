// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/film.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <system_error>
#include <vector>

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
  if (auto done = run_program(call, folder_.path() / "ffmpeg.log"); !done) {
    return tl::unexpected(std::move(done.error()).with_context(file_.string()));
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
