#include "emulator/seeds/seed_arrays.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>

#include "emulator/config/presets.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/record/row_truths.hpp"
#include "emulator/record/twin_rows.hpp"
#include "tests/emulator/run/realtime_test.hpp"

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

// Every product that the table or a description has, without errors, in a motion. The truth beside another row than
// its own would differ from it by a whole step of the motion.
class TruthBesideTest : public RealtimeTest {
 protected:
  using Values = std::array<double, 3>;

  Config ideal(const Protocol& protocol, double rate_hz) const {
    const bool is_can = protocol.link == Link::can;
    const bool has_rate = protocol.product || default_rate_hz(protocol, Settings(protocol.settings)) != 0;
    Config config = load_config(
        write("config.toml",
              fmt::format("clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"{}\"\n"
                          "model = \"ideal\"\nport = \"{}\"\ngyro.max_rad_per_s = 10\n"
                          "accelerometer.max_m_per_s2 = 100\n{}{}",
                          protocol.name, is_can ? "can:vcan0" : "pty:imu",
                          has_rate ? std::string() : fmt::format("rate_hz = {}\n", rate_hz),
                          protocol.name == "stim300"    ? "device.start_up = false\n"
                          : protocol.name == "canopen"  ? "device.self_start = true\n"
                          : protocol.name == "nos3-imu" ? "device.with_requests = true\n"
                                                        : "")));
    config.clock = ClockMode::fast;
    config.truth.port = "pcap:flight.pcap?port=9810";
    return config;
  }
  // Lines of 9600 baud carry 20 samples a second, and other products need more.
  Config with_a_rate(const Protocol& protocol) const {
    try {
      return ideal(protocol, 100);
    } catch (const ConfigError&) {
      return ideal(protocol, 20);
    }
  }
  // Runs two seconds of the motion.
  static std::string run(const Config& config, const Ports& ports, const std::function<void(std::size_t)>& awaits) {
    SimulatedHost host;
    host.end = SimulatedHost::never;
    for (int k = 0; k <= 200; ++k) {
      std::vector<std::byte> bytes(native_truth_size);
      encode_native_truth(Swing::truth(at_s(0.01 * k)), std::span<std::byte, native_truth_size>(bytes));
      host.arrivals.push_back({host.now() + nanoseconds(0.01 * k), std::move(bytes)});
    }
    Assembly assembly(config, [&](const PortUse& use) -> std::unique_ptr<Port> {
      if (use.of == PortUse::Of::truth) return std::make_unique<SimulatedTruth>(host, true, Nanoseconds{0});
      return ports(use);
    });
    assembly.run(host, host.stop, {.awaits_truth = awaits});
    commit(assembly.engine().channels());
    return {};
  }
  // Returns false if the product does not carry this vector. Values above `range` saturate.
  static bool compare(const std::vector<MeasurementRow>& rows, const std::vector<TrueRow>& truths,
                      Values MeasurementRow::*measured, Values TrueValues::*truth, double range) {
    double step = 0, error = 0;
    std::size_t carried = 0;
    Values last = truths[0].values.*truth;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (truths[i].time_ns - truths[0].time_ns < 150'000'000) continue;  // patterns of a start, which are no motion
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double value = (rows[i].*measured)[axis], right = (truths[i].values.*truth)[axis];
        EXPECT_TRUE(std::isnan(value) || !std::isnan(right) || carried == 0) << "row " << i << " has no truth";
        if (std::isnan(value) || std::isnan(right) || std::abs(right) > range) continue;
        ++carried;
        error = std::max(error, std::abs(value - right));
        if (!std::isnan(last[axis])) step = std::max(step, std::abs(right - last[axis]));
        last[axis] = right;
      }
    }
    EXPECT_TRUE(carried == 0 || error < step / 2) << error << " of a step of " << step;
    return carried > 0;
  }
};

TEST_F(TruthBesideTest, IsOfTheRowsOwnSampleForEveryProduct) {
  std::vector<const Protocol*> all(protocols().begin(), protocols().end());
  const std::vector<const Protocol*> described = described_protocols();
  all.insert(all.end(), described.begin(), described.end());
  std::size_t compared = 0;
  std::vector<std::string_view> without;
  for (const Protocol* protocol : all) {
    SCOPED_TRACE(protocol->name);
    if (protocol->name == "frame") continue;  // it needs a description
    const Config config = with_a_rate(*protocol);
    std::vector<MeasurementRow> rows;
    run(
        config,
        [&](const PortUse& use) -> std::unique_ptr<Port> {
          if (use.of != PortUse::Of::line || use.number > 0) return std::make_unique<NoPort>();
          return decoding_port(config.imus[0], [&](const Measurement& one) { rows.emplace_back(one); });
        },
        nullptr);
    const RunTruth truth = truth_of_run(config, run, [](std::size_t) { return true; });
    const std::vector<TrueRow>& truths = truth.imus[0].rows;
    ASSERT_EQ(truths.size(), rows.size());
    if (rows.empty()) {
      without.push_back(protocol->name);
      continue;
    }
    ASSERT_GE(rows.size(), 15U);
    const Protocol::Range& range = protocol->range;
    const bool carries[] = {compare(rows, truths, &MeasurementRow::gyro, &TrueValues::gyro, range.rate),
                            compare(rows, truths, &MeasurementRow::accel, &TrueValues::accel, range.specific_force),
                            compare(rows, truths, &MeasurementRow::dtheta, &TrueValues::dtheta, range.delta_angle),
                            compare(rows, truths, &MeasurementRow::dvel, &TrueValues::dvel, range.delta_velocity)};
    std::ranges::count(carries, true) > 0 ? void(++compared) : without.push_back(protocol->name);

    RowTruths by_rows(truth.imus[0].samples, std::move(made_rows(config, run)[0]));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const TrueRow same = by_rows.of(rows[i]);
      EXPECT_EQ(same.time_ns, truths[i].time_ns) << i;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double a = same.values.dtheta[axis], b = truths[i].values.dtheta[axis];
        EXPECT_TRUE(std::isnan(a) ? std::isnan(b) : std::abs(a - b) < 1e-12) << i << ": " << a << ", " << b;
      }
    }
  }
  EXPECT_EQ(without, (std::vector<std::string_view>{"nmea-attitude", "nmea", "tss1"}));  // no vector
  EXPECT_EQ(compared, all.size() - 4);
}

}  // namespace
}  // namespace imud
