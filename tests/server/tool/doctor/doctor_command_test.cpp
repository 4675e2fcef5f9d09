// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

/// Runs `emit doctor` where the named library cannot be opened.
ProcessResult run_doctor_without(const std::string& library) {
  const TemporaryFolder folder;
  // The loader finds this file first and refuses it.
  write_text(folder.file(library), "no library");
  return run_process({"/usr/bin/env", "LD_LIBRARY_PATH=" + folder.path().string(),
                      EMIT_TEST_BIN_DIR "/emit", "doctor"});
}

TEST(DoctorCommand, FailsWithItsNameWhereEglIsMissing) {
  const ProcessResult result = run_doctor_without("libEGL.so.1");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.out, HasSubstr("fail  device.gpu_index 0"));
  EXPECT_THAT(result.out, HasSubstr("libEGL.so.1"));
  EXPECT_THAT(result.out, HasSubstr("pass, ")) << "the other findings follow";
}

TEST(DoctorCommand, RenderNamesTheMissingLibraryToo) {
  const TemporaryFolder folder;
  write_text(folder.file("libEGL.so.1"), "no library");
  const ProcessResult result = run_process(
      {"/usr/bin/env", "LD_LIBRARY_PATH=" + folder.path().string(), EMIT_TEST_BIN_DIR "/emit",
       "render", "box", "--time-s", "0", "--out", folder.file("box.exr")});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("libEGL.so.1"));
}

}  // namespace
}  // namespace emit::test
