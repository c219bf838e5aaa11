// The instants at which frames may be sent to a CAN interface: they are exact, as the queue has no clock of its own.
#include "transports/can/can_queue.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace imud {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr HostTime start{1'000'000'000};

class CanQueueTest : public testing::Test {
 protected:
  // Queues `count` frames together, with consecutive numbers.
  void queue(std::size_t count, Nanoseconds at, Nanoseconds spacing = Nanoseconds{0}) {
    for (std::size_t i = 0; i < count; ++i) {
      CanQueue::Queued queued{};
      queued.frame.can_id = made_++;
      queued.first = i == 0;
      queued.since = start + at;
      queued.spacing = spacing;
      queue_.push(queued);
    }
  }
  // Returns the frames that are sent at `at` to an interface that accepts at most `room`.
  std::vector<canid_t> leave(Nanoseconds at, std::size_t room = CanQueue::max_frames) {
    std::vector<canid_t> left;
    const std::size_t count = std::min(queue_.ready(start + at), room);
    for (std::size_t i = 0; i < count; ++i) left.push_back(queue_[i].frame.can_id);
    queue_.sent(count, start + at);
    return left;
  }
  static std::vector<canid_t> numbers(canid_t first, canid_t end) {
    std::vector<canid_t> all;
    while (first < end) all.push_back(first++);
    return all;
  }
  std::optional<Nanoseconds> next() const {
    const auto at = queue_.next();
    return at ? std::optional(*at - start) : std::nullopt;
  }

  CanQueue queue_{milliseconds(100)};
  canid_t made_ = 0;
};

TEST_F(CanQueueTest, UnpacedFramesLeaveAtOnceAndInOrder) {
  EXPECT_TRUE(queue_.is_empty());
  EXPECT_EQ(queue_.next(), std::nullopt);
  EXPECT_EQ(queue_.ready(start), 0U);
  for (int round = 0; round < 10; ++round) {  // the ring wraps
    const canid_t first = made_;
    queue(60, milliseconds(round));
    queue(40, milliseconds(round));
    EXPECT_EQ(queue_.room(), CanQueue::max_frames - 100);
    EXPECT_LE(next().value(), milliseconds(round));
    EXPECT_EQ(leave(milliseconds(round)), numbers(first, first + 100));
    EXPECT_TRUE(queue_.is_empty());
    EXPECT_EQ(queue_.next(), std::nullopt);
  }
}

// The interface has room for ten frames, which the bus sends slowly.
TEST_F(CanQueueTest, AFullInterfaceIsTriedAgainAfterAPause) {
  queue(15, milliseconds(0));
  EXPECT_EQ(leave(milliseconds(0), 10), numbers(0, 10));
  queue_.interface_full(start);
  EXPECT_EQ(next(), CanQueue::retry_pause);
  EXPECT_EQ(queue_.ready(start + CanQueue::retry_pause - Nanoseconds(1)), 0U);
  EXPECT_EQ(leave(CanQueue::retry_pause, 2), numbers(10, 12));
  queue_.interface_full(start + CanQueue::retry_pause);
  queue(3, CanQueue::retry_pause);
  EXPECT_EQ(leave(2 * CanQueue::retry_pause), numbers(12, 18)) << "what came later leaves later";
}

// A frame that has left shows that there is room: the pause has ended, also by a clock that was held up.
TEST_F(CanQueueTest, AFrameThatLeavesEndsThePause) {
  queue(4, milliseconds(0));
  queue_.interface_full(start);
  EXPECT_EQ(leave(CanQueue::retry_pause, 2), numbers(0, 2));
  EXPECT_LT(next().value(), CanQueue::retry_pause) << "at once";
  EXPECT_EQ(queue_.ready(start + CanQueue::retry_pause - Nanoseconds(1)), 2U);
  queue_.interface_full(start + CanQueue::retry_pause);
  EXPECT_EQ(leave(CanQueue::retry_pause), numbers(0, 0)) << "no frame leaves within the pause";
  EXPECT_EQ(next(), 2 * CanQueue::retry_pause) << "so that it goes on";
}

TEST_F(CanQueueTest, PacedFramesKeepTheirSpacing) {
  queue(1, milliseconds(0), milliseconds(2));
  EXPECT_EQ(leave(milliseconds(0)).size(), 1U);
  // An idle queue has saved up max_burst: 5 ms for frames of 2 ms.
  queue(6, milliseconds(100), milliseconds(2));
  EXPECT_LE(next().value(), milliseconds(100));
  EXPECT_EQ(leave(milliseconds(100)), numbers(1, 4)) << "as at 95, 97 and 99 ms";
  EXPECT_EQ(next(), milliseconds(101));
  EXPECT_EQ(leave(microseconds(100'999)), numbers(0, 0));
  EXPECT_EQ(leave(milliseconds(101)), numbers(4, 5));
  EXPECT_EQ(leave(milliseconds(102)), numbers(0, 0));
  EXPECT_EQ(next(), milliseconds(103));
  EXPECT_EQ(leave(milliseconds(104)), numbers(5, 6));
  EXPECT_EQ(next(), milliseconds(105)) << "what was late does not shift what follows";
  EXPECT_EQ(leave(milliseconds(105)), numbers(6, 7));
}

TEST_F(CanQueueTest, APacedQueueIsNeverFasterThanItsRateButForABurst) {
  constexpr Nanoseconds spacing = microseconds(200);
  std::size_t left = 0;
  Nanoseconds at{0};
  for (int step = 0; step < 1000; ++step) {
    at += microseconds(37 * (step % 50));  // flushed irregularly, sometimes late
    if (queue_.room() >= 50) queue(50, at, spacing);
    left += leave(at).size();
    ASSERT_LE(spacing * left, at + CanQueue::max_burst + spacing) << step;
  }
  EXPECT_GT(spacing * left, at * 9 / 10) << "nor slower";
}

TEST_F(CanQueueTest, SpacingFollowsEachFrame) {
  queue(1, milliseconds(0), milliseconds(50));
  queue(1, milliseconds(0), milliseconds(10));
  queue(1, milliseconds(0), milliseconds(10));
  EXPECT_EQ(leave(milliseconds(0)), numbers(0, 1));
  EXPECT_EQ(next(), milliseconds(45));
  EXPECT_EQ(leave(milliseconds(45)), numbers(1, 2));
  EXPECT_EQ(next(), milliseconds(55));
}

TEST_F(CanQueueTest, StaleFramesAreDroppedTogetherUnlessTheFirstHasLeft) {
  queue(3, milliseconds(0));
  queue(2, milliseconds(1));
  queue(4, milliseconds(60));
  EXPECT_EQ(leave(milliseconds(2), 1), numbers(0, 1));
  EXPECT_EQ(queue_.drop_stale(start + milliseconds(101)), 0U) << "100 ms old is not older";
  EXPECT_EQ(queue_.drop_stale(start + milliseconds(150)), 2U) << "those behind the one begun";
  EXPECT_EQ(queue_.room(), CanQueue::max_frames - 6);
  EXPECT_EQ(leave(milliseconds(150)), (std::vector<canid_t>{1, 2, 5, 6, 7, 8}));
  queue(5, milliseconds(150));
  queue(5, milliseconds(151));
  EXPECT_EQ(queue_.drop_stale(start + milliseconds(300)), 10U);
  EXPECT_TRUE(queue_.is_empty());
}

TEST_F(CanQueueTest, NothingIsStaleWithoutAnAge) {
  CanQueue patient(Nanoseconds::max());
  CanQueue::Queued queued{};
  queued.first = true;
  patient.push(queued);
  EXPECT_EQ(patient.drop_stale(HostTime{} + std::chrono::hours(24 * 365 * 30)), 0U);
}

TEST_F(CanQueueTest, DropsWhatTheInterfaceRefusesAndAll) {
  queue(3, milliseconds(0));
  queue_.drop_first();
  EXPECT_EQ(leave(milliseconds(0), 1), numbers(1, 2));
  EXPECT_EQ(queue_.clear(), 1U);
  EXPECT_TRUE(queue_.is_empty());
  EXPECT_EQ(queue_.clear(), 0U);
  queue(CanQueue::max_frames, milliseconds(0));
  EXPECT_EQ(queue_.room(), 0U);
  EXPECT_EQ(leave(milliseconds(0)), numbers(3, 3 + CanQueue::max_frames));
}

}  // namespace
}  // namespace imud
