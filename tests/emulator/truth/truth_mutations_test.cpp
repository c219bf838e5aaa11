// Damaged records of the formats without a checksum: how many are taken with another value without a word.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "emulator/truth/truth_intake.hpp"

namespace imud {
namespace {

class FilePort final : public Port {
 public:
  explicit FilePort(std::string text) : text_(std::move(text)) {}
  void send(std::span<const Frame>) noexcept override {}
  std::optional<Received> receive() noexcept override {
    if (std::exchange(is_read_, true)) return std::nullopt;
    return Received{{std::as_bytes(std::span(text_))}, {}, {}};
  }
  bool at_end() const noexcept override { return is_read_; }

 private:
  std::string text_;
  bool is_read_ = false;
};

// The motion at 100 Hz: an aircraft in a turn, at 47.5 N 8.5 E.
struct Motion {
  double t, yaw, v, north, east;
  Vector3 rate, force;
};
Motion motion(int i) {
  const double t = 0.01 * i, w = 0.25, v = 52.75, yaw = 0.5 + w * t;
  return {
      t, yaw, v, v / w * std::sin(yaw), -v / w * std::cos(yaw), {0.0125, -0.015625, w}, {0.28125, v * w, -9.8125}};
}

struct Format {
  std::string name, head;
  std::string (*record)(const Motion& m);
  int most = 0;  // without a word, of 600
};
const Format formats[] = {
    {"csv",
     "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,r_BN_N_x,r_BN_N_y,r_BN_N_z,"
     "v_BN_N_x,v_BN_N_y,v_BN_N_z,nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,"
     "nonConservativeAccelpntB_B_z\n",
     [](const Motion& m) {
       return fmt::format("{:.0f},0,0,{:.9f},{},{},{},{:.6f},{:.6f},-500,{:.6f},{:.6f},0,{},{},{}\n", 1e9 * m.t,
                          std::tan(m.yaw / 4), m.rate.x(), m.rate.y(), m.rate.z(), m.north, m.east,
                          m.v * std::cos(m.yaw), m.v * std::sin(m.yaw), m.force.x(), m.force.y(), m.force.z());
     },
     50},
    {"csv",
     "time_s,yaw_rad,pitch_rad,roll_rad,p_rad_per_s,q_rad_per_s,r_rad_per_s,north_m,east_m,down_m,v_north_m_per_s,"
     "v_east_m_per_s,v_down_m_per_s,specific_force_x_m_per_s2,specific_force_y_m_per_s2,specific_force_z_m_per_s2\n",
     [](const Motion& m) {
       return fmt::format("{:.2f},{:.9f},0.125,-0.25,{},{},{},{:.6f},{:.6f},-500,{:.6f},{:.6f},0,{},{},{}\n", m.t,
                          m.yaw, m.rate.x(), m.rate.y(), m.rate.z(), m.north, m.east, m.v * std::cos(m.yaw),
                          m.v * std::sin(m.yaw), m.force.x(), m.force.y(), m.force.z());
     },
     42},
    {"json", "",
     [](const Motion& m) {
       return fmt::format(
           "{{\"time_s\": {:.2f}, \"yaw_rad\": {:.9f}, \"pitch_rad\": 0.125, \"roll_rad\": -0.25, "
           "\"p_rad_per_s\": {}, \"q_rad_per_s\": {}, \"r_rad_per_s\": {}, \"v_north_m_per_s\": {:.6f}, "
           "\"v_east_m_per_s\": {:.6f}, \"v_down_m_per_s\": 0, \"specific_force_x_m_per_s2\": {}, "
           "\"specific_force_y_m_per_s2\": {}, \"specific_force_z_m_per_s2\": {}}}\n",
           m.t, m.yaw, m.rate.x(), m.rate.y(), m.rate.z(), m.v * std::cos(m.yaw), m.v * std::sin(m.yaw), m.force.x(),
           m.force.y(), m.force.z());
     },
     12},
    {"flightgear", "",
     [](const Motion& m) {
       return fmt::format("{:.4f}\t{:.6f}\t{:.6f}\t{:.6f}\t{:.5f}\t{:.5f}\t{:.5f}\n", m.t, m.rate.x(), m.rate.y(),
                          m.rate.z(), m.force.x(), m.force.y(), m.force.z());
     },
     47},
    {"42", "",
     [](const Motion& m) {
       return fmt::format(
           "TIME 2024-099-00:00:{:012.9f}\nSC[0].qn = [0.0 0.0 {:.12e} {:.12e}]\n"
           "SC[0].wn = [{:.12e} {:.12e} {:.12e}]\nSC[0].PosR = [0.0 0.0 0.0]\nSC[0].VelR = [0.0 0.0 0.0]\n"
           "Orb[0].PosN = [{:.12e} {:.12e} 7.0e+06]\nOrb[0].VelN = [{:.12e} {:.12e} 0.0]\n[ENDMSG]\n",
           m.t, std::sin(m.yaw / 2), std::cos(m.yaw / 2), m.rate.x(), m.rate.y(), m.rate.z(), m.north, m.east,
           m.v * std::cos(m.yaw), m.v * std::sin(m.yaw));
     },
     31},
};

struct TakenTruths {
  std::vector<Truth> truths;
  bool has_word = false;  // something is refused, cut short or remarked
};

TakenTruths take(const Format& format, const std::string& text, const TruthBounds& bounds) {
  Timeline timeline;
  TruthConfig config;
  config.port = "file:truth";
  config.format = find_truth_format(format.name);
  config.settings = Settings(config.format->settings);
  config.bounds = bounds;
  TruthIntake intake(config, timeline, std::make_unique<FilePort>(text));
  TakenTruths taken;
  for (;;) {
    const auto outcome = intake.take();
    if (outcome == TruthIntake::Outcome::nothing) break;
    if (outcome != TruthIntake::Outcome::ignored) taken.truths.push_back(intake.truth());
  }
  intake.finish();
  const TruthCounters& counters = intake.counters();
  taken.has_word = counters.truncated > 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(Refusal::count); ++i)
    taken.has_word = taken.has_word || counters.refused[i] > 0;
  for (const Remark* remark : counters.remarks.all()) taken.has_word = taken.has_word || remark->is_set();
  return taken;
}

bool same(const Truth& a, const Truth& b) {
  return a.time == b.time && a.q_NB.coeffs() == b.q_NB.coeffs() && a.omega_BN_B == b.omega_BN_B &&
         a.r_BN_N == b.r_BN_N && a.v_BN_N == b.v_BN_N && a.specific_force_B == b.specific_force_B &&
         a.has_rate == b.has_rate && a.has_position == b.has_position && a.has_velocity == b.has_velocity &&
         a.has_specific_force == b.has_specific_force;
}

// Each of 600 streams of eleven records has one byte of the sixth replaced. The bounds are those of a STIM300: 400
// deg/s and 10 g. Before, without them, the shares were those of `before`.
TEST(TruthMutations, FewAreTakenWithoutAWord) {
  constexpr int mutations = 600, records = 11, damaged = 5;
  constexpr TruthBounds stim300 = {.rate = 12.1, .acceleration = 170};
  std::mt19937 random(20261123);
  int all = 0, all_before = 0;
  for (const Format& format : formats) {
    std::string before_it = format.head, record, after_it;
    for (int i = 0; i < records; ++i)
      (i < damaged ? before_it : i == damaged ? record : after_it) += format.record(motion(i));
    const TakenTruths whole = take(format, before_it + record + after_it, stim300);
    ASSERT_EQ(whole.truths.size(), static_cast<std::size_t>(records)) << format.name;
    const auto is_silent = [&](const TakenTruths& taken) {
      if (taken.has_word && !whole.has_word) return false;
      if (taken.truths.size() != whole.truths.size()) return true;
      for (std::size_t i = 0; i < taken.truths.size(); ++i)
        if (!same(taken.truths[i], whole.truths[i])) return true;
      return false;
    };
    int silent = 0, silent_before = 0;
    for (int i = 0; i < mutations; ++i) {
      std::string changed = record;
      const std::size_t at = random() % changed.size();
      const char old = changed[at];
      while (changed[at] == old) changed[at] = static_cast<char>(' ' + random() % 95);
      const std::string text = before_it + changed + after_it;
      silent += is_silent(take(format, text, stim300)) ? 1 : 0;
      silent_before += is_silent(take(format, text, {})) ? 1 : 0;
    }
    fmt::print("{:<12} without a word: {} of {}, {} without the bounds\n", format.name, silent, mutations,
               silent_before);
    all += silent;
    all_before += silent_before;
    EXPECT_LE(silent, silent_before);
    EXPECT_LE(silent, format.most) << format.name;
  }
  EXPECT_LT(all, 0.9 * all_before);
}

}  // namespace
}  // namespace imud
