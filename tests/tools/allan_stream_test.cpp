// Long recordings: imu-allan keeps them in temporary files, with the deviations of the whole phase in memory.
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "tests/support/environment.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "tools/allan/allan_curve.hpp"

namespace imud {
namespace {

// White noise, a random walk and a mean that is large beside them.
std::vector<double> long_rates(std::size_t count) {
  std::mt19937_64 random(1);
  std::vector<double> rates(count);
  double walk = 0;
  for (double& rate : rates) {
    const double white = static_cast<double>(random()) * 0x1p-64 - 0.5;
    walk += 1e-3 * white;
    rate = 9.8 + white + walk;
  }
  return rates;
}

TEST(AllanStream, AFileHasTheDeviationsOfMemory) {
  const auto rates = long_rates(SampleStore::most_in_memory + 70'001);
  const auto stored = [&] {
    SampleStore made;
    for (const double rate : rates) made.push_back(rate);
    made.finish();
    return made;
  };
  SampleStore store = stored();
  ASSERT_TRUE(store.is_in_file());
  ASSERT_TRUE(std::ranges::equal(store, rates));
  ASSERT_TRUE(std::ranges::equal(phase_of(stored()), phase_of(rates)));
  for (const AllanKind kind : allan_kinds)
    for (const unsigned per_decade : {0U, 7U}) {
      const auto streamed = allan_curve(kind, stored(), 400, per_decade, 0.68);
      ASSERT_GT(streamed.points.size(), 15U);
      const auto direct = allan_curve(kind, rates, 400, per_decade, 0.68);
      for (std::size_t i = 0; i < streamed.points.size(); ++i) {
        EXPECT_EQ(streamed.points[i].deviation, direct.points[i].deviation) << name_of(kind) << ' ' << i;
        EXPECT_EQ(streamed.points[i].noise, direct.points[i].noise) << name_of(kind) << ' ' << i;
      }
    }
  store.scale(2);
  EXPECT_EQ(store[store.size() - 1], 2 * rates.back());
}

// Writes an array of six columns, and returns its path.
std::string long_array(const ScratchFolder& folder, std::size_t rows) {
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (" + std::to_string(rows) + ", 6), }";
  header += std::string((64 - (10 + header.size() + 1) % 64) % 64, ' ') + "\n";
  const std::string path = folder / "long.npy";
  std::ofstream file(path, std::ios::binary);
  file << std::string("\x93NUMPY\x01\x00", 8) << static_cast<char>(header.size()) << '\0' << header;
  const auto rates = long_rates(rows);
  std::array<double, 6> row{};
  for (const double rate : rates) {
    row.fill(rate);
    file.write(reinterpret_cast<const char*>(row.data()), sizeof row);
  }
  return path;
}

// AddressSanitizer needs memory of its own. It keeps what is freed: here 1 MB of it instead of 256.
#if defined(__SANITIZE_ADDRESS__)
constexpr long most_mb = 200;
#elif defined(__has_feature)
constexpr long most_mb = __has_feature(address_sanitizer) ? 200 : 90;
#else
constexpr long most_mb = 90;
#endif

// The largest resident memory of a run of imu-allan, in MB, which exits with 0. rusage would have the memory of this
// program before exec, too.
long memory_of_a_run(std::vector<std::string> arguments) {
  const std::string program = std::string(IMUD_BIN_DIR) + "/imu-allan";
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  pid_t child = 0;
  if (::posix_spawn(&child, program.c_str(), nullptr, nullptr, words.data(), environ) != 0) return -1;
  int status = -1;
  long largest_kb = 0;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    std::ifstream file("/proc/" + std::to_string(child) + "/status");
    for (std::string word; file >> word;)
      if (long kb = 0; word == "VmHWM:" && file >> kb) largest_kb = kb;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(status, 0);
  EXPECT_GT(largest_kb, 0);
  return largest_kb / 1024;
}

// 2 million samples of six channels are 96 MB. A recording of any length takes no more memory than this.
TEST(AllanStream, ALongRecordingTakesLittleMemory) {
  const ScratchFolder folder;
  const std::string path = long_array(folder, 2'000'000);
  const char* const options = ::getenv("ASAN_OPTIONS");
  const SetVariable few("ASAN_OPTIONS",
                        (options != nullptr ? std::string(options) + ":" : "") + "quarantine_size_mb=1");
  const SetVariable scratch("TMPDIR", folder / "");
  EXPECT_LT(memory_of_a_run({"npy", path, "--rate-hz", "400", "--json", folder / "long.json"}), most_mb);
  const auto json = nlohmann::json::parse(read_file(folder / "long.json"));
  EXPECT_EQ(json["samples"], 2'000'000);
  EXPECT_EQ(json["axes"]["gyro_x"]["adev"], json["axes"]["accel_z"]["adev"]);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / ""), {}), 2);

  const auto named = run_program("imu-allan", {"npy", path, "--rate-hz", "400"});
  EXPECT_TRUE(contains(named.errors, "imu-allan: 96 MB of samples are in temporary files in " + (folder / "")))
      << named.errors;
  const SetVariable absent("TMPDIR", folder / "absent");
  const auto refused = run_program("imu-allan", {"npy", path, "--rate-hz", "400"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_TRUE(contains(refused.errors, "right would be another folder in TMPDIR")) << refused.errors;
}

}  // namespace
}  // namespace imud
