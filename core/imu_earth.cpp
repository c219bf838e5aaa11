// The measurements of an Imu that depend on its place on the Earth.
#include <algorithm>

#include "core/imu.hpp"

namespace imud {

// Gives a known place the position and velocity that S had before, but not before the oldest truth that is kept.
void Imu::delay(const Timeline& timeline, const MotionState& now, Navigation& navigation) const noexcept {
  PositionVelocity before = timeline.position(now.time - navigation_.latency());
  if (!navigation.is_known || !before.is_known) return;
  move_to_sensor(timeline.at(before.time), before);
  const Navigation delayed = earth_.navigation(before);
  if (!delayed.is_known) return;
  const std::int64_t gps_ns = navigation.gps_ns;
  const Geodetic origin = navigation.origin;
  navigation = delayed;
  navigation.age = std::min(navigation_.latency(), now.time - before.time);
  navigation.gps_ns = gps_ns;
  navigation.origin = origin;
}

// Moves position and velocity from B's origin to S.
void Imu::move_to_sensor(const MotionState& state, PositionVelocity& position) const noexcept {
  position.r_N += state.q_NB * model_.r_SB_B;
  position.v_N += state.q_NB * state.omega_BN_B.cross(model_.r_SB_B);
}

// Adds the place of S, from the place of B's origin, and the magnetic field and pressure there. Both are the truth's
// if given, and otherwise come from the Earth's models at a known place.
void Imu::sense_earth(const Earth& earth, PositionVelocity position, const Timeline::Surroundings& given,
                      const MotionState& now, Sample& out) noexcept {
  move_to_sensor(now, position);
  out.has_surroundings = true;
  out.navigation = earth.navigation(position);
  const bool is_known = out.navigation.is_known;
  const Quaternion q_NP = out.q_LP;
  if (is_known) {
    out.navigation.origin = origin_.value_or(Geodetic{});
    // A vehicle whose motion is held stands still relative to the Earth.
    if (now.basis == MotionState::Basis::held) out.navigation.v_L.setZero();
    out.navigation.gps_ns += (now.time - position.time).count();
    out.q_LP = earth.q_LN(position, out.navigation) * out.q_LP;
  }
  const bool has_field = is_known || given.magnetic_field_B;
  if (given.magnetic_field_B)
    out.magnetic_field = q_NP.conjugate() * (now.q_NB * *given.magnetic_field_B);
  else if (is_known)
    out.magnetic_field = out.q_LP.conjugate() * earth.magnetic_field_L(out.navigation);
  if (const auto current = given.vehicle[VehicleState::current]; current && has_field)
    out.magnetic_field += *current * model_.current_field;
  if (given.pressure || is_known) {
    double pressure = given.pressure ? *given.pressure : earth.pressure(out.navigation);
    if (barometer_.errors().has_port_error()) {
      const Vector3 v_P = is_known ? Vector3(out.q_LP.conjugate() * out.navigation.v_L) : Vector3(Vector3::Zero());
      const AirFlow flow = {model_.dcm_PB.transpose() * v_P, given.vehicle[VehicleState::airspeed],
                            given.vehicle[VehicleState::dynamic_pressure]};
      pressure += port_error(barometer_.errors(), flow, pressure);
    }
    out.pressure = barometer_.measure(pressure, normals_, counter_, surroundings_.temperature_c);
  } else {
    barometer_.pass(normals_, counter_);
  }
  const Vector3 none = Vector3::Zero();
  TriadStep step = {.normals = normals_,
                    .k = counter_,
                    .dt = 0,
                    .since_power_on = time_since_power_on(),
                    .specific_force = none,
                    .delta_velocity = none,
                    .surroundings = surroundings_,
                    .value = lanes(out.magnetic_field),
                    .increment = lanes(none),
                    .begins_run = !had_field_};
  had_field_ = has_field;
  magnetometer_.apply(step);  // the error processes continue where there is no field
  if (has_field) out.magnetic_field = vector_of(step.value);
}

}  // namespace imud
