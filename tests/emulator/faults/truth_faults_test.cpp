// Faults of truth at the end of a connection.
#include "emulator/faults/truth_faults.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <vector>

#include "emulator/faults/fault_kinds.hpp"

namespace imud {
namespace {

// Returns the truths that a test gives it.
class GivenTruths final : public TruthDecoder {
 public:
  explicit GivenTruths(std::deque<Truth>& truths) : truths_(truths) {}
  void feed(std::span<const std::byte>, TruthInput, HostTime) noexcept override {}
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    if (truths_.empty()) return std::nullopt;
    truth = truths_.front();
    truths_.pop_front();
    return TruthResult::ok;
  }

 private:
  std::deque<Truth>& truths_;
};

std::vector<std::int64_t> taken(TruthDecoder& decoder) {
  std::vector<std::int64_t> times;
  Truth truth;
  while (const auto result = decoder.next(truth)) {
    if (*result == TruthResult::ok) times.push_back(truth.time.ns);
    EXPECT_TRUE(*result == TruthResult::ok || *result == TruthResult::withheld) << cause(*result);
  }
  return times;
}

// Truths 2 and 3 wait for two others when the connection is lost: they are lost with it, and do not come before the
// first truth of the next one.
TEST(TruthFaultsTest, TruthsThatAreLateAtTheEndAreLost) {
  FaultConfig late;
  late.name = "late";
  late.kind = find_fault_kind("late", "truth");
  ASSERT_NE(late.kind, nullptr);
  late.imus = {std::string(fault_of_truth)};
  late.parameters[0].a = 2;
  late.begin_sample = 2;
  late.samples = 2;
  const std::vector<FaultConfig> faults = {late};
  FaultLog log;
  std::deque<Truth> given;
  const auto give = [&given](int first, int last) {
    for (int i = first; i <= last; ++i) given.emplace_back().time = TruthTime{i};
  };
  TruthFaults* all = nullptr;
  const auto decoder = with_faults(std::make_unique<GivenTruths>(given), faults, 1, log, 0, all);
  ASSERT_NE(all, nullptr);
  give(0, 3);
  EXPECT_EQ(taken(*decoder), (std::vector<std::int64_t>{0, 1}));
  decoder->finish();
  EXPECT_EQ(taken(*decoder), (std::vector<std::int64_t>{}));
  give(4, 6);
  EXPECT_EQ(taken(*decoder), (std::vector<std::int64_t>{4, 5, 6}));

  // Without an end the two follow at once.
  TruthFaults* others = nullptr;
  const auto whole = with_faults(std::make_unique<GivenTruths>(given), faults, 1, log, 0, others);
  give(0, 3);
  EXPECT_EQ(taken(*whole), (std::vector<std::int64_t>{0, 1}));
  give(4, 6);
  EXPECT_EQ(taken(*whole), (std::vector<std::int64_t>{2, 3, 4, 5, 6}));
}

}  // namespace
}  // namespace imud
