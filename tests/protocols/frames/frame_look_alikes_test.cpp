// Two messages of a description whose frames look alike.
#include <chrono>
#include <string_view>
#include <vector>

#include "tests/protocols/frames/field_recording.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

// A KVH 1775 sends the temperature and the magnetic field at one place of its frames, by the low bits of a sequence
// number that counts all of them.
TEST(FrameLookAlikes, ASequenceNumberTellsMessagesApart) {
  Line line(protocol_named("frame"), frame_settings(read_frames("kvh1775")));
  FieldRecording recording(*line.decoder);
  Recording measurements;
  Sample sample;
  sample.magnetic_field = 1e-4 * Vector3(0.2, -0.05, 0.4);
  for (int k = 0; k < 260; ++k) {
    const std::vector<std::byte> bytes = bytes_of(line, sample);
    ASSERT_EQ(bytes.size(), 38U);
    EXPECT_EQ(bytes[33], static_cast<std::byte>(k % 128));
    line.decoder->feed({bytes}, measurements);
    ++sample.counter;
    sample.time = sample.time + std::chrono::milliseconds(1);
  }
  constexpr std::string_view names[] = {"C, temperature", "C, magnetic field x", "C, magnetic field y",
                                        "C, magnetic field z"};
  ASSERT_EQ(recording.rows.size(), 260U);
  for (std::size_t i = 0; i < recording.rows.size(); ++i) EXPECT_EQ(recording.rows[i].message, names[i % 4]);
  for (const Measurement& measurement : measurements.measurements)
    if ((measurement.fields & Measurement::temperature) != 0) {
      EXPECT_EQ(measurement.sample.temperature_c, 25);
    }
}

}  // namespace
}  // namespace imud
