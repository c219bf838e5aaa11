// imud run with the grids of samples on a clock of the host. The instants are read from the records, so that a loaded
// machine, which delays frames, does not matter.
#include <array>
#include <chrono>
#include <cmath>

#include "emulator/report/clock_watch.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

class EpochRunTest : public RunTest {
 protected:
  // A sensor at rest, which needs no truth.
  std::string at_rest(const std::string& name, const std::string& epoch, double rate_hz = 333.3) const {
    return write(
        name + ".toml",
        fmt::format(
            "truth.port = \"udp:127.0.0.1:0\"\n[realtime]\nepoch = \"{}\"\npriority = 0\nlock_memory = false\n"
            "[[imu]]\nname = \"imu1\"\nrate_hz = {}\nphase_us = 250\nprotocol = \"native\"\n"
            "port = \"file:{}\"\nbefore_first = \"rest\"\ngyro.max_rad_per_s = 100\n"
            "accelerometer.max_m_per_s2 = 1000\n",
            epoch, rate_hz, path(name + ".bin")));
  }
  // Waits until the run has sent 8 kB of frames, more than 60, beside the first `size` bytes. False if it has ended.
  bool sends(Program& imud, const std::string& name, std::uintmax_t size = 0) const {
    EXPECT_TRUE(eventually([&] {
      std::error_code none;
      const std::uintmax_t now = std::filesystem::file_size(path(name + ".bin"), none);
      return (!none && now > size + 8192) || !imud.is_running();
    }));
    EXPECT_TRUE(imud.is_running()) << imud.errors();
    return imud.is_running();
  }
  // Returns the host times, ns, at which the samples of the recorded run were due.
  std::vector<std::int64_t> instants(const std::string& name) const {
    PcapngReader reader(PortSpec::parse("record:" + path(name + ".pcapng")));
    std::vector<std::int64_t> all;
    while (const auto packet = reader.next()) {
      if (reader.interfaces()[packet->interface].link_type != link_type::event) continue;
      const auto event = decode_record_event(packet->bytes);
      if (event && event->type == RecordEvent::Type::transmit) all.push_back(event->a);
    }
    return all;
  }
  nlohmann::json summary_of(const std::string& name) const {
    return nlohmann::json::parse(read_file(path(name + ".json")));
  }
};

// The second process starts when the first has sent samples, so that it begins at a later whole second.
TEST_F(EpochRunTest, ProcessesOfAHostSampleAtTheSameInstants) {
  const std::array<std::string, 2> names = {"first", "second"};
  std::array<Program, 2> imuds = {Program("imud"), Program("imud")};
  for (std::size_t i = 0; i < 2; ++i) {
    imuds[i].start({"run", at_rest(names[i], "monotonic"), "--record", path(names[i] + ".pcapng"), "--summary",
                    path(names[i] + ".json")});
    ASSERT_TRUE(sends(imuds[i], names[i]));
  }
  std::array<std::uint64_t, 2> first{};
  for (std::size_t i = 0; i < 2; ++i) {
    ASSERT_EQ(imuds[i].stop(), 0) << imuds[i].errors();
    const auto summary = summary_of(names[i]);
    EXPECT_EQ(summary["clock"]["epoch"], "monotonic");
    EXPECT_EQ(summary["clock"]["steps"], 0);
    first[i] = summary["imus"][0]["first_k"].get<std::uint64_t>();
    const std::vector<std::int64_t> all = instants(names[i]);
    ASSERT_GT(all.size(), 50U);
    EXPECT_GE(all.size(), summary["imus"][0]["samples"].get<std::size_t>());
    const Grid grid(333.3, 0, std::chrono::microseconds(250));
    for (std::size_t k = 0; k < all.size(); ++k)
      ASSERT_EQ(all[k], grid.nominal_offset(first[i] + k).count()) << names[i] << ' ' << k;
    // The first sample is due within a period after a whole second and the phase.
    EXPECT_LE((all[0] - 250'000) % 1'000'000'000, grid.period().count());
  }
  EXPECT_GE(first[1], first[0] + 333);
}

// The sample that was due when the configuration was read again leaves at its instant. The next is on the new grid.
TEST_F(EpochRunTest, AReloadedRateIsOnTheClock) {
  Program imud("imud");
  imud.start({"run", at_rest("one", "monotonic"), "--record", path("one.pcapng")});
  ASSERT_TRUE(sends(imud, "one"));
  at_rest("one", "monotonic", 200);
  imud.kill(SIGHUP);
  ASSERT_TRUE(imud.wait_for_errors("imu1 from sample")) << imud.errors();
  const std::uintmax_t size = std::filesystem::file_size(path("one.bin"));
  ASSERT_TRUE(sends(imud, "one", size));
  ASSERT_EQ(imud.stop(), 0) << imud.errors();
  const std::vector<std::int64_t> all = instants("one");
  const auto is_on = [](std::int64_t ns, double rate_hz) {
    const Grid grid(rate_hz, 0, std::chrono::microseconds(250));
    const double K = std::round(1e-9 * static_cast<double>(ns - 250'000) * rate_hz);
    return ns == grid.nominal_offset(static_cast<std::uint64_t>(K)).count();
  };
  EXPECT_TRUE(is_on(all.front(), 333.3));
  std::size_t last = all.size();  // instants on the new grid, from the end
  while (last > 0 && is_on(all[last - 1], 200)) --last;
  EXPECT_GT(all.size() - last, 50U);
  for (std::size_t k = 0; k < last; ++k) EXPECT_TRUE(is_on(all[k], 333.3)) << k << " of " << last;
}

TEST_F(EpochRunTest, AClockThatIsNotSynchronisedIsRefusedUnlessItIsAllowed) {
  RealtimeConfig realtime;
  realtime.epoch = Epoch::utc;
  const bool is_refused = !epoch_fault(realtime, read_clock_state()).empty();
  // A clock that is not synchronised is not for 4 s, of which a busy machine may miss the first.
  const std::string limit =
      fmt::format("clock.unsynchronised_s{}", read_clock_state().is_synchronised ? "=0" : ">=3");
  const std::vector<std::string> run = {"run",       at_rest("utc", "utc"), "--for",     "4",
                                        "--summary", path("utc.json"),      "--require", limit};
  if (is_refused) {
    const ProgramResult refused = run_program("imud", run);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_TRUE(contains(refused.errors, "realtime.epoch = \"utc\": ")) << refused.errors;
    EXPECT_TRUE(contains(refused.errors, "realtime.allow_unsynchronised = true")) << refused.errors;
  }
  std::vector<std::string> allowed = run;
  allowed.insert(allowed.end(), {"--set", "realtime.allow_unsynchronised=true"});
  const ProgramResult result = run_program("imud", allowed);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "clock    utc, clock ")) << result.output;
  const auto summary = summary_of("utc");
  EXPECT_EQ(summary["clock"]["synchronised"], read_clock_state().is_synchronised);
  // K is the number of periods since 1970.
  const double since_1970_s =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  EXPECT_NEAR(summary["imus"][0]["first_k"].get<double>() / 333.3, since_1970_s, 3600);
}

}  // namespace
}  // namespace imud
