#include "emulator/seeds/seed_arrays.hpp"

#include <sys/resource.h>

#include <csignal>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

class SeedArraysTest : public RunTest {
 protected:
  static constexpr int samples = 2000;

  // Sends the samples of a device to its port.
  static void send_samples(const ImuConfig& imu, Port& port) {
    const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
    FrameBuffer frames;
    for (int i = 0; i < samples; ++i) {
      frames.clear();
      Sample sample;
      sample.time = DeviceTime{i * 1'000'000};
      sample.counter = static_cast<std::uint64_t>(i);
      device->sample(sample, frames);
      port.send(frames.frames());
    }
    port.commit();
  }
  static std::string run_once(const Config& config, const Ports& ports, const std::function<void(std::size_t imu)>&) {
    for (std::size_t i = 0; i < config.imus.size(); ++i)
      send_samples(config.imus[i], *ports({.of = PortUse::Of::line, .imu = i}));
    return {};
  }
  static SeedArrays::Seeds three() { return {.first = 0, .count = 3, .origin = {}}; }
  // Returns the message of what `action` throws while no file may have more than `bytes`.
  template <class Action>
  static std::string error_with_limit(std::uint64_t bytes, const Action& action) {
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    const rlimit limit{bytes, before.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    std::string message;
    try {
      action();
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    ::setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    return message;
  }

  const Config config_ = load_config(config("fast", "file:truth.csv", "csv", 1000, "native", "file:out"));
};

// A limit of the files' size is as a full disk: an error once the run has ended, and nothing within it.
TEST_F(SeedArraysTest, AFullDiskIsAnErrorOfTheRun) {
  for (const std::uint64_t bytes :
       {0U, 100'000U, 208'000U}) {  // nothing fits; some of the truth; all but the last rows
    SeedArrays arrays(config_, path("a.npy"));
    EXPECT_EQ(error_with_limit(bytes, [&] { arrays.begin(config_, three(), run_once); }),
              path("a_truth.npy") + ": File too large");
  }
  EXPECT_EQ(error_with_limit(500'000, [&] { SeedArrays(config_, path("a.npy")).begin(config_, three(), run_once); }),
            path("a.npy") + ": File too large");

  SeedArrays arrays(config_, path("a.npy"));
  arrays.begin(config_, three(), run_once);
  const auto run_of = [&](std::uint64_t seed) {
    SeedArrays::Rows rows(arrays, 0, seed);
    send_samples(config_.imus[0], *rows.port());
    EXPECT_EQ(rows.finish(), "");
  };
  run_of(0);
  EXPECT_EQ(error_with_limit(500'000, [&] { run_of(1); }), path("a.npy") + ": File too large");
  EXPECT_THROW(run_of(2), std::runtime_error) << "an array that lacks rows is never whole";
}

}  // namespace
}  // namespace imud
