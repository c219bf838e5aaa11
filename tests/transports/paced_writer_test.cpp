// The instants at which characters are written: they are exact, as the writer has no clock of its own.
#include "transports/uart/paced_writer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "tests/transports/numbered_frames.hpp"

namespace imud {
namespace {

constexpr HostTime begin{1'000'000'000};

// Writes every portion at the time at which the writer has it ready.
class PacedWriting : public testing::Test {
 protected:
  Nanoseconds longest_wait = std::chrono::hours(1);
  void queue(std::size_t size, Nanoseconds at, const UartSettings& line = {10'000}) {
    std::vector<std::byte> bytes(size);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(made_++);
    const Frame frame{bytes};
    writer_->queue({&frame, 1}, line, begin + at, longest_wait, counters_);
  }
  // Writes every portion up to `until`; returns the time and number of characters of each.
  std::vector<std::pair<std::int64_t, std::size_t>> run(Nanoseconds until = std::chrono::hours(1)) {
    std::vector<std::pair<std::int64_t, std::size_t>> all;
    while (const auto due = writer_->next_flush()) {
      if (*due > begin + until) break;
      EXPECT_TRUE(writer_->ready(*due - Nanoseconds(1)).empty());
      std::size_t together = 0;
      for (auto bytes = writer_->ready(*due); !bytes.empty(); bytes = writer_->ready(*due)) {
        for (const std::byte byte : bytes) EXPECT_EQ(byte, static_cast<std::byte>(seen_++));
        together += bytes.size();
        writer_->written(bytes.size(), *due, counters_);
      }
      all.emplace_back((*due - begin).count() / 1000, together);
    }
    return all;
  }
  using Portions = std::vector<std::pair<std::int64_t, std::size_t>>;  // us, characters

  std::unique_ptr<PacedWriter> writer_ = std::make_unique<PacedWriter>();
  PortCounters counters_;
  unsigned made_ = 0, seen_ = 0;
};

using std::chrono::microseconds;

TEST_F(PacedWriting, ARepliesLastCharacterCountsIt) {
  const std::array<std::byte, 20> bytes{};
  const Frame frame{bytes};
  for (const bool is_reply : {false, true, false})
    writer_->queue({&frame, 1}, {10'000}, begin, longest_wait, counters_, is_reply);
  for (const auto& [characters, replies] : {std::pair{14U, 0U}, {28U, 0U}, {42U, 1U}, {60U, 1U}}) {
    const HostTime now = begin + std::chrono::milliseconds(characters);
    for (auto some = writer_->ready(now); !some.empty(); some = writer_->ready(now))
      writer_->written(some.size(), now, counters_);
    EXPECT_EQ(counters_.replies, replies);
    EXPECT_EQ(counters_.sent, characters / 20);
  }
}

TEST_F(PacedWriting, FourteenAtATimeAndTheEnd) {
  // Ten bits at 10 kbit/s: a millisecond for each character.
  queue(30, microseconds(0));
  EXPECT_EQ(run(), (Portions{{14'000, 14}, {28'000, 14}, {30'000, 2}}));
  EXPECT_EQ(counters_.sent, 1U);
  EXPECT_TRUE(writer_->is_idle());
  EXPECT_EQ(writer_->next_flush(), std::nullopt);
}

TEST_F(PacedWriting, ACharacterHasStartParityAndStopBits) {
  queue(1, microseconds(0), {12'000, Parity::even, 2});  // 12 bits
  EXPECT_EQ(run(), (Portions{{1000, 1}}));
  queue(14, microseconds(5000), {115'200});  // 140 / 115200 s = 1215.3 us
  EXPECT_EQ(run(), (Portions{{6215, 14}}));
}

TEST_F(PacedWriting, AFrameBeginsWhenTheOneBeforeIsOut) {
  queue(10, microseconds(0));
  queue(10, microseconds(2000));  // begins at 10 ms
  EXPECT_EQ(run(microseconds(20'000)), (Portions{{14'000, 14}, {20'000, 6}}));
  queue(5, microseconds(50'000));  // the line was idle
  queue(1, microseconds(50'000));
  EXPECT_EQ(run(), (Portions{{56'000, 6}}));
  EXPECT_EQ(counters_.sent, 4U);
}

TEST_F(PacedWriting, WhatIsQueuedGoesOutAtTheOldRate) {
  queue(20, microseconds(0));
  queue(20, microseconds(0), {20'000});  // begins at 20 ms, half a millisecond each
  EXPECT_EQ(run(), (Portions{{14'000, 14}, {24'000, 14}, {30'000, 12}}));
}

TEST_F(PacedWriting, LateIsAsMuchAsThenHasCome) {
  queue(100, microseconds(0));
  EXPECT_EQ(writer_->ready(begin + microseconds(43'999)).size(), 42U);
}

TEST_F(PacedWriting, WhatDoesNotFitIsDroppedWhole) {
  queue(PacedWriter::max_characters - 10, microseconds(0));
  queue(11, microseconds(0));
  EXPECT_EQ(counters_.dropped, 1U);
  made_ -= 11;
  queue(10, microseconds(0));
  queue(1, microseconds(0));
  made_ -= 1;
  EXPECT_EQ(counters_.dropped, 2U);
  run();
  EXPECT_EQ(seen_, PacedWriter::max_characters);
  EXPECT_EQ(counters_.sent, 2U);

  for (std::size_t i = 0; i <= PacedWriter::max_frames; ++i) queue(1, microseconds(0));
  EXPECT_EQ(counters_.dropped, 3U);
  made_ -= 1;
  run();
  EXPECT_EQ(counters_.sent, 2U + PacedWriter::max_frames);
}

TEST_F(PacedWriting, AFullKernelIsTriedAgain) {
  queue(30, microseconds(0));
  const HostTime due = *writer_->next_flush();
  ASSERT_EQ(writer_->ready(due).size(), 14U);
  writer_->written(3, due, counters_);
  EXPECT_EQ(*writer_->next_flush(), due + microseconds(1000));
  EXPECT_EQ(writer_->ready(due).size(), 11U);
  seen_ = 3;
  EXPECT_EQ(counters_.sent, 0U);
  writer_->written(0, due, counters_);
  writer_->discard(counters_);
  EXPECT_EQ(counters_.dropped, 1U);
  EXPECT_EQ(writer_->next_flush(), std::nullopt);
  seen_ = made_;
  queue(1, microseconds(2000));  // the line is free immediately
  EXPECT_EQ(run(), (Portions{{3000, 1}}));
}

// The ring wraps many times, at any speed and in any format, with pauses.
TEST_F(PacedWriting, EveryFrameComesWholeAndInOrder) {
  NumberedFrames frames;
  NumberedReader reader;
  HostTime now = begin;
  std::uint64_t characters = 0;
  for (int i = 0; i < 3000; ++i) {
    const unsigned baud = 50U + static_cast<unsigned>(i) * 1301 % 4'000'000;
    const UartSettings line{baud, static_cast<Parity>(i % 3), i % 14 < 7 ? 1U : 2U};
    writer_->queue(frames.next(1 + static_cast<std::size_t>(i) % 5), line, now, longest_wait, counters_);
    for (int k = 0; k < i % 40; ++k) {
      if (const auto due = writer_->next_flush()) now = std::max(now, *due);
      for (auto bytes = writer_->ready(now); !bytes.empty(); bytes = writer_->ready(now)) {
        const std::size_t taken = (i % 3 == 0) ? (bytes.size() + 1) / 2 : bytes.size();
        reader.feed(bytes.first(taken));
        characters += taken;
        writer_->written(taken, now, counters_);
      }
    }
    now = now + microseconds(i % 1000);
  }
  EXPECT_EQ(reader.broken, 0U);
  EXPECT_EQ(reader.numbers.size(), counters_.sent);
  EXPECT_GT(characters, 5 * PacedWriter::max_characters);
  writer_->discard(counters_);
  EXPECT_EQ(counters_.sent + counters_.dropped, frames.made());
}

// 10 characters take 10 ms. A frame that would begin after the longest wait is dropped, whatever its length.
TEST_F(PacedWriting, WhatWouldWaitTooLongIsDropped) {
  longest_wait = std::chrono::milliseconds(15);
  queue(10, microseconds(0));
  queue(100, microseconds(0));
  queue(1, microseconds(0));
  EXPECT_EQ(counters_.dropped, 1U);
  longest_wait = std::chrono::milliseconds(200);
  --made_;
  queue(1, microseconds(0));
  run();
  EXPECT_EQ(counters_.sent, 3U);
}

}  // namespace
}  // namespace imud
