// Random changes of the requests of each shipped description, and of one with every form of requests: no input makes
// a unit crash, hang or allocate, and a request that no setting locks is executed afterwards. The environment
// variable IMUD_FUZZ_INPUTS sets the number of inputs for each. Seeds are fixed.
#include <cstdlib>

#include "protocols/frames/host/frame_requests.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

std::vector<std::string> examples_of(const FrameDescription& description) {
  std::vector<std::string> examples;
  for (const std::vector<std::byte>& bytes : FrameRequests(description).examples())
    examples.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return examples;
}

// Returns examples of the requests that are understood whatever the settings are.
std::vector<std::string> unlocked_examples(FrameDescription description) {
  std::erase_if(description.host.requests, [](const auto& request) { return !request.when.empty(); });
  description.host.unknown.clear();
  return examples_of(description);
}

constexpr std::string_view every_form = R"(
frame_version = 1
name = "every form"
[setting]
MASK = {min = 0, max = 0xFFFF, delivered = 5}
HZ = {min = 0, max = 100, delivered = 50}
TRIM = {min = -9, max = 9}
FORM = {values = ["A", "B"], codes = [3, 4]}
[[message]]
name = "data"
rate_hz = "HZ"
when = {FORM = "A"}
layout = ["@a", "3A", "length:u8:@b..@c", "@b", "MASK.0? rate_x_rad_per_s:f32", "MASK.1? delta_angle_x_rad:i16*1e-4 carry",
  "MASK.2? bits:u8:0-3=alive_counter", "!MASK.15? 55 AA", "FORM=A? temperature_c:f64", "@c", "check:crc16/xmodem:@a.."]
[[request]]
layout = ["@a", "3A 01", "length:u16:@b..@c", "@b", "{MASK}:u16", "{items}", "@c", "check:sum16:@a.."]
items = [["01", "{HZ}:u8"], ["02", "{FORM}:u16 be"], ["03", "_:4"]]
set = true
answer = ["AC", "{MASK}:u32", "{0-5}", "temperature_c:f32"]
otherwise = "EE"
[[request]]
layout = ["@a", "3A 02", "length:u8:@b..@", "@b", "_:*", "{HZ}:u8", "check:xor8:@a.."]
set = true
poll = "data"
delay_ms = 15
answer = ["AC", "{0-2}"]
[[request]]
line = "{setting}={value}"
set = true
answer = "{setting} {value} {HZ} {TRIM} {MASK}\n"
otherwise = "no {value}\n"
[unknown]
layout = ["@a", "3A", "_:1", "length:u8:@b..@c", "@b", "_:*", "@c", "check:sum8:@a.."]
answer = ["15", "{1-2}"]
)";

TEST(FrameRequestFuzz, AnyBytesDoNoHarm) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 20'000;
  std::size_t listening = 0;
  std::vector<std::shared_ptr<const FrameDescription>> all = {frames_of_text(every_form, "every form")};
  for (const ShippedFrames& shipped : shipped_frames()) all.push_back(read_frames(std::string(shipped.name)));
  for (const auto& description : all) {
    if (description->host.requests.empty()) continue;
    ++listening;
    SCOPED_TRACE(description->file);
    const std::vector<std::string> examples = examples_of(*description), unlocked = unlocked_examples(*description);
    const std::vector<std::string_view> pieces(examples.begin(), examples.end());
    Line line(protocol_named("frame"), frame_settings(description));
    Device& device = *line.device;
    const auto frames = std::make_unique<FrameBuffer>();
    std::mt19937_64 random(17);
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    Sample sample;
    std::string text;
    text.reserve(4096);
    const auto give = [&](std::string_view bytes) {
      frames->clear();
      device.receive({std::as_bytes(std::span(bytes))}, sample.time, *frames);
    };
    for (long n = 0; n < inputs && !HasFatalFailure(); ++n) {
      text = pieces[below(pieces.size())];
      for (std::size_t k = below(3); k > 0 && !text.empty(); --k) change_randomly(text, 4, pieces, random);
      const std::uint64_t before = allocations();
      give(text);
      for (std::size_t k = below(3); k > 0; --k) {
        sample.time = sample.time + (below(100) == 0 ? 11s : Nanoseconds(10ms));
        while (device.deadline() && *device.deadline() <= sample.time) {
          frames->clear();
          device.poll(*device.deadline(), *frames);
        }
        ++sample.counter;
        frames->clear();
        device.sample(sample, *frames);
      }
      if (below(300) == 0) device.power_on(sample.time);
      ASSERT_EQ(allocations(), before);
      if (n % 100 != 99) continue;
      sample.time = sample.time + 2s;  // an unfinished request times out
      const std::uint64_t unknown = device.counts()[1];
      give("");
      const std::uint64_t dropped = device.counts()[1];
      ASSERT_LE(dropped - unknown, FrameHostDescription::longest_request);
      give(unlocked[below(unlocked.size())]);
      ASSERT_EQ(device.counts()[1], dropped);  // it was executed
    }
    EXPECT_GT(device.counts()[1], 0U);
  }
  EXPECT_GE(listening, 6U);
}

}  // namespace
}  // namespace imud
