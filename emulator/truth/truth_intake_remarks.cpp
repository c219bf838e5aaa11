// The remarks of TruthIntake on truth that is probably not meant, or lacks a quantity.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "emulator/truth/remark_text.hpp"
#include "emulator/truth/truth_intake.hpp"

namespace imud {

namespace {

struct ExcessText {
  std::string_view what, unit, key;
};
// The texts, indexed by BoundsWatch::Kind.
constexpr ExcessText excess_texts[BoundsWatch::kinds] = {
    {"its rate is", "rad/s", "truth.max_rad_per_s"},
    {"its specific force is", "m/s^2", "truth.max_m_per_s2"},
    {"its velocity is", "m/s", "truth.max_m_per_s"},
    {"its attitude turns from truth to truth at", "rad/s", "truth.max_rad_per_s"},
    {"its velocity changes from truth to truth at", "m/s^2", "truth.max_m_per_s2 and the gravitation"},
    {"from truth to truth its position leaves its velocities by", "m", "truth.max_m_per_s2 and 4 m"},
};

}  // namespace

void TruthIntake::remark_place() noexcept {
  counters_.remarks.place.set([&](std::span<char> room) { return place_.describe_place(truth_, room); });
  counters_.remarks.date.set([&](std::span<char> room) { return place_.describe_date(truth_, room); });
}

void TruthIntake::remark_no_place() noexcept {
  counters_.remarks.no_place.set(
      [&](std::span<char> room) { return place_.describe_no_place(truth_, format_, room); });
}

void TruthIntake::remark_excess(bool follows) noexcept {
  const auto excess = bounds_.check(truth_, follows);
  if (!excess) [[likely]]
    return;
  const auto kind = static_cast<std::size_t>(excess->kind);
  counters_.remarks.excess[kind].set([&](std::span<char> room) {
    const auto& [what, unit, key] = excess_texts[kind];
    const auto result = fmt::format_to_n(room.data(), room.size(),
                                         "{} {:.6g} {} at {} ns, beyond {:.6g} by {}: a damaged record, a wrong "
                                         "unit, or a vehicle that these sensors are not made for",
                                         what, excess->value, unit, truth_.time.ns, excess->bound, key);
    return std::min(result.size, room.size());
  });
}

// The last record has all its numbers, but without a line feed the last number may be cut off.
void TruthIntake::remark_last_line() noexcept {
  counters_.remarks.last_line.set([&](std::span<char> room) {
    const auto result =
        fmt::format_to_n(room.data(), room.size(),
                         "the last line of the file has no line feed; it has all that a line needs, and "
                         "is used: if the file was cut, its last number may be");
    return std::min(result.size, room.size());
  });
}

void TruthIntake::remark_long_line() noexcept {
  counters_.remarks.long_line.set([&](std::span<char> room) {
    return write_remark(room,
                        "a line of truth is longer than {} bytes, which is the limit, and counts as cut short: does "
                        "each record end with a line feed?",
                        decoder_->losses().longest);
  });
}

// A simulator may send a header row with every truth: only the first ones are looked at.
void TruthIntake::remark_columns() noexcept {
  constexpr int most = 64;  // header rows and comments
  if (headers_ == most) return;
  ++headers_;
  counters_.remarks.columns.set(
      [&](std::span<char> room) { return decoder_->describe(TruthResult::no_state, room); });
}

void TruthIntake::remark_far_from_earth() noexcept {
  counters_.remarks.far_from_earth.set([&](std::span<char> room) {
    return write_remark(
        room,
        "its position is {:.0f} m from the origin, which is not the Earth's centre, as truth.gravity needs: no "
        "gravitation is taken away; give truth.gravity_m_per_s2, or gravity = \"none\"",
        truth_.r_BN_N.norm());
  });
}

void TruthIntake::remark_no_force() noexcept {
  if (ignores_force_) return;
  counters_.remarks.no_force.set([&](std::span<char> room) {
    const bool is_derivable = truth_.has_position || truth_.has_velocity;
    return write_remark(room,
                        "has neither specific force nor accumulated velocity: accelerometers measure 0; supply {}{}",
                        format_.force_from.empty() ? "one of them" : format_.force_from,
                        is_derivable ? ", or give truth.specific_force = \"derived\"" : "");
  });
}

std::vector<std::string> remarks(const TruthCounters& truth) {
  std::vector<std::string> all;
  for (const Remark* remark : truth.remarks.all())
    if (remark->is_set()) all.emplace_back(remark->text());
  for (std::size_t i = 0; i < truth.refused.first.size(); ++i)
    if (const Remark& first = truth.refused.first[i]; first.is_set())
      all.push_back(fmt::format("refused: {}: {}", cause(static_cast<Refusal>(i)), first.text()));
  return all;
}

}  // namespace imud
