// The part of a Timeline beside attitude and rate: the place after the newest truth, fields, pressure, temperature
// and the vehicle's own states.
#include <cstddef>

#include "core/timeline.hpp"

namespace imud {

// Requires that the truth is already in its knot.
[[gnu::noinline]] void Timeline::take_surroundings(const Truth& truth) noexcept {
  has_surroundings_ = true;
  if (truth.vehicle.is_empty()) return;
  has_vehicle_ = true;
  std::size_t i = count_ - 1;
  while (i > 0 && knot(i).state.time != truth.time) --i;
  vehicles_[(first_ + i) % capacity] = {truth.time, truth.vehicle};
}

// Requires a time after the newest truth, and not after the instant from which motion is held.
PositionVelocity Timeline::extrapolate_position(TruthTime time) const noexcept {
  constexpr double greatest = 20;  // m/s^2
  const Knot& last = knot(count_ - 1);
  PositionVelocity position = last.position;
  position.time = time;
  const double dt = seconds(time - last.state.time);
  Vector3 dv = Vector3::Zero();
  if (count_ > 1 && position.is_known && knot(count_ - 2).position.is_known) {
    const Knot& before = knot(count_ - 2);
    const Vector3 beside = (position.v_N - before.position.v_N - (last.state.dv_N - before.state.dv_N)) / last.h_s;
    if (beside.norm() <= greatest) dv = extrapolate(time).dv_N - last.state.dv_N + dt * beside;
  }
  position.r_N += dt * (position.v_N + 0.5 * dv);
  position.v_N += dv;
  return position;
}

template <class Member>
auto Timeline::linear(Member member, TruthTime time) const noexcept -> decltype(member(0)) {
  std::size_t i = count_ - 1;
  if (time <= newest()) i = time <= knot(0).state.time ? 0 : segment_end(time);
  const auto end = member(i);
  if (!end || i == 0 || time >= knot(i).state.time) return end;
  const auto begin = member(i - 1);
  if (!begin) return end;
  const double s = seconds(time - knot(i - 1).state.time) / knot(i).h_s;
  return *begin + s * (*end - *begin);
}

std::optional<double> Timeline::temperature_c(TruthTime time) const noexcept {
  return linear([this](std::size_t i) { return knot(i).temperature_c; }, time);
}
std::optional<double> Timeline::vehicle(VehicleState state, TruthTime time) const noexcept {
  if (!has_vehicle_) return std::nullopt;
  return linear(
      [this, state](std::size_t i) {
        const VehicleAt& at = vehicles_[(first_ + i) % capacity];
        return at.time == knot(i).state.time ? at.states[state] : std::nullopt;
      },
      time);
}

Timeline::Surroundings Timeline::surroundings(TruthTime time) const noexcept {
  Surroundings found = {linear([this](std::size_t i) { return knot(i).magnetic_field_B; }, time),
                        linear([this](std::size_t i) { return knot(i).pressure; }, time),
                        {}};
  for (std::size_t i = 0; i < vehicle_state_count; ++i) {
    const auto state = static_cast<VehicleState>(i);
    if (const auto value = vehicle(state, time)) found.vehicle.set(state, *value);
  }
  return found;
}

}  // namespace imud
