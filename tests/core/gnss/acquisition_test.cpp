// The time of a receiver's search.
#include "core/gnss/acquisition.hpp"

#include <gtest/gtest.h>

namespace imud {
namespace {

// At 10 Hz.
TEST(Acquisition, SearchesAfterPowerOnAndAfterAnOutage) {
  GnssModel model;
  EXPECT_FALSE(Acquisition(model, 10).is_on());
  model.first_fix_s = 3;
  model.reacquire_s = 1;
  Acquisition receiver(model, 10);
  EXPECT_TRUE(receiver.is_on());
  const auto samples_without = [&receiver] {
    int count = 0;
    for (; count < 100; ++count) {
      Navigation fix;
      fix.is_known = true;
      receiver.take(fix);
      if (fix.is_known) break;
    }
    return count;
  };
  const auto lose = [&receiver](int samples) {
    for (int i = 0; i < samples; ++i) {
      Navigation none;
      receiver.take(none);
      EXPECT_FALSE(none.is_known);
    }
  };
  EXPECT_EQ(samples_without(), 30);
  EXPECT_EQ(samples_without(), 0);
  lose(5);
  EXPECT_EQ(samples_without(), 10);
  receiver.power_on();
  for (int i = 0; i < 20; ++i) {
    Navigation fix;
    fix.is_known = true;
    receiver.take(fix);
    EXPECT_FALSE(fix.is_known);
  }
  lose(1);  // the search begins again
  EXPECT_EQ(samples_without(), 30);
  model.reacquire_s = 2;
  Acquisition other(model, 10);
  other.continue_from(receiver, true);
  receiver = other;
  EXPECT_EQ(samples_without(), 0);
  lose(1);
  EXPECT_EQ(samples_without(), 20);
  // The times of a receiver that has had a fix without a search; and of one whose outage has not ended.
  Acquisition later(model, 10);
  later.continue_from(Acquisition({}, 10), true);
  receiver = later;
  EXPECT_EQ(samples_without(), 0);
  later.continue_from(receiver, false);
  receiver = later;
  lose(1);
  EXPECT_EQ(samples_without(), 20);
}

}  // namespace
}  // namespace imud
