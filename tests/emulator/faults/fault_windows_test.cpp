// Every kind of fault on every target, through the bytes of whole runs: it acts from its first sample to its last,
// and outside of this window the bytes are those of the run without it, unless the kind names the state that stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "emulator/faults/fault_kinds.hpp"
#include "tests/emulator/every_quantity.hpp"

namespace imud {
namespace {

// The window: 40 samples of 5 ms.
constexpr std::uint64_t opens = 60, closes = 99;
constexpr double window_run_s = 0.8;

// The numbers of a fault with which it changes each sample: 1, or those below.
double telling_number(std::string_view target, std::string_view kind, std::string_view key) {
  static const std::map<std::string_view, double> by_key = {
      {"bytes_per_s", 1000}, {"frames_per_s", 500}, {"per_s", 50},    {"hz", 20},
      {"period_ms", 23},     {"percent", 90},       {"bitrate", 1e6}, {"delay_ms", 12},
      {"value_ppm", 1000},   {"value_s", 0.015},    {"factor", 3}};
  if (const auto found = by_key.find(key); found != by_key.end()) return found->second;
  if (key != "value") return 1;
  if (kind == "scale" || kind == "baud_wrong") return 2;
  if (target == "gyro") return 0.1;
  if (target == "magnetometer") return 1e-6;
  return target == "temperature" ? 2 : 1;
}

std::string in_window(const FaultKind& kind, std::string_view target) {
  std::string text = fmt::format("[[fault]]\ntarget = \"{}\"\nkind = \"{}\"\n", target, kind.name);
  // The samples of a fault of truth are truths: those of 0.30 s to 0.48 s.
  const bool is_truth = kind.seam == FaultSeam::truth;
  text += is_truth ? "at_s = 0.3\n" : fmt::format("at_sample = {}\n", opens);
  if (!kind.is_event) text += is_truth ? "for_s = 0.2\n" : fmt::format("for_samples = {}\n", closes - opens + 1);
  for (const FaultParameter& parameter : kind.parameters)
    text += fmt::format("{} = {}\n", parameter.key,
                        std::clamp(telling_number(target, kind.name, parameter.key), parameter.min, parameter.max));
  return text;
}

// Reach: the samples beside its window that a fault may change, and those in it that it need not change.
struct Reach {
  std::uint64_t before = 0, after = 0;  // samples
  std::uint64_t late = 0, early = 0;    // it begins to change samples so many after its first, or ends so many before
  bool is_visible = true;               // it changes something
};

constexpr std::uint64_t by_chance = 20;  // samples; with 50 events in a second on three axes: none in them by 3e-7

// The kinds with a state that stays, which their `stays` names, and for how many samples it does here. A kind that is
// added with such a state has to be added here.
const std::map<std::string_view, Reach> lasting = {
    // The message of 495 ms leaves at 507 ms, and those of 500 ms and 505 ms behind it.
    {"message.late", {.after = 2}},
    // That of 495 ms leaves at 22 times 23 ms, 506 ms.
    {"message.batched", {.after = 2}},
    // Bytes from the host are lost; the frames that leave do not depend on them here.
    {"wire.silence", {}},
    {"wire.baud_wrong", {}},
    {"wire.disconnect", {}},
    {"wire.bus_off", {}},
    // These devices start at once, have no settings, and no turn-on errors: DevicesStartAnew is of another one.
    {"power.off", {}},
    {"power.boot_loader", {}},
    {"power.brown_out", {.is_visible = false}},
    // A unit of a DBC file then sends the messages of the example, to the end.
    {"power.settings_lost", {.after = 1000}},
    {"power.slow_start", {.is_visible = false}},
    // Native has it in each sample.
    {"device.self_test_failed", {}},
    // The curves from the truth of 0.28 s and to that of 0.50 s end at wrong ones; the increments of sample 100 begin
    // on the last.
    {"truth.frozen", {.before = 3, .after = 1}},
    {"truth.jump", {.before = 3, .after = 1}},
    {"truth.nan", {.before = 3, .after = 1, .late = 4}},
    {"truth.lost", {.before = 3, .after = 1, .late = 4}},
    // The truth of a capture is waited for.
    {"truth.late", {.is_visible = false}},
};

// The kinds without such a state that do not change each sample of the window.
const std::map<std::string_view, Reach> partial = {
    {"drift", {.late = 1}},  // from 0 on
    {"vibration", {.late = 1, .early = 1}},
    {"spike", {.late = by_chance, .early = by_chance}},
    {"half_bandwidth", {.late = 1}},               // the first frame finds the line free
    {"temperature.stuck", {.is_visible = false}},  // it is constant here
};

class FaultWindows : public EveryQuantityTest {
 protected:
  // One axis is always saturated, so that there is a status to lie about.
  Unit unit(bool is_can) const {
    const std::string saturated = "accelerometer.max_m_per_s2 = 9\n";
    Unit chosen = is_can ? every_quantity_unit("imu1") : native_unit();
    const std::string range = "accelerometer.max_m_per_s2 = 100\n";
    chosen.text.replace(chosen.text.find(range), range.size(), saturated);
    return chosen;
  }

  struct Faulty {
    bool is_can;
    std::string name;                       // "gyro.bias"
    const std::vector<Unit>& units;         // one
    const std::vector<std::string>& clean;  // the frames of a run without the fault, by sample
  };
  // Calls `judge(kind, target, faulty)` for each kind and target that a unit on CAN or one of `native` can have.
  // Returns the number of calls.
  template <class Judge>
  std::size_t each_fault(const Judge& judge) {
    std::size_t calls = 0;
    for (const bool is_can : {true, false}) {
      const std::vector<Unit> units = {unit(is_can)};
      const std::vector<std::string> clean = run(units, "", window_run_s).sent[0];
      const Protocol& protocol = *find_protocol(is_can ? "dbc" : "native");
      for (const FaultKind* kind : fault_kinds()) {
        for (const std::string_view target : kind->targets) {
          if (!fault_objection(*kind, target, protocol, Settings(protocol.settings)).empty()) continue;
          const std::string name = fmt::format("{}.{}", target, kind->name);
          SCOPED_TRACE(fmt::format("{} on {}", name, protocol.name));
          ++calls;
          judge(*kind, target, Faulty{is_can, name, units, clean});
        }
      }
    }
    return calls;
  }
};

TEST_F(FaultWindows, OutsideTheBytesAreThoseOfTheRunWithout) {
  std::set<std::string_view> decided;
  const std::size_t rows = each_fault([&](const FaultKind& kind, std::string_view target, const Faulty& of) {
    const auto& [is_can, name, units, clean] = of;
    const auto state = lasting.find(name);
    ASSERT_EQ(state != lasting.end(), !kind.stays.empty())
        << "a kind states what stays, and its row in `lasting` for how long";
    const auto of_target = partial.find(name);
    const auto part = of_target != partial.end() ? of_target : partial.find(kind.name);
    Reach reach = state != lasting.end() ? state->second : part != partial.end() ? part->second : Reach{};
    if (state != lasting.end()) decided.insert(state->first);
    const bool is_carried = target != "magnetometer" && target != "barometer" && target != "gnss" &&
                            name != "truth.jump" && name != "power.settings_lost" &&
                            name != "message.other_settings";  // by native
    const Sampled faulty = run(units, in_window(kind, target), window_run_s);
    ASSERT_EQ(faulty.acted.size(), 1U);
    const std::uint64_t last = kind.is_event ? opens : closes;
    if (kind.seam != FaultSeam::truth) {
      EXPECT_EQ(faulty.acted[0].first, opens);
      EXPECT_EQ(faulty.acted[0].last, last);
    }
    std::uint64_t first_changed = clean.size(), last_changed = 0;
    for (std::uint64_t k = 0; k < clean.size(); ++k) {
      if (faulty.sent[0][k] == clean[k]) continue;
      first_changed = std::min(first_changed, k);
      last_changed = k;
    }
    if (first_changed == clean.size()) {
      EXPECT_TRUE(!reach.is_visible || (!is_can && !is_carried)) << "it changes nothing";
      return;
    }
    EXPECT_TRUE(reach.is_visible);
    EXPECT_GE(first_changed, opens - reach.before);
    EXPECT_LE(first_changed, opens + reach.late);
    EXPECT_LE(last_changed, last + reach.after);
    EXPECT_GE(last_changed, last - reach.early);
  });
  EXPECT_EQ(decided.size(), lasting.size()) << "a row of `lasting` is of no kind";
  EXPECT_GT(rows, 150U);
}

// At the begin of a ramp of 1e9 s there is no effect: a change of the numbers is 2e-10 of the change without the
// ramp, and an event has a probability below 1e-9 in a sample.
TEST_F(FaultWindows, ARampBeginsWithoutEffect) {
  std::size_t rows = 0;
  each_fault([&](const FaultKind& kind, std::string_view target, const Faulty& of) {
    const auto& [is_can, name_of_fault, units, clean] = of;
    const bool has_numbers = kind.seam == FaultSeam::sensor || kind.seam == FaultSeam::truth;
    if (!kind.is_ramped || (has_numbers && !is_can)) return;
    ++rows;
    const Sampled begun = run(units, in_window(kind, target) + "ramp_in_s = 1e9\n", window_run_s);
    EXPECT_EQ(begun.acted.size(), 1U);
    if (!has_numbers) {
      EXPECT_EQ(begun.sent[0], clean);
      return;
    }
    const Sampled whole = run(units, in_window(kind, target), window_run_s);
    std::map<std::string_view, double> change, without_ramp;  // the largest, SI
    for (std::uint64_t k = 0; k < clean.size(); ++k) {
      const auto now = quantities(begun.sent[0][k]), then = quantities(whole.sent[0][k]);
      for (const auto& [name, value] : quantities(clean[k])) {
        const double rounding = 1e-12 * std::max(1.0, std::abs(value));
        change[name] = std::max(change[name], std::abs(now.at(name) - value) - rounding);
        without_ramp[name] = std::max(without_ramp[name], std::abs(then.at(name) - value));
      }
    }
    for (const auto& [name, largest] : change) EXPECT_LE(largest, 1e-6 * without_ramp[name]) << name;
  });
  EXPECT_GT(rows, 40U);
}

// Wire and power take one step with each sample: 1000 bytes/s are five in 5 ms, and a start that takes 0.1 s longer
// takes twenty samples.
TEST_F(FaultWindows, ASampleCountsOnce) {
  const std::vector<std::string> clean = run({native_unit()}, "", window_run_s).sent[0];
  const auto faulty = [&](const std::string& faults) { return run({native_unit()}, faults, window_run_s).sent[0]; };
  const std::vector<std::string> garbage =
      faulty("[[fault]]\ntarget = \"wire\"\nkind = \"garbage\"\nbytes_per_s = 1000\nat_s = 0.3\nfor_s = 0.2\n");
  const std::vector<std::string> slow = faulty(
      "[[fault]]\ntarget = \"power\"\nkind = \"off\"\nat_s = 0.3\nfor_s = 0.1\n"
      "[[fault]]\ntarget = \"power\"\nkind = \"slow_start\"\nvalue_s = 0.1\n");
  for (std::uint64_t k = 0; k < clean.size(); ++k) {
    const bool is_within = k >= opens && k <= closes;
    ASSERT_EQ(garbage[k].size(), clean[k].size() + (is_within ? 5 : 0)) << k;
    ASSERT_TRUE(garbage[k].ends_with(clean[k])) << k;
    ASSERT_EQ(slow[k], is_within ? std::string() : clean[k]) << k;
  }
}

// A STIM300 sends the datagrams of its start-up again, each as long after the fault as after power on.
TEST_F(FaultWindows, ADeviceStartsAnew) {
  const std::vector<Unit> unit = {{"stim300", "protocol = \"stim300\"\nport = \"file:stim300\"\n", 2000}};
  for (const std::string kind : {"off", "boot_loader", "settings_lost"}) {
    const std::string duration = kind == "settings_lost" ? "" : "for_samples = 1000\n";
    const std::uint64_t again = duration.empty() ? 2000 : 3000;
    const std::vector<std::string> sent =
        run(unit, "[[fault]]\ntarget = \"power\"\nkind = \"" + kind + "\"\nat_sample = 2000\n" + duration, 3).sent[0];
    std::size_t datagrams = 0;
    for (std::uint64_t k = 2000; k < again; ++k) ASSERT_TRUE(sent[k].empty()) << k;
    for (std::uint64_t k = again; k < again + 2000; ++k) {
      ASSERT_EQ(sent[k].size(), sent[k - again].size()) << kind << ' ' << k;
      datagrams += sent[k].empty() ? 0 : 1;
    }
    EXPECT_GT(datagrams, 100U);
  }
}

}  // namespace
}  // namespace imud
