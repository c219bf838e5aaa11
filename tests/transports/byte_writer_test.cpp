#include "transports/byte_writer.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <memory>
#include <thread>

#include "tests/transports/numbered_frames.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

// The smallest possible pipe: one page.
class ByteWriterTest : public ::testing::Test {
 protected:
  ByteWriterTest() {
    int ends[2];
    if (::pipe2(ends, O_NONBLOCK | O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    out.reset(ends[0]);
    in.reset(ends[1]);
    ::fcntl(in.get(), F_SETPIPE_SZ, 4096);
  }
  void drain(std::size_t most) {
    std::vector<std::byte> bytes(most);
    const ssize_t size = ::read(out.get(), bytes.data(), bytes.size());
    if (size > 0) reader.feed(std::span(bytes).first(static_cast<std::size_t>(size)));
  }

  FileDescriptor in, out;
  ByteWriter writer;
  PortCounters counters;
  NumberedFrames frames;
  NumberedReader reader;
};

TEST_F(ByteWriterTest, SeveralFramesGoWhole) {
  EXPECT_EQ(writer.write(in.get(), frames.next(10), counters), 0);
  EXPECT_EQ(counters.sent, 10U);
  EXPECT_EQ(counters.dropped, 0U);
  drain(4096);
  EXPECT_EQ(reader.numbers.size(), 10U);
  EXPECT_EQ(reader.broken, 0U);
}

// A frame counts as what it is, although its rest leaves with others.
TEST_F(ByteWriterTest, RepliesAreCountedWhenTheirLastByteIsTaken) {
  std::uint64_t replies = 0, torn = 0;
  bool replies_pending = false;  // the rest is that of a reply
  for (int i = 0; i < 4000; ++i) {
    const std::size_t size = 1 + static_cast<std::size_t>(i) % 60;
    const bool are_replies = i % 3 == 0;
    const std::uint64_t sent = counters.sent, rest = writer.is_idle() ? 0 : 1;
    const bool rest_is_reply = rest != 0 && replies_pending;
    EXPECT_EQ(writer.write(in.get(), frames.next(size), counters, are_replies), 0);
    const std::uint64_t now = counters.sent - sent, of_rest = now > 0 ? rest : 0;
    replies += are_replies ? now - of_rest : 0;
    replies += rest_is_reply ? of_rest : 0;
    ASSERT_EQ(counters.replies, replies) << i;
    if (!writer.is_idle() && (now > 0 || rest == 0)) replies_pending = are_replies;
    torn += !writer.is_idle();
    drain(static_cast<std::size_t>(1 + i * 61 % 3000));
  }
  EXPECT_GT(torn, 500U);
  EXPECT_GT(counters.replies, 500U);
  EXPECT_LT(counters.replies, counters.sent / 2);
}

TEST_F(ByteWriterTest, ReaderThatTakesLittleGetsWholeFramesInOrder) {
  // A pipe accepts up to 4096 bytes whole or not at all, and more in part.
  std::size_t torn = 0;
  for (int i = 0; i < 4000; ++i) {
    EXPECT_EQ(writer.write(in.get(), frames.next(1 + static_cast<std::size_t>(i) % 60), counters), 0);
    torn += counters.sent + counters.dropped != frames.made();
    drain(static_cast<std::size_t>(1 + i * 61 % 3000));
  }
  EXPECT_GT(torn, 500U);
  EXPECT_GT(counters.dropped, 1000U);
  for (int i = 0; i < 10; ++i) {
    drain(65536);
    writer.write(in.get(), {}, counters);
  }
  EXPECT_EQ(reader.broken, 0U);
  EXPECT_EQ(reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), counters.sent);
  EXPECT_EQ(counters.sent + counters.dropped, frames.made());
}

TEST_F(ByteWriterTest, ReaderThatTakesMeanwhileGetsWholeFramesInOrder) {
  ::fcntl(out.get(), F_SETFL, 0);
  std::thread taking([this] {
    std::array<std::byte, 2500> bytes;
    for (ssize_t size = 1; size > 0;) {
      size = ::read(out.get(), bytes.data(), bytes.size());
      if (size > 0) reader.feed(std::span(bytes).first(static_cast<std::size_t>(size)));
    }
  });
  for (int i = 0; i < 5000; ++i) writer.write(in.get(), frames.next(60), counters);
  for (int i = 0; i < 1000 && counters.sent + counters.dropped != frames.made(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    writer.write(in.get(), {}, counters);
  }
  in.reset();
  taking.join();
  EXPECT_EQ(reader.broken + reader.unfinished(), 0U);
  EXPECT_EQ(reader.numbers.size(), counters.sent);
  EXPECT_EQ(counters.sent + counters.dropped, frames.made());
}

TEST_F(ByteWriterTest, FramesApartInMemoryGoToo) {
  std::vector<std::unique_ptr<NumberedFrames>> makers;
  std::vector<Frame> apart;
  for (int i = 0; i < 200; ++i) {
    makers.push_back(std::make_unique<NumberedFrames>());
    makers.back()->next(static_cast<std::size_t>(i % 60));
    apart.push_back(makers.back()->next(1)[0]);
  }
  ::fcntl(in.get(), F_SETPIPE_SZ, 65536);
  EXPECT_EQ(writer.write(in.get(), apart, counters), 0);
  EXPECT_EQ(counters.sent, 200U);
  std::size_t size = 0;
  for (const Frame& frame : apart) size += frame.bytes.size();
  std::vector<std::byte> bytes(65536);
  EXPECT_EQ(::read(out.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(size));
}

TEST_F(ByteWriterTest, EmptyFramesCountAndHoldNothingUp) {
  const std::vector<Frame> nothing(5);
  EXPECT_EQ(writer.write(in.get(), nothing, counters), 0);
  EXPECT_EQ(counters.sent, 5U);
}

TEST_F(ByteWriterTest, FrameLongerThanTheLimitIsDroppedAloneAndWhole) {
  const std::vector<std::byte> much(ByteWriter::max_frame + 1);
  const auto made = frames.next(2);
  const std::vector<Frame> mixed = {made[0], Frame{much}, made[1]};
  EXPECT_EQ(writer.write(in.get(), mixed, counters), 0);
  EXPECT_EQ(counters.sent, 2U);
  EXPECT_EQ(counters.dropped, 1U);
  drain(4096);
  EXPECT_EQ(reader.numbers, (std::vector<std::uint32_t>{0, 1}));
}

TEST_F(ByteWriterTest, FailureIsReportedAndTheRestCanBeDropped) {
  while (counters.dropped == 0) writer.write(in.get(), frames.next(60), counters);
  EXPECT_EQ(counters.sent + counters.dropped, frames.made() - 1) << "one is taken in part";
  out.reset();
  std::signal(SIGPIPE, SIG_IGN);
  EXPECT_EQ(writer.write(in.get(), frames.next(1), counters), EPIPE);
  writer.discard(counters);
  writer.discard(counters);
  std::signal(SIGPIPE, SIG_DFL);
  EXPECT_EQ(counters.sent + counters.dropped, frames.made());
}

}  // namespace
}  // namespace imud
