#include "tools/truth/datagram_faults.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace imud {
namespace {

std::vector<DatagramFaults::Fate> fates(const DatagramFaults::Rates& rates) {
  DatagramFaults faults(rates);
  std::vector<DatagramFaults::Fate> all;
  for (std::size_t i = 0; i < 1000; ++i) all.push_back(faults.next(i % 300));
  return all;
}

// Which datagrams have a fault depends only on the rate of that fault.
TEST(DatagramFaults, AreIndependentOfOneAnother) {
  for (unsigned others = 0; others < 32; ++others) {
    const auto rate = [others](unsigned fault) { return (others >> fault & 1U) != 0 ? 30.0 : 0.0; };
    const DatagramFaults::Rates mixed{.drop_percent = rate(0),
                                      .duplicate_percent = rate(1),
                                      .reorder_percent = rate(2),
                                      .corrupt_percent = rate(3),
                                      .jitter_ms = rate(4)};
    const auto all = fates(mixed);
    const auto dropped = fates({.drop_percent = rate(0)}), duplicated = fates({.duplicate_percent = rate(1)}),
               reordered = fates({.reorder_percent = rate(2)}), corrupted = fates({.corrupt_percent = rate(3)}),
               delayed = fates({.jitter_ms = rate(4)});
    unsigned struck = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_EQ(all[i].drop, dropped[i].drop) << others << ' ' << i;
      ASSERT_EQ(all[i].duplicate, duplicated[i].duplicate) << others << ' ' << i;
      ASSERT_EQ(all[i].reorder, reordered[i].reorder) << others << ' ' << i;
      ASSERT_EQ(all[i].corrupt, corrupted[i].corrupt) << others << ' ' << i;
      ASSERT_EQ(all[i].bit, corrupted[i].bit) << others << ' ' << i;
      ASSERT_EQ(all[i].delay, delayed[i].delay) << others << ' ' << i;
      ASSERT_TRUE(!all[i].corrupt || all[i].bit < 8 * (i % 300));
      struck += all[i].drop + all[i].duplicate + all[i].reorder + all[i].corrupt + (all[i].delay.count() > 0);
    }
    EXPECT_EQ(struck > 200, others != 0);
  }
}

}  // namespace
}  // namespace imud
