// Escapes of frames: known encodings, and streams with damage.
#include <random>

#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

constexpr FrameEscape all_escapes[] = {FrameEscape::slip, FrameEscape::hdlc, FrameEscape::dle, FrameEscape::cobs};

std::vector<std::byte> escaped(FrameEscape escape, std::span<const std::byte> content) {
  std::vector<std::byte> out(longest_escaped(escape, content.size()));
  out.resize(escape_frame(escape, content, out));
  return out;
}

std::vector<std::vector<std::byte>> contents_in(FrameEscape escape, std::span<const std::byte> stream,
                                                std::uint64_t& skipped) {
  EscapeReader reader(escape);
  std::vector<std::vector<std::byte>> contents;
  for (const std::byte byte : stream)
    if (reader.take(byte)) contents.emplace_back(reader.content().begin(), reader.content().end());
  reader.finish();
  skipped = reader.take_skipped();
  return contents;
}

TEST(FrameEscapes, KnownEncodings) {
  using enum FrameEscape;
  EXPECT_EQ(escaped(slip, hex_bytes("01 C0 DB 02")), hex_bytes("C0 01 DB DC DB DD 02 C0"));  // RFC 1055
  EXPECT_EQ(escaped(hdlc, hex_bytes("01 7E 7D 02")), hex_bytes("7E 01 7D 5E 7D 5D 02 7E"));  // RFC 1662, 4.2
  EXPECT_EQ(escaped(dle, hex_bytes("41 10 03")), hex_bytes("10 41 10 10 03 10 03"));
  // The examples of the article on COBS in Wikipedia.
  EXPECT_EQ(escaped(cobs, hex_bytes("00")), hex_bytes("01 01 00"));
  EXPECT_EQ(escaped(cobs, hex_bytes("00 00")), hex_bytes("01 01 01 00"));
  EXPECT_EQ(escaped(cobs, hex_bytes("11 22 00 33")), hex_bytes("03 11 22 02 33 00"));
  EXPECT_EQ(escaped(cobs, hex_bytes("11 00 00 00")), hex_bytes("02 11 01 01 01 00"));
  std::vector<std::byte> long_content, wanted = hex_bytes("FF");
  for (int k = 1; k <= 254; ++k) long_content.push_back(static_cast<std::byte>(k));
  wanted.insert(wanted.end(), long_content.begin(), long_content.end());
  wanted.push_back(std::byte{0});
  EXPECT_EQ(escaped(cobs, long_content), wanted);
  long_content.push_back(std::byte{0xFF});
  wanted.pop_back();
  for (const std::byte byte : hex_bytes("02 FF 00")) wanted.push_back(byte);
  EXPECT_EQ(escaped(cobs, long_content), wanted);
}

TEST(FrameEscapes, AreRemoved) {
  std::mt19937_64 random(3);
  int compared = 0;
  for (const FrameEscape escape : all_escapes) {
    std::vector<std::vector<std::byte>> contents;
    std::vector<std::byte> stream;
    for (int k = 0; k < 300; ++k) {
      std::vector<std::byte> content = random_bytes(1 + random() % 600, random);
      if (k % 2 == 0)  // many bytes that are escaped
        for (std::byte& byte : content)
          byte = hex_bytes("00 10 03 C0 DB DC 7E 7D FF")[std::to_integer<unsigned>(byte) % 9];
      if (escape == FrameEscape::dle && (content[0] == std::byte{0x10} || content[0] == std::byte{3}))
        content[0] = {};
      const std::vector<std::byte> frame = escaped(escape, content);
      stream.insert(stream.end(), frame.begin(), frame.end());
      contents.push_back(content);
      ++compared;
    }
    std::uint64_t skipped = 0;
    EXPECT_EQ(contents_in(escape, stream, skipped), contents);
    EXPECT_EQ(skipped, 0U) << escape_name(escape);
  }
  EXPECT_EQ(compared, 1200);
}

// A frame after any byte in error is found, but for the one that follows it at most, and every byte is counted.
TEST(FrameEscapes, DamageIsLeftBehind) {
  const std::vector<std::byte> content = hex_bytes("41 00 10 C0 7E DB 7D 03 FF 05");
  for (const FrameEscape escape : all_escapes) {
    const std::vector<std::byte> frame = escaped(escape, content);
    for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit) {
      std::vector<std::byte> stream = frame;
      stream[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
      for (int k = 0; k < 3; ++k) stream.insert(stream.end(), frame.begin(), frame.end());
      std::uint64_t skipped = 0;
      const auto contents = contents_in(escape, stream, skipped);
      EXPECT_GE(std::ranges::count(contents, content), 2) << escape_name(escape) << " bit " << bit;
    }
  }
}

TEST(FrameEscapes, FramesThatAreTooLongAreSkipped) {
  for (const FrameEscape escape : all_escapes) {
    const std::vector<std::byte> small = hex_bytes("41 42"),
                                 large(FrameDescription::longest_frame + 1, std::byte{0x55});
    std::vector<std::byte> stream = escaped(escape, large);
    const std::size_t wrong = stream.size();
    for (const std::byte byte : escaped(escape, small)) stream.push_back(byte);
    std::uint64_t skipped = 0;
    EXPECT_EQ(contents_in(escape, stream, skipped), std::vector<std::vector<std::byte>>(1, small))
        << escape_name(escape);
    EXPECT_GE(skipped, wrong - 4) << escape_name(escape);
    EXPECT_LE(skipped, wrong) << escape_name(escape);
  }
}

TEST(FrameEscapes, ADescriptionHasOne) {
  int descriptions = 0;
  for (const char* name : {"slip", "hdlc", "dle", "cobs"}) {
    Line line = frame_line("escape = \"" + std::string(name) + "\"\n" +
                           one_message("@b\n41\nsample_counter:u32\nrate_x_deg_per_s:i16\ncheck:xor8:@b.."));
    Recording recording;
    for (std::uint64_t k = 0; k < 1000; ++k) {
      Sample sample;
      sample.counter = 0x7D7E10C0DB - 500 + k;
      for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
    }
    line.decoder->finish(recording);
    ASSERT_EQ(recording.measurements.size(), 1000U) << name;
    EXPECT_EQ(recording.measurements.back().sample.counter & 0xFFFFFFFF, (0x7D7E10C0DBU + 499U) & 0xFFFFFFFFU);
    EXPECT_EQ(line.decoder->errors().skipped_bytes + line.decoder->errors().malformed, 0U) << name;
    ++descriptions;
  }
  EXPECT_EQ(descriptions, 4);
}

}  // namespace
}  // namespace imud
