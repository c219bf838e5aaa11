// imu-decode --find-check prints a description that is read at once, and that decodes the capture.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/text.hpp"
#include "tests/tools/find/find_unit.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

std::string raw(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void keep(const std::string& path, std::string_view bytes) { std::ofstream(path, std::ios::binary) << bytes; }

TEST(FindCheck, PrintsADescriptionThatDecodesTheCapture) {
  const ScratchFolder folder;
  for (const std::string_view shipped : captured_descriptions) {
    SCOPED_TRACE(shipped);
    keep(folder / "rest.bin", raw(shipped_capture(shipped, Handling::rest, 400).bytes));
    const auto found = run_program("imu-decode", {"--find-check", folder / "rest.bin", "--rate-hz", "100"});
    ASSERT_EQ(found.exit_code, 0) << found.errors;
    keep(folder / "mine.toml", found.output);
    const auto decoded = run_program(
        "imu-decode", {"frame", "file:" + (folder / "rest.bin"), "--frame-file", folder / "mine.toml", "--quiet"});
    EXPECT_TRUE(contains(decoded.errors, "checksum   0 failures, 0 malformed, 0 incomplete, 0 bytes skipped\n"))
        << decoded.errors << found.output;
    const bool has_counter = contains(found.output, "\"alive_counter") || contains(found.output, "\"time_");
    EXPECT_EQ(contains(decoded.errors, "samples    40"), has_counter) << decoded.errors << found.output;
  }
}

TEST(FindCheck, SaysThatNothingWasFound) {
  std::mt19937_64 random(1);
  const auto none = run_program("imu-decode", {"--find-check", "-"}, raw(random_bytes(50'000, random)));
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_EQ(none.output, "");
  EXPECT_TRUE(contains(none.errors, "no frame repeats in 50000 bytes")) << none.errors;
}

TEST(FindCheck, RefusesWrongCommandLines) {
  const auto both = run_program("imu-decode", {"--find-check", "x.bin", "native", "file:x.bin"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_TRUE(contains(both.errors, "PROTOCOL")) << both.errors;
  const ScratchFolder folder;
  const std::vector<std::string> of_decoding[] = {{"--npy", folder / "x.npy"},
                                                  {"--json", folder / "x.json"},
                                                  {"--require", "samples=1"},
                                                  {"--config", "x.toml"},
                                                  {"--set", "a=b"},
                                                  {"--frame-file", "um7"},
                                                  {"--truth", "x.rec"},
                                                  {"--imu", "x"},
                                                  {"--count", "1"},
                                                  {"--ready-fd", "3"},
                                                  {"--quiet"},
                                                  {"--fields"}};
  keep(folder / "rest.bin", raw(shipped_capture("um7", Handling::rest, 400).bytes));
  for (const auto& more : of_decoding) {
    std::vector<std::string> arguments = {"--find-check", folder / "rest.bin"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto refused = run_program("imu-decode", arguments);
    EXPECT_EQ(refused.exit_code, 2) << more.front();
    EXPECT_TRUE(contains(refused.errors, "--find-check excludes " + more.front())) << refused.errors;
  }
  EXPECT_EQ(run_program("imu-decode", {"--find-check", "can:vcan0"}).exit_code, 2);
  EXPECT_EQ(run_program("imu-decode", {"--find-check", "/no/such/file"}).exit_code, 2);
  const auto none = run_program("imu-decode", {"native"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_TRUE(contains(none.errors, "PORT is required")) << none.errors;
}

}  // namespace
}  // namespace imud
