#include "transports/capture/tcp_stream.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/support/allocations.hpp"

namespace imud {
namespace {

struct SegmentFlags {
  bool begins = false, ends = false, resets = false;
};

class TcpStreamTest : public ::testing::Test {
 protected:
  static Endpoint at(std::uint16_t port) {
    const std::uint32_t address = 0x0100007F;
    return Endpoint::ipv4(&address, port);
  }
  // A segment of the connection from `client` to port 5000.
  TcpSegment segment(std::uint32_t sequence, const std::string& payload, const SegmentFlags& flags = {}) const {
    return {TcpSegment::Outcome::whole,       at(client), at(5000), sequence, flags.begins, flags.ends, flags.resets,
            std::as_bytes(std::span(payload))};
  }
  static TcpSegment reversed(TcpSegment segment) {
    std::swap(segment.from, segment.to);
    return segment;
  }
  // Adds a segment. What is delivered is appended to `text`, with a | before each stream.
  bool push(const TcpSegment& segment) {
    const bool taken = stream.push(segment);
    drain();
    return taken;
  }
  bool push(std::uint32_t sequence, const std::string& payload, const SegmentFlags& flags = {}) {
    return push(segment(sequence, payload, flags));
  }
  void drain() {
    while (const auto piece = stream.next()) {
      if (piece->begins) text += '|';
      text.append(reinterpret_cast<const char*>(piece->bytes.data()), piece->bytes.size());
      EXPECT_FALSE(piece->bytes.empty());
    }
  }

  std::uint16_t client = 40000;
  TcpStream stream;
  std::string text;
};

constexpr bool yes = true, no = false;

TEST_F(TcpStreamTest, SegmentsInOrderAreDeliveredAtOnce) {
  EXPECT_FALSE(push(100, "", {yes}));
  EXPECT_FALSE(push(reversed(segment(900, "", {yes}))));
  EXPECT_TRUE(push(100, "abc"));
  EXPECT_EQ(text, "|abc");
  EXPECT_EQ(stream.from(), at(40000));
  EXPECT_FALSE(push(reversed(segment(900, "answer"))));
  EXPECT_FALSE(push(103, "")) << "an acknowledgement";
  EXPECT_TRUE(push(103, "def"));
  EXPECT_TRUE(push(106, "", {no, yes}));
  EXPECT_EQ(text, "|abcdef");
  EXPECT_EQ(stream.holes(), 0U);
}

TEST_F(TcpStreamTest, RepeatedBytesAreDropped) {
  push(100, "abcd");
  EXPECT_TRUE(push(100, "abcd"));
  EXPECT_TRUE(push(102, "cdef"));
  EXPECT_TRUE(push(99, "x")) << "a keep-alive";
  push(106, "g", {no, yes});
  EXPECT_FALSE(push(102, "cdef")) << "after the end";
  EXPECT_EQ(text, "|abcdefg");
}

TEST_F(TcpStreamTest, EarlySegmentsAreKept) {
  push(100, "", {yes});
  push(103, "def");
  push(108, "i");
  push(106, "gh");
  push(103, "def");
  push(105, "fghij");
  EXPECT_EQ(text, "");
  push(100, "abc");
  EXPECT_EQ(text, "|abcdefghij") << "also before the first";
  push(112, "mn", {no, yes});
  push(110, "kl");
  EXPECT_EQ(text, "|abcdefghijklmn");
  EXPECT_EQ(stream.holes(), 0U);
  EXPECT_FALSE(push(114, "")) << "it has ended";
}

TEST_F(TcpStreamTest, SequenceNumbersWrap) {
  push(0xFFFF'FFFE, "", {yes});
  push(2, "ef");
  push(0xFFFF'FFFE, "abcd");
  push(0xFFFF'FFFE, "ab");
  EXPECT_EQ(text, "|abcdef");
}

TEST_F(TcpStreamTest, AHoleEndsTheStreamWhenNoMoreIsKept) {
  push(100, "a");
  std::string expected = "|a|";
  for (std::uint32_t i = 0; i < TcpStream::most_held; ++i) {
    EXPECT_EQ(text, "|a");
    push(110 + 2 * i, "bc");
    expected += "bc";
  }
  EXPECT_EQ(text, expected);
  EXPECT_EQ(stream.holes(), 1U);
  push(101, "late");
  push(110 + 2 * TcpStream::most_held, "d");
  EXPECT_EQ(text, expected + "d");
}

TEST_F(TcpStreamTest, AHoleAtTheEnd) {
  push(100, "a");
  push(102, "c");
  push(104, "e");
  stream.finish();
  drain();
  EXPECT_EQ(text, "|a|c|e");
  EXPECT_EQ(stream.holes(), 2U);
  push(105, "", {no, yes});
  push(106, "f");
  push(200, "", {no, yes});
  EXPECT_EQ(text, "|a|c|e|f");
  stream.finish();
  drain();
  EXPECT_EQ(stream.holes(), 3U) << "the last bytes are missing";
}

TEST_F(TcpStreamTest, TheNextConnectionIsAnotherStream) {
  push(100, "", {yes});
  push(100, "ab", {no, yes});
  client = 40001;
  push(7, "", {yes});
  push(7, "cd");
  client = 40002;
  EXPECT_FALSE(push(1, "", {yes}));
  EXPECT_FALSE(push(1, "beside it"));
  client = 40001;
  push(9, "", {no, no, yes});
  client = 40002;
  push(10, "ef");
  EXPECT_EQ(text, "|ab|cd|ef");
}

// The same ports again, without an end of the connection before.
TEST_F(TcpStreamTest, AHandshakeEndsTheConnectionBefore) {
  push(100, "", {yes});
  push(100, "ab");
  push(100, "", {yes});  // repeated
  push(102, "cd");
  push(106, "gh");
  push(5000, "", {yes});
  push(5000, "ij");
  EXPECT_EQ(text, "|abcd|gh|ij");
  EXPECT_EQ(stream.holes(), 1U);
  push(5003, "", {no, yes});  // one byte is missing
  client = 40001;
  push(1, "", {yes});
  push(1, "kl");
  EXPECT_EQ(text, "|abcd|gh|ij|kl");
  EXPECT_EQ(stream.holes(), 2U);
}

TEST_F(TcpStreamTest, AConnectionWithoutAnEndEnds) {
  push(100, "ab");
  client = 40001;
  std::uint32_t sequence = 7;
  for (std::size_t i = 0; i <= TcpStream::most_held; ++i) EXPECT_FALSE(push(sequence++, "x"));
  EXPECT_TRUE(push(sequence, "cd"));
  EXPECT_EQ(text, "|ab|cd");
  for (int i = 0; i < 200; ++i) push(reversed(segment(static_cast<std::uint32_t>(i), "x")));
  push(sequence + 2, "ef");
  EXPECT_EQ(text, "|ab|cdef") << "answers are no other connection";
}

// The opposite direction shows the next connection, too.
TEST_F(TcpStreamTest, TheOtherEndsHandshakeEndsTheConnectionBefore) {
  push(reversed(segment(900, "", {yes})));
  push(100, "ab");
  push(reversed(segment(900, "", {yes})));
  push(102, "cd");
  push(reversed(segment(7000, "", {yes})));
  push(5000, "ef");
  EXPECT_EQ(text, "|abcd|ef");
}

TEST_F(TcpStreamTest, AnyOrderGivesTheBytesAndNothingIsAllocated) {
  std::uint32_t random = 1;
  const auto next = [&random] { return random = random * 1664525U + 1013904223U, random >> 8; };
  for (int round = 0; round < 300; ++round) {
    std::string sent(2000, '\0');
    for (char& c : sent) c = static_cast<char>('a' + next() % 26);
    const std::uint32_t first = next() * 16;
    TcpStream reassembled;
    std::string received;
    received.reserve(sent.size() + 1);
    // Pieces that overlap, swapped within a window.
    std::vector<std::pair<std::size_t, std::string>> pieces;
    for (std::size_t begin = 0; begin < sent.size();) {
      const std::size_t size = std::min<std::size_t>(1 + next() % 90, sent.size() - begin);
      const std::size_t back = std::min<std::size_t>(next() % 20, begin);
      pieces.emplace_back(begin - back, sent.substr(begin - back, size + back));
      begin += size;
    }
    for (std::size_t i = 0; i < pieces.size(); ++i)
      std::swap(pieces[i], pieces[std::min(i + next() % 12, pieces.size() - 1)]);
    const std::uint64_t before = allocations();
    reassembled.push(segment(first, "", {yes}));
    for (const auto& [offset, payload] : pieces) {
      reassembled.push(segment(first + static_cast<std::uint32_t>(offset), payload));
      while (const auto piece = reassembled.next())
        received.append(reinterpret_cast<const char*>(piece->bytes.data()), piece->bytes.size());
    }
    EXPECT_EQ(allocations(), before);
    EXPECT_EQ(reassembled.holes(), 0U);
    ASSERT_EQ(received, sent) << round;
  }
}

TEST_F(TcpStreamTest, AnySegmentsAreHarmless) {
  std::uint32_t random = 7;
  const auto next = [&random] { return random = random * 1664525U + 1013904223U, random >> 8; };
  const std::string payload(70'000, 'x');
  std::size_t delivered = 0;
  for (int i = 0; i < 200'000; ++i) {
    const std::uint32_t size = next() % 50 == 0 ? next() % 70'000 : next() % 20;
    client = static_cast<std::uint16_t>(40'000 + next() % 3);
    TcpSegment any = segment(next() % 10 == 0 ? next() << 9 : next() % 300, "");
    any.payload = std::as_bytes(std::span(payload)).first(size);
    any.begins = next() % 16 == 0;
    any.ends = next() % 16 == 0;
    any.resets = next() % 64 == 0;
    stream.push(next() % 4 == 0 ? reversed(any) : any);
    for (std::size_t pieces = 0; const auto piece = stream.next(); ++pieces) {
      ASSERT_LE(pieces, TcpStream::most_held);
      delivered += piece->bytes.size();
    }
  }
  EXPECT_GT(delivered, 100'000U);
}

}  // namespace
}  // namespace imud
