// Random changes of the host inputs (conformance.hpp) of the devices that have a host, half of them with a right
// checksum, while time passes with samples or without, and the clock is stepped. No input makes a device crash, hang
// or allocate, and a good command is answered afterwards. The environment variable IMUD_FUZZ_INPUTS sets the number
// of inputs for each configuration of each device. Seeds are fixed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/protocols/can_text.hpp"
#include "tests/protocols/conformance_cases.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

TEST(HostInputs, AreNamedByEveryDeviceThatListens) {
  std::size_t listening = 0;
  for (const auto& [name, inputs] : Conformance::all()) EXPECT_NE(find_protocol(name), nullptr) << name;
  for (const Protocol* protocol : protocols()) {
    const HostInputs& inputs = Conformance::of(*protocol).host;
    EXPECT_EQ(!inputs.bodies.empty(), overrides_receive(*protocol)) << protocol->name;
    if (inputs.bodies.empty()) continue;
    ++listening;
    EXPECT_TRUE(inputs.frame != nullptr && !inputs.last.empty() && !inputs.answer.empty()) << protocol->name;
  }
  EXPECT_GT(listening, 0U);
}

class HostFuzz : public testing::TestWithParam<ConformanceCase> {};
INSTANTIATE_TEST_SUITE_P(Devices, HostFuzz, testing::ValuesIn(conformance_cases([](const Protocol& p) {
                           return !Conformance::of(p).host.bodies.empty();
                         })),
                         case_name);

TEST_P(HostFuzz, AnyBytesDoNoHarm) {
  const HostInputs& host = Conformance::of(GetParam().protocol).host;
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 50'000;
  const std::unique_ptr<Device> device = GetParam().protocol.make(GetParam().settings);
  const auto frames = std::make_unique<FrameBuffer>();
  std::mt19937_64 random(11);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  Sample sample;
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = 1'420'000'000'000'000'000;
  sample.navigation.latitude = 0.8;
  sample.navigation.r_E = {4.4e6, 0, 4.6e6};
  sample.magnetic_field = {2e-5, 0, 4e-5};
  sample.pressure = 101'325;
  DeviceTime now;
  std::string answers;
  std::size_t polls = 0;
  // Gives the device a text: bytes, or CAN frames, one after another.
  const bool is_can = GetParam().protocol.link == Link::can;
  const auto give = [&](std::string_view text, auto&& answered) {
    const auto receive = [&](const Frame& frame) {
      frames->clear();
      device->receive(frame, now, *frames);
      answered();
    };
    if (is_can)
      each_frame(text, receive);
    else
      receive({std::as_bytes(std::span(text))});
  };
  const auto receive = [&](std::string_view text) {
    give(text, [&] {
      for (const Frame& frame : frames->frames()) {
        if (is_can)
          answers += can_text(frame) + ' ';
        else
          for (const std::byte byte : frame.bytes) answers += static_cast<char>(byte);
      }
    });
  };
  const auto pass = [&](Nanoseconds time, bool with_sample) {
    const DeviceTime end = now + time;
    for (auto due = device->deadline(); due && *due <= end; due = device->deadline()) {
      frames->clear();
      device->poll(now = std::max(now, *due), *frames);
      ++polls;
      ASSERT_GT(device->deadline().value_or(now + 1ns), now);
    }
    now = end;
    if (!with_sample) return;
    ++sample.counter;
    sample.time = now;
    frames->clear();
    device->sample(sample, *frames);
  };
  const std::span<const std::string_view> bodies = host.bodies;
  std::string text;
  text.reserve(4096);
  answers.reserve(1 << 20);
  for (long n = 0; n < inputs && !HasFatalFailure(); ++n) {
    const std::string body(bodies[below(bodies.size())]);
    const bool framed_last = below(2) == 0;
    text = framed_last ? body : host.frame(body);
    for (std::size_t k = below(4); k > 0 && !text.empty(); --k) change_randomly(text, 4, bodies, random);
    if (framed_last) text = host.frame(text.substr(0, 250));
    if (below(8) == 0) text.resize(below(text.size() + 1));
    const std::uint64_t before = allocations();
    give(text, [] {});
    if (below(4) == 0) pass(below(50) == 0 ? 1s : 1ms, below(4) != 0);
    if (below(200) == 0) {
      const Nanoseconds by = 1ms * below(11'000) - 1s;
      device->step_clock(by);
      now = now + by;
    }
    ASSERT_EQ(allocations(), before);
    const unsigned baud = device->uart().baud;
    ASSERT_TRUE(is_can ? baud == 0 : baud >= 1500 && baud <= 5'184'000) << baud;
    if (n % 1000 != 999) continue;
    const bool with_samples = below(2) == 0;
    for (int i = 0; i < 7000; ++i) pass(1ms, with_samples);  // an unfinished input times out, and a hold time ends
    answers.clear();
    for (const std::string_view one : host.revive) receive(host.frame(one));
    receive(host.frame(host.last));
    ASSERT_NE(answers.find(host.answer), std::string::npos) << n << (with_samples ? "" : ", without samples");
    for (const std::string_view one : host.revive) receive(host.frame(one));
  }
  if (device->deadline()) {
    EXPECT_GT(polls, 0U);
  }
}

}  // namespace
}  // namespace imud
