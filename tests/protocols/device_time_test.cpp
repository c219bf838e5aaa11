// MIP and VectorNav under random calls at increasing times: the rules of Device about time (protocols/protocol.hpp).
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/protocols/mip/mip_unit.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct Product {
  const char* protocol;
  const char* model;
  Nanoseconds period;
};

std::string mip(std::uint8_t set, std::uint8_t descriptor, const mip_test::Bytes& data = {}) {
  const auto packet = mip_test::command(set, descriptor, data);
  return {packet.begin(), packet.end()};
}

// Commands of every kind that depends on time, and some others. None reads MIP's reference time, which is the only
// output that may change when the clock is set.
std::vector<std::string> commands(std::string_view protocol) {
  if (protocol == "mip")
    return {mip(1, 1),
            mip(1, 2),
            mip(1, 3),
            mip(1, 6),
            mip(1, 0x7E),
            mip(1, 8, {1, 1, 0, 0x0E, 0x10, 0}),
            mip(0x0C, 0x0D, {0x80, 0, 4, 0xD2, 0xD4, 0xD6, 0x07}),
            mip(0x0C, 0x0D, {0x80, 0, 2, 0xD1, 0x04}),
            mip(0x0C, 0x0F, {1, 0x80, 3, 0xD4, 0, 7, 0xD6, 0, 3, 0x07, 0, 5}),
            mip(0x0C, 0x0F, {1, 0x82, 1, 0xD6, 0, 9}),
            mip(0x0C, 0x11, {1, 0x80, 0}),
            mip(0x0C, 0x11, {1, 0x80, 1}),
            mip(0x0C, 0x39, {0x03, 0xE8}),
            mip(0x0C, 0x40, {1, 0, 0, 0x25, 0x80}),
            mip(0x0C, 0x40, {1, 0, 0, 0x0E, 0x10}),
            std::string("\x75\x65\x01\xFF", 4)};
  std::vector<std::string> all;
  for (const char* body :
       {"VNRRG,01", "VNRRG,54", "VNRRG,80", "VNRRG,63", "VNBOM,1", "VNASY,0", "VNASY,1", "VNRST", "VNRFS", "VNTAR",
        "VNWRG,06,30", "VNWRG,06,14", "VNWRG,07,200", "VNWRG,75,1,4,03,7FFF,03FF", "VNWRG,75,1,0,01,0003", "VNWNV"})
    all.push_back(vectornav_test::with_xor(body));
  return all;
}

// A device and its clock, which is `offset` ahead of the clock of the calls.
struct Clocked {
  explicit Clocked(const Product& product) {
    const Protocol& protocol = *find_protocol(product.protocol);
    Settings settings(protocol.settings);
    settings.set("model", std::string(product.model));
    if (product.protocol == std::string_view("mip")) {
      const bool has_shared_fields = std::string_view(product.model).find("gx5") == std::string_view::npos;
      settings.set("sensor_fields", has_shared_fields ? std::vector<std::string>{"delta_time", "reference_delta",
                                                                                 "delta_angle", "ticks"}
                                                      : std::vector<std::string>{"delta_angle", "delta_velocity"});
      settings.set("filter_fields", has_shared_fields
                                        ? std::vector<std::string>{"filter_reference_delta", "filter_status"}
                                        : std::vector<std::string>{"filter_status"});
    }
    device = protocol.make(settings);
    sent.reserve(1 << 21);
  }
  DeviceTime at(DeviceTime time) const { return time + offset; }
  std::optional<DeviceTime> deadline() const {
    const auto deadline = device->deadline();
    return deadline ? std::optional(*deadline - offset) : std::nullopt;
  }
  void sample(Sample sample) {
    sample.time = at(sample.time);
    collect([&] { device->sample(sample, *frames); });
  }
  void receive(std::string_view bytes, DeviceTime now) {
    collect([&] { device->receive({std::as_bytes(std::span(bytes))}, at(now), *frames); });
  }
  void poll(DeviceTime now) {
    collect([&] { device->poll(at(now), *frames); });
    const auto next = deadline();
    ASSERT_TRUE(!next || *next > now);
  }
  void set_clock(Nanoseconds by) {
    offset += by;
    device->step_clock(by);
  }

  std::unique_ptr<Device> device;
  Nanoseconds offset{};
  std::string sent;  // all bytes, in order
  std::unique_ptr<FrameBuffer> frames = std::make_unique<FrameBuffer>();

 private:
  template <class Call>
  void collect(Call&& call) {
    frames->clear();
    call();
    for (const Frame& frame : frames->frames())
      sent.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  }
};

void PrintTo(const Product& product, std::ostream* out) { *out << product.model; }

class DeviceTimes : public testing::TestWithParam<Product> {};
INSTANTIATE_TEST_SUITE_P(Devices, DeviceTimes,
                         testing::Values(Product{"mip", "3dm-gx5-25", 1ms}, Product{"mip", "3dm-gx5-45", 1ms},
                                         Product{"mip", "3dm-cv7-ahrs", 1ms}, Product{"mip", "3dm-cv7-ins", 1ms},
                                         Product{"mip", "3dm-gq7", 1ms}, Product{"vectornav", "vn-100", 1250us},
                                         Product{"vectornav", "vn-200", 1250us},
                                         Product{"vectornav", "vn-300", 2500us}),
                         [](const auto& product) {
                           std::string name = product.param.model;
                           std::erase(name, '-');
                           return name;
                         });

// Of two devices, one has its clock set at random: both send the same bytes, and have the same deadlines.
TEST_P(DeviceTimes, KeepTheContractUnderRandomCalls) {
  const Product& product = GetParam();
  const std::vector<std::string> known = commands(product.protocol);
  int deadlines = 0, cuts = 0, silent_answers = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    Clocked one(product), other(product);
    const auto both = [&](auto&& call) {
      const std::uint64_t before = allocations();
      call(one);
      call(other);
      ASSERT_EQ(allocations(), before);
    };
    Sample sample;
    sample.rate = {0.1, 0.2, 0.3};
    sample.delta_angle = sample.rate * seconds(product.period);
    sample.navigation.is_known = seed % 2 == 0;
    DeviceTime now;
    both([&](Clocked& c) { c.sample(sample); });
    bool has_samples = true;
    const auto poll_until = [&](DeviceTime end) {
      for (auto next = one.deadline(); next && *next <= end; next = one.deadline(), ++deadlines) {
        now = std::max(now, *next);
        both([&](Clocked& c) { c.poll(now); });
        if (testing::Test::HasFatalFailure()) return;
      }
      now = end;
    };
    for (int step = 0; step < 1500; ++step) {
      switch (below(12)) {
        case 0:
          has_samples = below(3) != 0;
          break;
        case 1:
          poll_until(now + Nanoseconds(static_cast<std::int64_t>(random() % 3'000'000'000)));
          break;
        case 2:
          poll_until(now + Nanoseconds(static_cast<std::int64_t>(random() % 90'000'000)));
          break;
        case 3: {
          std::string text = known[below(known.size())];
          text.resize(below(text.size() + 1));
          both([&](Clocked& c) { c.receive(text, now); });
          ++cuts;
          break;
        }
        case 4:
          other.set_clock(Nanoseconds(static_cast<std::int64_t>(random() % 200'000'000'000) - 100'000'000'000));
          break;
        case 5:
          if (below(8) == 0) both([&](Clocked& c) { c.device->power_on(c.at(now)); });
          break;
        case 6:
        case 7: {
          const std::string& text = known[below(known.size())];
          const std::size_t before = one.sent.size();
          both([&](Clocked& c) { c.receive(text, now); });
          silent_answers += !has_samples && one.sent.size() > before;
          break;
        }
        default:
          for (std::size_t k = has_samples ? below(40) : 0; k > 0; --k) {
            poll_until(now + product.period);
            sample.time = now;
            sample.navigation.gps_ns = sample.navigation.is_known ? 1'420'000'000'000'000'000 + now.ns : 0;
            ++sample.counter;
            both([&](Clocked& c) { c.sample(sample); });
          }
          break;
      }
      ASSERT_FALSE(testing::Test::HasFatalFailure());
      ASSERT_EQ(one.deadline(), other.deadline()) << step;
      ASSERT_TRUE(one.sent == other.sent) << step;
      one.sent.clear();
      other.sent.clear();
    }
    // An unfinished command has timed out, without a sample.
    now = now + 2s;
    const std::string last = product.protocol == std::string_view("mip") ? mip(1, 1) : known[0];
    both([&](Clocked& c) {
      c.poll(now);
      c.frames->clear();
      c.sent.clear();
      c.receive(last, now);
    });
    EXPECT_FALSE(one.sent.empty());
    EXPECT_TRUE(one.sent == other.sent);
  }
  EXPECT_GE(cuts, 1000);
  EXPECT_GE(silent_answers, 100);
  if (product.protocol == std::string_view("mip")) {
    EXPECT_GE(deadlines, 500);
  }
}

}  // namespace
}  // namespace imud
