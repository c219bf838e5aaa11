// Steps: the same steps give the same bytes, whoever proposes them, and no order of steps makes an engine fail. The
// environment variable IMUD_FUZZ_INPUTS sets the number of random steps. The seed is fixed.
#include "emulator/engine/step.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "emulator/config/load_config.hpp"
#include "emulator/engine/closing.hpp"
#include "protocols/native_truth.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

constexpr std::int64_t ms = 1'000'000;

// Keeps the frames, with their borders.
class KeepingLine final : public Port {
 public:
  explicit KeepingLine(std::string& sent) : sent_(sent) {}
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames)
      sent_.append(fmt::format("{:x}#", frame.can.id))
          .append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    counters_.count_sent(is_reply_, frames.size());
  }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  bool has_room() const noexcept override { return true; }

 private:
  std::string& sent_;
};

// Each call gives the truth that `next` has.
class GivenTruth final : public Port {
 public:
  explicit GivenTruth(const Truth& next) : next_(next) {}
  void send(std::span<const Frame>) noexcept override {}
  std::optional<Received> receive() noexcept override {
    encode_native_truth(next_, bytes_);
    return Received{{bytes_}, HostTime{}};
  }

 private:
  const Truth& next_;
  std::array<std::byte, native_truth_size> bytes_{};
};

// Keeps the events.
class KeepingSink final : public StepSink {
 public:
  KeepingSink() : StepSink(true) {}
  std::uint16_t add_interface(std::string, std::uint16_t) override { return interfaces_++; }
  void set_truth_address(const Endpoint&) override {}
  std::vector<RecordEvent> events;

 private:
  void keep_event(const RecordEvent& event) noexcept override { events.push_back(event); }
  void keep_packet(std::uint16_t, PacketDirection, HostTime, const Frame&, const Endpoint&) noexcept override {}
  std::uint16_t interfaces_ = 0;
};

class StepTest : public RunTest {
 protected:
  static constexpr std::size_t imus = 3;

  // A serial product, one with two UARTs, and one on a bus; with faults of all seams.
  Config three() const {
    return load_config(write("config.toml", R"(clock = "lockstep"
control.faults = true
[truth]
port = "udp:127.0.0.1:9810"
[[imu]]
name = "a"
protocol = "stim300"
port = "pty:a"
device.start_up = false
[[imu]]
name = "b"
protocol = "vectornav"
device.model = "vn-300"
port = "pty:b"
second_port = "pty:b2"
[[imu]]
name = "c"
protocol = "dronecan"
port = "slcan:/dev/ttyS0?bitrate=1000000"
[[fault]]
imu = "*"
target = "gyro.x"
kind = "bias"
value = 0.1
at_s = 0.05
for_s = 0.2
[[fault]]
imu = "a"
target = "wire"
kind = "bit_errors"
value = 1e-4
at_s = 0.1
for_s = 0.2
[[fault]]
imu = "b"
target = "message"
kind = "late"
delay_ms = 30
at_s = 0.1
for_s = 0.2
[[fault]]
imu = "c"
target = "power"
kind = "off"
at_s = 0.1
for_s = 0.1
)"));
  }

  // An engine whose truth port gives `truth`, and that keeps its bytes.
  struct Kept {
    Truth truth;
    std::array<std::string, imus> sent;
    KeepingSink sink;
    Engine engine;
    explicit Kept(const Config& config)
        : engine(
              config,
              [this](const PortUse& use) -> std::unique_ptr<Port> {
                if (use.of == PortUse::Of::truth) return std::make_unique<GivenTruth>(truth);
                return std::make_unique<KeepingLine>(sent[use.imu]);
              },
              sink) {
      truth.has_rate = true;
    }
    // Proposes a step, and sends the frames that it has prepared.
    void apply(const Step& step) {
      engine.apply(step);
      if (step.event.type != Step::Type::transmit) return;
      if ((step.event.flags & RecordEvent::skipped) == 0)
        for (Channel* channel : engine.prepared()) channel->transmit();
      engine.complete();
    }
  };
};

// A step of a random walk of time, so that no deadline lies more than some seconds back.
class RandomSteps {
 public:
  Step next(Truth& truth, std::string& text) {
    host_ += static_cast<std::int64_t>(random_() % (4 * ms));
    if (random_() % 300 == 0) truth_ += static_cast<std::int64_t>(random_() % 2'000) * ms - 1'000 * ms;
    const std::size_t imu = random_() % (imu_count + 1);  // one too many
    const HostTime now{host_};
    switch (random_() % 16) {
      case 0:
        return Step::power_on(imu, now);
      case 1:
        return Step::power_cycle(now);
      case 2:
      case 3:
      case 4:
        truth_ += static_cast<std::int64_t>(random_() % (20 * ms));
        truth.time = TruthTime{truth_};
        truth.omega_BN_B = {0.1, 1e-9 * static_cast<double>(truth_ % 1'000'000'000), 0};
        return Step::truth(random_() % 50 == 0 ? TruthTime{truth_} : Timeline::never);
      case 5:
        return random_() % 20 == 0 ? Step::forget_past() : Step::start_samples(imu);
      case 6:
        return Step::run(random_() % 4 != 0);
      case 7:
        return Step::set_clock(imu, DeviceTime{truth_}, random_() % 2 == 0 ? std::optional(now) : std::nullopt);
      case 8:
        return Step::advance(TruthTime{truth_ - static_cast<std::int64_t>(random_() % (50 * ms))});
      case 9:
      case 10:
        return random_() % 8 == 0 ? Step::rest_sample(imu, k_++, Nanoseconds(host_))
                                  : Step::sample(imu, k_++, TruthTime{truth_});
      case 11:
        return Step::transmit(now, random_() % 8 == 0);
      case 12:
        return Step::deadlines(now);
      case 13:
      case 14: {
        constexpr std::string_view texts[] = {"N", "R", "$VNRRG,01*XX\r\n", "$VNWRG,07,100*XX\r\n", "\x01\x02", ""};
        text = texts[random_() % std::size(texts)];
        content_ = {.frame = {std::as_bytes(std::span(text))}, .arrival = now};
        return Step::receive(imu, random_() % 3, now, content_);
      }
      default: {
        const auto kind = random_() % 4 == 0   ? static_cast<Command::Kind>(random_() % 19)
                          : random_() % 2 == 0 ? Command::Kind::resume
                                               : Command::Kind::power_on;
        // A fault that is begun is one of the configuration, and a servo one of the format.
        const std::uint64_t number = random_() % 4;
        return Step::command({.kind = kind,
                              .imu = static_cast<std::uint16_t>(random_() % 2 == 0 ? imu : Command::all_imus),
                              .value = 0.01,
                              .number = number},
                             now);
      }
    }
  }

 private:
  static constexpr std::size_t imu_count = 3;
  std::mt19937_64 random_{25};
  std::int64_t host_ = 1'000'000 * ms, truth_ = 0;
  std::uint64_t k_ = 0;
  Step::Content content_;
};

TEST_F(StepTest, RandomStepsGiveTheSameBytesTwice) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long steps = wanted != nullptr ? std::atol(wanted) : 20'000;
  const Config config = three();
  Kept one(config), other(config);
  RandomSteps random;
  std::string text;
  std::size_t bytes = 0;
  for (long i = 0; i < steps; ++i) {
    const Step step = random.next(one.truth, text);
    other.truth = one.truth;
    one.apply(step);
    other.apply(step);
    for (std::size_t imu = 0; imu < imus; ++imu) {
      ASSERT_EQ(one.sent[imu], other.sent[imu]) << "step " << i << ", imu " << imu;
      bytes += one.sent[imu].size();
      one.sent[imu].clear();
      other.sent[imu].clear();
    }
  }
  EXPECT_GT(bytes, static_cast<std::size_t>(steps)) << "hardly anything was sent";
  EXPECT_GT(one.engine.intake().counters().accepted, static_cast<std::uint64_t>(steps) / 100);
}

// A driver that only forwards the events of another run, with its truths and its host's bytes, makes its bytes.
TEST_F(StepTest, ForwardedEventsGiveTheBytesOfTheirRun) {
  const Config config = three();
  Kept run(config);
  std::vector<Truth> truths;
  const HostTime begin{5'000 * ms};
  constexpr std::string_view request = "$VNRRG,01*XX\r\n";
  const Step::Content asked{.frame = {std::as_bytes(std::span(request))}, .arrival = begin};
  std::array<std::uint64_t, imus> k{};
  for (int i = 0; i < 400; ++i) {
    const HostTime now = begin + Nanoseconds(10 * ms * i);
    run.truth.time = TruthTime{10 * ms * i};
    run.truth.omega_BN_B = {0.1, 0.01 * i, 0};
    truths.push_back(run.truth);
    run.apply(Step::truth(Timeline::never));
    if (i == 0) {
      run.apply(Step::run(false));
      for (std::size_t imu = 0; imu < imus; ++imu) {
        run.apply(Step::set_clock(imu, DeviceTime{}, std::nullopt));
        run.apply(Step::start_samples(imu));
      }
    }
    for (std::size_t imu = 0; imu < imus; ++imu) {
      const Grid& grid = run.engine.channels()[imu]->sensor.grid();
      for (; grid.offset(k[imu]).count() <= 10 * ms * i; ++k[imu]) {
        run.apply(Step::sample(imu, k[imu], TruthTime{grid.offset(k[imu]).count()}));
        run.apply(Step::transmit(now, i % 10 == 9));
      }
    }
    if (i % 7 == 3) run.apply(Step::receive(1, 0, now, asked));
    if (i == 80) run.apply(Step::power_cycle(now));
    if (i == 60) run.apply(Step::command({.kind = Command::Kind::gyro_bias, .value = 0.3}, now));
  }
  ASSERT_GT(run.sink.events.size(), 1'000U);
  for (const std::string& sent : run.sent) ASSERT_GT(sent.size(), 500U) << &sent - run.sent.data();

  Kept again(config);
  std::map<std::uint16_t, std::uint16_t> imu_of;
  for (const auto& channel : again.engine.channels()) imu_of[channel->lines.all()[0].interface] = channel->number;
  std::size_t next_truth = 0;
  for (const RecordEvent& event : run.sink.events) {
    if (event.type == Step::Type::truth) again.truth = truths[next_truth++];
    const bool has_imu =
        traits_of(event).is_of_imu || (event.type == Step::Type::command && event.interface != RecordEvent::all_imus);
    again.apply({.event = event,
                 .imu = has_imu ? imu_of.at(event.interface) : Step::all_imus,
                 .content = event.type == Step::Type::receive ? &asked : nullptr});
  }
  for (std::size_t imu = 0; imu < imus; ++imu) EXPECT_TRUE(again.sent[imu] == run.sent[imu]) << "imu " << imu;
}

}  // namespace
}  // namespace imud
