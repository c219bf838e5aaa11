// The filters that a product's settings choose, seen in its own bytes: gain, phase and delay of a motion that a unit
// measures, also after its host has chosen others.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/imu/channel.hpp"
#include "tests/emulator/serve.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/frequency_response.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using Complex = std::complex<double>;

// A port whose other end is the test.
class HostPort final : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) {
      sent.insert(sent.end(), frame.bytes.begin(), frame.bytes.end());
      headers.emplace_back(frame.can, frame.bytes.size());
    }
    counters_.sent += frames.size();
  }
  std::optional<Received> receive() noexcept override {
    if (commands.empty()) return std::nullopt;
    bytes_ = std::exchange(commands, {});
    return Received{.frame = {std::as_bytes(std::span(bytes_))}, .time = {}};
  }

  std::vector<std::byte> sent;
  std::vector<std::pair<CanHeader, std::size_t>> headers;  // of the frames in `sent`, with their lengths
  std::string commands;

 private:
  std::string bytes_;
};

// A unit that turns about x with a rate, rad/s, that is a function of the time, and has as many m/s^2 along y.
class TurningUnit {
 public:
  TurningUnit(const std::string& protocol, const std::vector<std::string>& assignments) {
    const std::string path = folder_ / "config.toml";
    std::ofstream(path) << "clock = \"lockstep\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \""
                        << protocol << "\"\nport = \""
                        << (find_protocol(protocol)->link == Link::can ? "can:vcan0" : "pty:imu1")
                        << "\"\nmodel = \"ideal\"\n";
    std::vector<std::string> all;
    for (const std::string& assignment : assignments) all.push_back("imu.0." + assignment);
    config_ = load_config(path, all).imus.at(0);
    decoder_ = config_.protocol->make_decoder(config_.settings);
    channel_.emplace(config_, 0, 1, [this](const PortUse&) {
      auto port = std::make_unique<HostPort>();
      port_ = port.get();
      return port;
    });
    channel_->power_on({});
    channel_->sensor.clock().start_samples();
  }

  const ImuModel& model() const { return config_.model; }
  void command(const std::string& text) {
    port_->commands = text;
    serve(*channel_, {});
  }
  // Returns what the unit sends of a run of that many samples.
  std::vector<Measurement> run(const std::function<double(double)>& rate, std::int64_t samples) {
    Timeline timeline;
    channel_->begin_run(TruthTime{});
    for (std::int64_t k = 0; k < samples; ++k) {
      Truth truth;
      truth.time = TruthTime{} + Nanoseconds(static_cast<std::int64_t>(1e9 / config_.rate_hz) * k);
      truth.omega_BN_B = {rate(static_cast<double>(k) / config_.rate_hz), 0, 0};
      truth.specific_force_B = {0, truth.omega_BN_B.x(), 0};
      truth.has_specific_force = true;
      timeline.push(truth);
      channel_->sensor.sense(timeline, truth.time, k_++);
      channel_->prepare(std::nullopt, false);
      channel_->encode(channel_->prepared);
      channel_->transmit();
    }
    Recording recording;
    if (config_.protocol->link == Link::can) {
      std::span<const std::byte> rest = port_->sent;
      for (const auto& [header, size] : port_->headers) {
        decoder_->feed({rest.first(size), header}, recording);
        rest = rest.subspan(size);
      }
    } else {
      decoder_->feed({port_->sent}, recording);
    }
    port_->sent.clear();
    port_->headers.clear();
    return recording.measurements;
  }

 private:
  ScratchFolder folder_;
  ImuConfig config_;
  std::unique_ptr<Decoder> decoder_;
  std::optional<Channel> channel_;
  HostPort* port_ = nullptr;
  std::uint64_t k_ = 0;
};

// Returns the gain and the phase, as a complex number, of rate, specific force, and inclinometers if there are any,
// at a frequency that divides the sample rate `rate_hz`, from the last second of two.
std::array<Complex, 3> response(TurningUnit& unit, int rate_hz, int hz) {
  const auto sine = [&](double t) { return std::sin(2 * M_PI * hz * t); };
  const std::vector<Measurement> all = unit.run(sine, 2 * rate_hz);
  EXPECT_EQ(all.size(), 2 * static_cast<std::size_t>(rate_hz));
  std::array<Complex, 3> sum = {};
  for (std::size_t k = static_cast<std::size_t>(rate_hz); k < all.size(); ++k) {
    const double phase = 2 * M_PI * hz * static_cast<double>(k) / rate_hz;
    sum[0] += Complex(0, 2.0 / rate_hz) * std::polar(1.0, -phase) * all[k].sample.rate.x();
    sum[1] += Complex(0, 2.0 / rate_hz) * std::polar(1.0, -phase) * all[k].sample.specific_force.y();
    const Vector3 inclination = all[k].sample.inclination.value_or(Vector3::Zero());
    sum[2] += Complex(0, 2.0 / rate_hz) * std::polar(1.0, -phase) * inclination.y();
  }
  return sum;
}

// Returns by how much a ramp of the rate is late, s.
double delay(TurningUnit& unit, int rate_hz) {
  const std::vector<Measurement> all = unit.run([](double t) { return t; }, rate_hz);
  return (rate_hz - 1.0) / rate_hz - all.back().sample.rate.x();
}

constexpr const char* stim300_at_2000_hz[] = {"device.start_up=false", "device.sample_rate=2000",
                                              "device.bit_rate=1843200", "device.temperature=false"};

TurningUnit stim300(bool filters) {
  std::vector<std::string> assignments(std::begin(stim300_at_2000_hz), std::end(stim300_at_2000_hz));
  if (filters) assignments.emplace_back("device_filters=true");
  return {"stim300", assignments};
}

SensorFilter low_pass(double hz) { return {.cut_off_hz = Vector3::Constant(hz)}; }

// The LSB of the rate is 1.1e-6 rad/s, that of the specific force 1.9e-5 m/s^2: their rounding, some 0.3 LSB at each
// sample, leaves 1e-7 of the amplitude after 2000 samples.
TEST(DeviceFilters, OfAStim300HaveTheGainAndPhaseStated) {
  TurningUnit unit = stim300(true);
  EXPECT_EQ(unit.model().gyro.filter, low_pass(262));
  const auto of_inclinometers = [](double hz) {
    return SensorFilter{.cut_off_hz = Vector3::Constant(hz), .order = 1};
  };
  EXPECT_EQ(unit.model().inclinometer.value().filter, of_inclinometers(17));
  const auto compare = [&](double gyro_hz, double force_hz, double inclinometer_hz) {
    const SensorFilter slow = of_inclinometers(inclinometer_hz);
    for (const int hz : {1, 16, 40, 100, 250, 500}) {
      const std::array<Complex, 3> seen = response(unit, 2000, hz);
      EXPECT_LT(std::abs(seen[2] - frequency_response(slow, 0, 2000, hz)), 2e-5) << inclinometer_hz << " " << hz;
      EXPECT_LT(std::abs(seen[0] - frequency_response(low_pass(gyro_hz), 0, 2000, hz)), 2e-6) << gyro_hz << " " << hz;
      EXPECT_LT(std::abs(seen[1] - frequency_response(low_pass(force_hz), 0, 2000, hz)), 2e-5) << force_hz << hz;
    }
    EXPECT_NEAR(delay(unit, 2000), group_delay_s(low_pass(gyro_hz), 0, 2000), 3e-6);
  };
  compare(262, 262, 17);
  // The host chooses 16 Hz for the gyros, and 66 Hz for the accelerometers; the inclinometers are slower than most.
  unit.command("SERVICEMODE\r");
  unit.command("f 0,g\r");
  unit.command("f 2,a\r");
  unit.command("f 2,i\r");
  unit.command("x N\r");
  unit.run([](double) { return 0.0; }, 2000);  // leaves Service Mode
  compare(16, 66, 17);
  unit.command("SERVICEMODE\r");
  unit.command("f 0,i\r");
  unit.command("x N\r");
  unit.run([](double) { return 0.0; }, 2000);
  compare(16, 66, 12.5);
}

// Register 85: the windows of magnetometer, accelerometer, gyro, temperature and pressure, then their modes.
TEST(DeviceFilters, OfAVectorNavAreTheWindowsOfRegister85) {
  TurningUnit unit("vectornav", {"device_filters=true", "device.baud=921600", "device.async_type=0",
                                 "device.binary_1=\"1,1,01,0120\""});  // rate and acceleration, 800 Hz
  const auto compare = [&](int gyro, int accelerometer) {
    for (const int hz : {1, 20, 50, 160, 200})
      for (const auto& [i, window] : {std::pair{0U, gyro}, {1U, accelerometer}})
        EXPECT_LT(std::abs(response(unit, 800, hz).at(i) - frequency_response({.length = window}, 0, 800, hz)), 2e-6)
            << i << " " << window << " " << hz;
    EXPECT_NEAR(delay(unit, 800), 0.5 * (gyro - 1) / 800, 1e-6);
  };
  compare(4, 4);  // as delivered
  unit.command("$VNWRG,85,0,5,16,0,0,0,3,3,0,0*XX\r\n");
  compare(16, 5);
  unit.command("$VNWRG,85,0,5,16,0,0,0,3,0,0,0*XX\r\n");
  compare(1, 5);
}

// As delivered a single pole at half of the rate at which the quantity is sent; a host may choose another, or none.
// The decoded samples are those of the packets, at the rate of the stream.
TEST(DeviceFilters, OfAMipUnitHaveASinglePole) {
  TurningUnit unit(
      "mip", {"device_filters=true", "device.model=3dm-cv7-ahrs", "device.sensor_rate_hz=500",
              "device.sensor_fields=[\"rate\",\"acceleration\"]", "device.filter_fields=[]", "device.baud=921600"});
  const auto compare = [&](double gyro_hz, double force_hz) {
    for (const int hz : {1, 20, 100, 200}) {
      const auto sine = [&](double t) { return std::sin(2 * M_PI * hz * t); };
      const std::vector<Measurement> all = unit.run(sine, 2000);
      ASSERT_EQ(all.size(), 1000U);
      std::array<Complex, 2> seen = {};
      for (std::size_t k = 500; k < 1000; ++k) {
        const Complex turn = Complex(0, 2.0 / 500) * std::polar(1.0, -2 * M_PI * hz * static_cast<double>(k) / 500);
        seen[0] += turn * all[k].sample.rate.x();
        seen[1] += turn * all[k].sample.specific_force.y();
      }
      for (const auto& [value, cut_off] : {std::pair{seen[0], gyro_hz}, {seen[1], force_hz}}) {
        const SensorFilter filter = {.cut_off_hz = Vector3::Constant(cut_off), .order = 1};
        EXPECT_LT(std::abs(value - frequency_response(filter, 0, 1000, hz)), 2e-6) << cut_off << " " << hz;
      }
    }
  };
  compare(250, 250);
  // 0C:54: the gyros' at 20 Hz, the accelerometers' off.
  unit.command(std::string("\x75\x65\x0C\x0B\x0B\x54\x01\x80\x05\x01\x01\x41\xA0\x00\x00\xB9\x5D", 17));
  unit.command(std::string("\x75\x65\x0C\x0B\x0B\x54\x01\x80\x04\x00\x00\x00\x00\x00\x00\xD5\x67", 17));
  compare(20, 0);
}

// float16 has 2^-11 of a value, whose rounding leaves some 1e-5 of the amplitude after 1000 samples.
TEST(DeviceFilters, OfADroneCanNodeAreThoseOfApPeriph) {
  for (const bool is_filtered : {true, false}) {
    std::vector<std::string> keys = {"device_filters=true", "device.raw_imu_hz=1000", "device.start_up_ms=0"};
    if (!is_filtered) keys.insert(keys.end(), {"device.gyro_filter_hz=0", "device.accelerometer_filter_hz=0"});
    TurningUnit unit("dronecan", keys);
    const SensorFilter filter = is_filtered ? low_pass(20) : SensorFilter();
    EXPECT_EQ(unit.model().gyro.filter, filter);
    for (const int hz : {1, 10, 20, 50, 100}) {
      const std::array<Complex, 3> seen = response(unit, 1000, hz);
      for (const Complex& one : {seen[0], seen[1]})
        EXPECT_LT(std::abs(one - frequency_response(filter, 0, 1000, hz)), 2e-4) << is_filtered << " " << hz;
    }
  }
}

TEST(DeviceFilters, AreOffWithoutTheKey) {
  TurningUnit unit = stim300(false);
  EXPECT_FALSE(unit.model().gyro.filter.is_on());
  EXPECT_LT(std::abs(response(unit, 2000, 500)[0] - 1.0), 2e-6);
  EXPECT_NEAR(delay(unit, 2000), 0, 3e-6);
}

}  // namespace
}  // namespace imud
