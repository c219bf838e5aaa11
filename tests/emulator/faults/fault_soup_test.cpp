// All kinds of faults at random over a long flight: nothing breaks, and where none acts the output is right.
// IMUD_SOUP_SECONDS=600 sets the length; 30 s without it.
#include "tests/emulator/faults/fault_soup.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "tests/emulator/every_quantity.hpp"

namespace imud {
namespace {

// The samples before the first and after the last of an occurrence that it may change, for the kinds whose state
// stays.
struct SoupReach {
  std::uint64_t before = 0, after = 0;
};
SoupReach soup_reach(const FaultKind& kind, std::span<const double> parameters, double rate_hz) {
  const auto samples = [&](double seconds) { return static_cast<std::uint64_t>(std::ceil(seconds * rate_hz)) + 1; };
  // Frames that are withheld leave at their time.
  if (kind.name == "late" && kind.seam == FaultSeam::message)
    return {0, samples(1e-3 * (parameters[0] + parameters[1]))};
  if (kind.name == "batched") return {0, samples(1e-3 * parameters[0])};
  // A start that has begun takes as long.
  if (kind.name == "slow_start") return {0, samples(parameters[0])};
  return {};
}

class FaultSoupTest : public EveryQuantityTest {};

TEST_F(FaultSoupTest, WhereNoFaultActsTheOutputIsRight) {
  const char* const given = std::getenv("IMUD_SOUP_SECONDS");
  const int epochs = std::max(1, static_cast<int>((given != nullptr ? std::atof(given) : 30) / FaultSoup::epoch_s));
  const double seconds = FaultSoup::epoch_s * epochs;
  const std::vector<Unit> units = {native_unit("imu1"), every_quantity_unit("imu2")};
  FaultSoup soup(17, {{"imu1", "native"}, {"imu2", "dbc", true}});
  const std::string text = soup.text(epochs);
  const Sampled clean = run(units, "", seconds), faulty = run(units, text, seconds);

  std::set<const FaultKind*> kinds;
  for (const Acted& one : faulty.acted) kinds.insert(one.kind);
  if (epochs > 1) {
    EXPECT_EQ(kinds.size(), fault_kinds().size());
  }
  std::uint64_t busy = 0, changed = 0, free = 0;
  for (std::size_t i = 0; i < units.size(); ++i) {
    const double rate_hz = units[i].rate_hz, per_truth = rate_hz / truth_rate_hz;
    std::vector<bool> is_busy(clean.sent[i].size());
    for (const Acted& one : faulty.acted) {
      const SoupReach reach = soup_reach(*one.kind, one.parameters, rate_hz);
      double first = static_cast<double>(one.first) - static_cast<double>(reach.before);
      double last = static_cast<double>(one.last + reach.after);
      if (one.kind->seam == FaultSeam::truth) {  // from the last right truth to the next, and the increments after it
        first = (static_cast<double>(one.first) - 1) * per_truth + 1;
        last = (static_cast<double>(one.last) + 1) * per_truth + 1;
      } else if (one.imu != units[i].name) {
        continue;
      }
      for (double k = std::max(0.0, first); k <= last && k < static_cast<double>(is_busy.size()); ++k)
        is_busy[static_cast<std::size_t>(k)] = true;
    }
    for (std::size_t k = 0; k < is_busy.size(); ++k) {
      const bool is_equal = faulty.sent[i][k] == clean.sent[i][k];
      ++(is_busy[k] ? busy : free);
      changed += is_equal ? 0 : 1;
      ASSERT_TRUE(is_busy[k] || is_equal) << units[i].name << ", sample " << k << '\n' << text;
    }
    // The last second of each epoch has no fault.
    for (int epoch = 1; epoch <= epochs; ++epoch)
      ASSERT_FALSE(is_busy[static_cast<std::size_t>((FaultSoup::epoch_s * epoch - 1) * rate_hz)]);
  }
  fmt::print("{} faults of {} kinds over {:g} s: {} samples beside them, {} of {} with them changed\n",
             faulty.acted.size(), kinds.size(), seconds, free, changed, busy);
  EXPECT_GT(2 * changed, busy);
}

// The values that leave are within the range of the sensor, whatever it is that fails.
TEST_F(FaultSoupTest, ValuesStayWithinTheRange) {
  FaultSoup soup(23, {{"imu1", "native"}});
  const Sampled faulty = run({native_unit("imu1")}, soup.text(1), FaultSoup::epoch_s);
  std::vector<bool> is_forged(faulty.sent[0].size());
  for (const Acted& one : faulty.acted)
    if (one.kind->name == "content_wrong")
      std::fill(is_forged.begin() + static_cast<std::ptrdiff_t>(one.first),
                is_forged.begin() + static_cast<std::ptrdiff_t>(one.last + 1), true);
  struct Sink final : MeasurementSink {
    void on_measurement(const Measurement& measurement) override { all.push_back(measurement.sample); }
    std::vector<Sample> all;
  } sink;
  const std::unique_ptr<Decoder> decoder = find_protocol("native")->make_decoder(Settings());
  std::size_t checked = 0;
  for (std::size_t k = 0; k < faulty.sent[0].size(); ++k) {
    sink.all.clear();
    const auto bytes = std::as_bytes(std::span(faulty.sent[0][k]));
    decoder->feed(Frame{bytes}, sink);
    for (const Sample& sample : sink.all) {
      if (is_forged[k]) continue;
      ASSERT_LE(sample.rate.cwiseAbs().maxCoeff(), 10) << k;
      ASSERT_LE(sample.specific_force.cwiseAbs().maxCoeff(), 100) << k;
      ++checked;
    }
  }
  EXPECT_GT(checked, 1000U);
}

}  // namespace
}  // namespace imud
