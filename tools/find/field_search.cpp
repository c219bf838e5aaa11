#include "tools/find/field_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "core/units.hpp"
#include "tools/find/turn_fit.hpp"
#include "tools/find/usual_scale.hpp"
#include "tools/find/vector_places.hpp"

namespace imud {
namespace {

constexpr std::size_t fewest_handled = 16;  // of a capture
constexpr std::size_t most_gravities = 8;
constexpr double gravity_tolerance = 0.003;   // gravity is from 9.780 to 9.833 m/s^2
constexpr double most_bias_rad_per_s = 0.35;  // of a gyro
constexpr char axis_names[] = {'x', 'y', 'z'};

struct Gravity {
  VectorPlace place;
  GravityFit fit;
};
struct Turn {
  VectorPlace place;
  TurnFound fit;
};

double force_tolerance(const GravityFit& fit) {
  constexpr double directions = 20;
  return gravity_tolerance + std::abs(fit.change) + fit.deviation / std::sqrt(directions);
}

std::string place_text(const VectorPlace& place) {
  return fmt::format("{} at bytes {}, {} and {}", place.first.type.text(), place.first.at, place.component(1).at,
                     place.component(2).at);
}

class FieldSearch {
 public:
  FieldSearch(FoundFrames& found, std::span<const std::byte> stream, std::size_t turned_bytes, double rate_hz)
      : messages_(found.messages), frames_(messages_, stream, turned_bytes), rate_hz_(rate_hz) {
    for (std::size_t m = 0; m < messages_.size(); ++m) {
      const FoundMessage& message = messages_[m];
      if (message.frames.size() > messages_[base_].frames.size()) base_ = m;
      std::vector<bool> is_free(message.length, true);
      const auto take = [&](std::size_t at, std::size_t size) {
        std::fill_n(is_free.begin() + static_cast<std::ptrdiff_t>(at), size, false);
      };
      take(0, message.header);
      for (const FoundCheck& check : message.checks) take(check.at, check.size);
      for (const FoundCounter& counter : message.counters) take(counter.at, counter.size);
      if (message.length_field) take(message.length_field->at, message.length_field->size);
      is_free_.push_back(std::move(is_free));
    }
  }

  std::vector<std::string> run() {
    const std::size_t rest = frames_.frame_count(base_, Handled::rest),
                      turned = frames_.frame_count(base_, Handled::turned);
    if (std::min(rest, turned) < fewest_handled) {
      remark("--turned: {} and {} whole frames at rest and turned are too few to find fields", rest, turned);
      return remarks_;
    }
    remark(
        "Fields by {} frames at rest and {} turned. Not shown by any turn: which way each axis points on the case,",
        rest, turned);
    remark("and the sign of all specific forces together: at rest, the axis that points up must have +1 g.");
    find_vectors();
    if (gravities_.empty()) {
      remark(
          "No specific force was found: no three numbers, of one type and equally spaced, keep their norm while "
          "they");
      remark("change direction by more than 0.2 rad. Turn it slowly about all axes, for 20 s or more.");
    } else {
      choose();
      add_force();
      add_rates();
      add_along();
      note_others();
    }
    for (std::size_t m = 0; m < messages_.size(); ++m) note_other_numbers(messages_[m], m, frames_, is_free_[m]);
    return remarks_;
  }

 private:
  template <class... Values>
  void remark(fmt::format_string<Values...> format, Values&&... values) {
    remarks_.push_back(fmt::format(format, std::forward<Values>(values)...));
  }
  template <class... Values>
  void note(const VectorPlace& place, fmt::format_string<Values...> format, Values&&... values) {
    messages_[place.first.message].notes.push_back(fmt::format(format, std::forward<Values>(values)...));
  }

  template <class Found>
  void keep_distinct(std::vector<Found>& all) const {
    std::vector<VectorPlace> places;
    for (const Found& one : all) places.push_back(one.place);
    std::vector<Found> kept;
    for (const std::size_t i : distinct_vectors(places, frames_)) kept.push_back(std::move(all[i]));
    all = std::move(kept);
  }

  void find_vectors() {
    vectors_ = imud::find_vectors(frames_, is_free_);
    for (const VectorPlace& place : vectors_)
      if (auto fit = fit_gravity(frames_, place)) gravities_.push_back({place, std::move(*fit)});
    keep_distinct(gravities_);
    // All components of a specific force change; in a vector that is one by chance, fewer components change.
    std::ranges::stable_sort(gravities_, {}, [](const Gravity& one) {
      return std::tuple(-std::ranges::count(one.place.is_lively, true), one.fit.deviation);
    });
    if (gravities_.size() > most_gravities) gravities_.resize(most_gravities);
  }

  std::vector<Turn> turns_about(const Gravity& gravity) const {
    const TurnFit fit(frames_, gravity.fit);
    std::vector<Turn> turns;
    for (const VectorPlace& place : vectors_)
      if (!place.overlaps(gravity.place))
        if (const auto found = fit.fit(place)) turns.push_back({place, *found});
    keep_distinct(turns);
    return turns;
  }

  // The scale of the specific force, in m/s^2; or of increments of the velocity.
  VectorScale force_scale(const Gravity& gravity, VectorQuantity quantity) const {
    double si = units::standard_gravity / gravity.fit.norm;
    if (quantity == VectorQuantity::delta_velocity) si /= message_rate_hz(gravity.place);
    return scale_of(quantity, gravity.place.first.type, si, force_tolerance(gravity.fit));
  }
  VectorScale rate_scale(const Turn& turn, VectorQuantity quantity) const {
    double si = turn.fit.common * rate_hz_;
    if (quantity == VectorQuantity::delta_angle) si /= message_rate_hz(turn.place);
    constexpr double least = 0.003;  // the axes of the specific force have scales of their own
    return scale_of(quantity, turn.place.first.type, si, least + 2 * turn.fit.common_sigma / turn.fit.common);
  }
  double message_rate_hz(const VectorPlace& place) const {
    const auto count = [this](std::size_t m) { return static_cast<double>(messages_[m].frames.size()); };
    return rate_hz_ * count(place.first.message) / count(base_);
  }

  // Sorts the vectors that may be the specific force: the most probable first.
  void choose() {
    using Rank = std::tuple<bool, bool, double, std::size_t, std::size_t>;
    std::vector<std::pair<Rank, std::size_t>> order;
    std::vector<std::vector<Turn>> turns;
    for (std::size_t i = 0; i < gravities_.size(); ++i) {
      const Gravity& one = gravities_[i];
      turns.push_back(turns_about(one));
      double explained = 0;
      for (const Turn& turn : turns.back()) explained = std::max(explained, turn.fit.explained);
      const bool is_usual = force_scale(one, VectorQuantity::specific_force).is_usual;
      order.push_back({{turns.back().empty(), !is_usual, -std::round(20 * explained), one.place.first.message,
                        one.place.first.at},
                       i});
    }
    std::ranges::sort(order);
    std::vector<Gravity> sorted;
    for (const auto& [rank, i] : order) sorted.push_back(std::move(gravities_[i]));
    turns_ = std::move(turns[order.front().second]);
    gravities_ = std::move(sorted);
  }

  // Adds the three fields. Returns false if the message has that quantity already, or if one of the fields
  // overlaps bytes with a known meaning.
  bool add(const VectorPlace& place, VectorQuantity quantity, const UsualScale& scale,
           const std::array<std::size_t, 3>& axis, const std::array<bool, 3>& is_negative) {
    const FrameNumber& type = place.first.type;
    if (!is_free_at(place) || !named_.emplace(place.first.message, quantity).second) return false;
    take(place);
    for (std::size_t i = 0; i < 3; ++i) {
      FoundField field{place.component(i).at, type};
      field.name = fmt::format("{}_{}_{}", quantity_name(quantity), axis_names[axis[i]], scale.unit);
      field.is_negative = is_negative[i];
      field.lsb = scale.lsb;
      field.lsb_value = scale.value;
      if (type.format == FrameNumber::Format::unsigned_integer)
        field.offset = -std::ldexp(scale.value, static_cast<int>(8 * type.bytes) - 1);
      messages_[place.first.message].fields.push_back(std::move(field));
    }
    return true;
  }

  void add_force() {
    const Gravity& force = gravities_.front();
    VectorQuantity quantity = VectorQuantity::specific_force;
    VectorScale scale = force_scale(force, quantity);
    if (!scale.is_usual && rate_hz_ > 0)
      if (VectorScale other = force_scale(force, VectorQuantity::delta_velocity); other.is_usual) {
        quantity = VectorQuantity::delta_velocity;
        scale = std::move(other);
      }
    // Without rates that agree, a usual scale is the only evidence for a vector that is not a number by chance.
    const bool is_likely = !turns_.empty() || scale.is_usual;
    if (is_likely) add(force.place, quantity, scale.taken, {0, 1, 2}, {});
    note(force.place,
         "{}: {}{} x, y, z: the norm stays within {:.1f} % (rms) while the direction turns ({:.2f} rad rms)",
         place_text(force.place), is_likely ? "" : "may be ",
         quantity == VectorQuantity::specific_force ? "specific force" : "increments of the velocity",
         100 * force.fit.deviation, force.fit.spread_rad);
    note(force.place, "  {}", scale_text(quantity, scale));
    if (turns_.empty()) note(force.place, "  no rates agree with its turn: a magnetic field would look alike");
  }

  void add_rates() {
    if (turns_.empty()) {
      remark("No angular rate was found: no three numbers explain the turn of the specific force.");
      return;
    }
    if (!(rate_hz_ > 0)) {
      for (const Turn& turn : turns_)
        note(turn.place, "{}: angular rates or increments, {:.1f} % of the turn: --rate-hz gives the unit",
             place_text(turn.place), 100 * turn.fit.explained);
      return;
    }
    const auto is_usual = [this](const Turn& turn, VectorQuantity quantity) {
      return rate_scale(turn, quantity).is_usual;
    };
    std::ranges::stable_sort(turns_, {}, [&](const Turn& turn) {
      constexpr std::size_t lively = 3;
      return std::tuple(lively - static_cast<std::size_t>(std::ranges::count(turn.place.is_lively, true)),
                        !is_usual(turn, VectorQuantity::rate), turn.place.first.at);
    });
    std::vector<Turn> others;
    for (const Turn& turn : turns_) {
      const bool is_small = turn.fit.bias * rate_hz_ < most_bias_rad_per_s;
      const bool is_angle = is_usual(turn, VectorQuantity::delta_angle);
      const bool is_rate = is_usual(turn, VectorQuantity::rate) || !is_angle;
      const bool is_added = is_small && ((is_rate && add_turn(turn, VectorQuantity::rate)) ||
                                         (is_angle && add_turn(turn, VectorQuantity::delta_angle)));
      if (!is_added) others.push_back(turn);
    }
    for (const Turn& turn : others) {
      if (!is_free_at(turn.place)) continue;
      take(turn.place);
      note(turn.place, "{}: explains {:.1f} % of the turn, too: another rate, or increments; {}",
           place_text(turn.place), 100 * turn.fit.explained,
           scale_text(VectorQuantity::rate, rate_scale(turn, VectorQuantity::rate)));
    }
  }

  bool add_turn(const Turn& turn, VectorQuantity quantity) {
    const VectorScale scale = rate_scale(turn, quantity);
    std::array<bool, 3> is_negative{};
    for (std::size_t i = 0; i < 3; ++i) is_negative[i] = turn.fit.scale[i] < 0;
    if (!add(turn.place, quantity, scale.taken, turn.fit.axis, is_negative)) return false;
    std::string axes;
    for (std::size_t i = 0; i < 3; ++i)
      axes += fmt::format("{}{}{}", i == 0 ? "" : ", ", is_negative[i] ? "-" : "", axis_names[turn.fit.axis[i]]);
    note(turn.place, "{}: {} {}: {:.2f} % of the turn of the specific force in {} steps; bias {:.3g} deg/s at rest",
         place_text(turn.place), quantity == VectorQuantity::rate ? "angular rate" : "increments of the angle", axes,
         100 * turn.fit.explained, turn.fit.windows, turn.fit.bias * rate_hz_ / units::degree);
    note(turn.place, "  {}", scale_text(quantity, scale));
    for (std::size_t i = 0; i < 3; ++i)
      if (!turn.fit.is_observed[i])
        note(turn.place,
             "  not observed: scale and sign of {}, which are assumed; turn it about that axis while the axis is "
             "level",
             axis_names[turn.fit.axis[i]]);
    return true;
  }

  bool is_free_at(const VectorPlace& place) const {
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t b = 0; b < place.first.type.bytes; ++b)
        if (!is_free_[place.first.message][place.component(i).at + b]) return false;
    return true;
  }
  void take(const VectorPlace& place) {
    for (std::size_t i = 0; i < 3; ++i)
      std::fill_n(is_free_[place.first.message].begin() + static_cast<std::ptrdiff_t>(place.component(i).at),
                  place.first.type.bytes, false);
  }

  // Adds the other vectors that have the direction of the specific force.
  void add_along() {
    for (std::size_t i = 1; i < gravities_.size(); ++i) {
      const Gravity& one = gravities_[i];
      const Gravity& force = gravities_.front();
      std::array<bool, 3> is_negative{};
      const auto axis = axes_along(one.fit, force.fit, is_negative);
      if (!axis || !named_.contains({force.place.first.message, VectorQuantity::specific_force})) continue;
      // Such a vector is the specific force once more, or has increments of the velocity.
      constexpr double alike = 0.01;
      const bool is_same = one.place.first.type.format == force.place.first.type.format &&
                           std::abs(one.fit.norm / force.fit.norm - 1) < alike;
      const VectorQuantity quantity = is_same ? VectorQuantity::specific_force : VectorQuantity::delta_velocity;
      if (!is_same && !(rate_hz_ > 0)) continue;
      const VectorScale scale = force_scale(is_same ? force : one, quantity);
      if ((!is_same && !scale.is_usual) || !add(one.place, quantity, scale.taken, *axis, is_negative)) continue;
      note(one.place, "{}: {}, along the specific force that was found first", place_text(one.place),
           is_same ? "specific force" : "increments of the velocity");
      note(one.place, "  {}", scale_text(quantity, scale));
    }
  }

  void note_others() {
    constexpr std::size_t most = 6;
    std::size_t count = 0;
    for (std::size_t i = 1; i < gravities_.size() && count < most; ++i) {
      const Gravity& one = gravities_[i];
      if (!is_free_at(one.place)) continue;
      take(one.place);
      std::array<bool, 3> is_negative{};
      const bool is_along = axes_along(one.fit, gravities_.front().fit, is_negative).has_value();
      note(one.place, "{}: norm {:.5g} stays within {:.1f} %, too: {}", place_text(one.place), one.fit.norm,
           100 * one.fit.deviation,
           is_along ? "along the specific force: a second one, or increments of the velocity"
                    : "a magnetic field, or it is the specific force: shake it without turning it, and only the "
                      "specific force changes");
      ++count;
    }
  }

  std::vector<FoundMessage>& messages_;
  HandledFrames frames_;
  double rate_hz_;
  std::size_t base_ = 0;                    // the most frequent message
  std::vector<std::vector<bool>> is_free_;  // bytes of each message that have no meaning yet
  std::vector<VectorPlace> vectors_;
  std::vector<Gravity> gravities_;                          // the most probable first
  std::vector<Turn> turns_;                                 // about the first of them
  std::set<std::pair<std::size_t, VectorQuantity>> named_;  // in each message
  std::vector<std::string> remarks_;
};

}  // namespace

std::vector<std::string> find_fields(FoundFrames& found, std::span<const std::byte> stream, std::size_t turned_bytes,
                                     double rate_hz) {
  if (found.messages.empty()) return {};
  return FieldSearch(found, stream, turned_bytes, rate_hz).run();
}

}  // namespace imud
