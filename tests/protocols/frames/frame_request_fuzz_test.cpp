// Random changes of the requests of each shipped description: no input makes a unit crash, hang or allocate, and a
// request that no setting locks is executed afterwards. The environment variable IMUD_FUZZ_INPUTS sets the number of
// inputs for each. Seeds are fixed.
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
  return examples_of(description);
}

TEST(FrameRequestFuzz, AnyBytesDoNoHarm) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 20'000;
  std::size_t listening = 0;
  for (const ShippedFrames& shipped : shipped_frames()) {
    const auto description = read_frames(std::string(shipped.name));
    if (description->host.requests.empty()) continue;
    ++listening;
    SCOPED_TRACE(shipped.name);
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
  EXPECT_GE(listening, 5U);
}

}  // namespace
}  // namespace imud
