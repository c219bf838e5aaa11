// Random changes of the shipped descriptions, and of what a unit of each sends. The environment variable
// IMUD_FUZZ_INPUTS sets the number of descriptions, and of inputs for each decoder. Seeds are fixed.
#include <cstdlib>

#include "protocols/frames/host/frame_requests.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

long inputs_wanted(long usual) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  return wanted != nullptr ? std::atol(wanted) : usual;
}

// Any change of a shipped description is read, or refused with a text, and what is read can be sent and decoded.
TEST(FrameFuzz, AnyFileIsReadOrRefused) {
  std::mt19937_64 random(11);
  constexpr std::string_view alphabet = "@:.*+-%/^=!?,_\"' 0123456789ABCDEFabcdefghiklmnoprstuvwxyz[]{}\n";
  const long inputs = inputs_wanted(6000);
  long accepted = 0;
  for (long i = 0; i < inputs; ++i) {
    const ShippedFrames& shipped = shipped_frames()[random() % shipped_frames().size()];
    std::string text(shipped.text);
    for (std::size_t n = 1 + random() % 3; n > 0; --n) {
      const std::size_t at = random() % text.size();
      switch (random() % 4) {
        case 0:
          text.erase(at, 1 + random() % 8);
          break;
        case 1:
          text.insert(at, 1, alphabet[random() % alphabet.size()]);
          break;
        case 2:
          text.insert(at, text.substr(random() % text.size(), random() % 12));
          break;
        default:
          text[at] = alphabet[random() % alphabet.size()];
      }
      if (text.empty()) text = " ";
    }
    try {
      const auto description = frames_of_text(text, "test.toml");
      Line line(protocol_named("frame"), frame_settings(description));
      Recording recording;
      for (const Frame& frame : line.encode({})) line.decoder->feed(frame, recording);
      line.decoder->feed({random_bytes(300, random)}, recording);
      const auto replies = std::make_unique<FrameBuffer>();
      for (const std::vector<std::byte>& bytes : FrameRequests(*description).examples())
        line.device->receive({bytes}, {}, *replies);
      line.device->receive({random_bytes(300, random)}, {}, *replies);
      line.decoder->finish(recording);
      ++accepted;
    } catch (const ConfigError& error) {
      ASSERT_FALSE(error.faults.empty());
    }
  }
  EXPECT_GT(accepted, inputs / 60);  // changes of comments, names and test frames' blanks
}

// No bytes make a decoder crash, hang or allocate, and it decodes good frames afterwards.
TEST(FrameFuzz, AnyBytesAreDecoded) {
  const long inputs = inputs_wanted(2000);
  std::size_t decoders = 0;
  long compared = 0;
  for (const ShippedFrames& shipped : shipped_frames()) {
    ++decoders;
    SCOPED_TRACE(shipped.name);
    Line line(protocol_named("frame"), frame_settings(read_frames(std::string(shipped.name))));
    std::mt19937_64 random(23);
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    std::string good;
    Sample sample;
    sample.time.ns = 12'000'000'000;  // after the start
    sample.specific_force = Vector3(0.5, -0.25, -9.8);
    for (int k = 0; k < 4; ++k) {
      for (const Frame& frame : line.encode(sample))
        good.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
      ++sample.counter;
      sample.time = sample.time + std::chrono::milliseconds(100);
    }
    ASSERT_FALSE(good.empty());
    const std::string_view pieces[] = {good};
    Recording recording(100'000);
    const auto feed = [&](std::string_view bytes) {
      line.decoder->feed({std::as_bytes(std::span(bytes))}, recording);
    };
    feed(good);
    const bool is_measured = !recording.measurements.empty();
    std::string text;
    text.reserve(1 << 20);
    for (long n = 0; n < inputs; ++n) {
      text = good;
      for (std::size_t k = 1 + below(4); k > 0 && !text.empty(); --k) change_randomly(text, 8, pieces, random);
      recording.measurements.clear();
      const std::uint64_t before = allocations();
      const std::size_t cut = below(text.size() + 1);  // it arrives in two parts
      feed(std::string_view(text).substr(0, cut));
      feed(std::string_view(text).substr(cut));
      ASSERT_EQ(allocations(), before);
      if (n % 100 != 99) continue;
      for (int k = 0; k < 3; ++k) feed(good);
      ASSERT_EQ(!recording.measurements.empty(), is_measured);
      if (!is_measured) continue;
      const Measurement& last = recording.measurements.back();
      if ((last.fields & Measurement::specific_force) == 0) continue;
      ASSERT_LE((last.sample.specific_force - sample.specific_force).norm(), 0.02);
      ++compared;
    }
  }
  EXPECT_GE(decoders, 25U);
  EXPECT_GE(compared, 20 * (inputs / 100));
}

}  // namespace
}  // namespace imud
