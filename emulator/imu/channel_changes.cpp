// The changes that commands and reloads make to a Channel, and the sample that it offers to the feed.
#include <limits>

#include "emulator/imu/channel.hpp"
#include "emulator/imu/wire_port.hpp"

namespace imud {

void Channel::execute(const Command& command, const FaultBook& book, HostTime now) noexcept {
  const auto axis = static_cast<std::size_t>(command.number % 3);
  const auto fault = static_cast<std::uint32_t>(command.number);
  switch (command.kind) {
    case Command::Kind::power_off:
    case Command::Kind::power_on:
      set_supply(command.kind == Command::Kind::power_on, now);
      break;
    case Command::Kind::power_cycle:
      set_supply(false, now);
      set_supply(true, now);
      break;
    case Command::Kind::pause:
    case Command::Kind::resume:
      paused_ = command.kind == Command::Kind::pause;
      counters.is_paused.store(paused_, std::memory_order_relaxed);
      break;
    case Command::Kind::fault_begin:
      if (faults && book[fault].acts_on(name)) faults->add(book[fault], fault, sensor.sample());
      break;
    case Command::Kind::fault_end:
      if (faults) faults->schedule().end(fault);
      break;
    case Command::Kind::fault_clear:
      if (faults) faults->schedule().end_all();
      break;
    case Command::Kind::seed:
      sensor.set_seed(command.number);
      break;
    case Command::Kind::gyro_bias:
      set_bias(Quantity::rate, axis, command.value);
      break;
    case Command::Kind::accelerometer_bias:
      set_bias(Quantity::specific_force, axis, command.value);
      break;
    case Command::Kind::mark:
    case Command::Kind::delay:
    case Command::Kind::automatic_delay:
    case Command::Kind::extrapolate:
    case Command::Kind::when_stopped:
    case Command::Kind::log_level:
    case Command::Kind::servo:
    case Command::Kind::reload:
      break;  // not a change of an imu
  }
}

void Channel::set_supply(bool on, HostTime now) noexcept {
  if (!on) {
    poll(now);
    if (unit.is_on()) sensor.imu().power_off();
  }
  if (!unit.set_supply(on)) return;
  counters.has_power.store(on, std::memory_order_relaxed);
  cycle_power(now);
}

void Channel::set_bias(Quantity quantity, std::size_t axis, double bias) noexcept {
  Vector3 all = sensor.imu().bias(quantity);
  all[static_cast<Eigen::Index>(axis)] = bias;
  sensor.imu().set_bias(quantity, all);
}

void Channel::exchange(Reload::Sensor& next, HostTime now) noexcept {
  sensor.exchange(next);
  awaited.set_mounting(next.model);
  if (next.device != nullptr && unit.is_on()) poll(now);
  if (unit.exchange(next) && unit.is_on()) start_device(sensor.clock().now(now));
  if (!faults) return;
  if (next.device != nullptr)
    for (std::size_t i = 0; i < lines.all().size(); ++i) lines.all()[i].wire->exchange(next.seals[i]);
  faults->exchange_model(next.model);
  if (!next.grid) return;
  faults->set_rate(next.model.rate_hz);
  for (DeviceLine& line : lines.all()) line.wire->set_rate(next.model.rate_hz);
}

void Channel::exchange(Reload::Line& next) noexcept {
  lines.exchange(next);
  publish();
}

std::optional<FeedSolution> Channel::feed_solution() noexcept {
  const std::optional<Solution>& solution = outgoing_.sample->solution;
  if (!solution || sensor.judge() == nullptr) return std::nullopt;
  FeedSolution shown = {.state = solution->state, .used = solution->used, .rejected = solution->rejected};
  const auto set = [](FeedSolution::Vectors& all, std::size_t part, const Eigen::Vector3f& value, bool is_known) {
    constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
    for (std::size_t i = 0; i < 3; ++i) all[part][i] = is_known ? value[static_cast<Eigen::Index>(i)] : unknown;
  };
  const auto error = sensor.judge()->difference(*outgoing_.sample);
  const SolutionDifference difference = error.value_or(SolutionDifference{.attitude = Vector3::Zero()});
  const bool reports_place = outgoing_.sample->navigation.is_known;
  set(shown.errors, 0, difference.attitude.cast<float>(), error.has_value());
  set(shown.errors, 1, difference.velocity.cast<float>(), difference.has_place);
  set(shown.errors, 2, difference.position.cast<float>(), difference.has_place);
  set(shown.sigmas, 0, solution->attitude, true);
  set(shown.sigmas, 1, solution->velocity, reports_place);
  set(shown.sigmas, 2, solution->position, reports_place);
  return shown;
}

FeedSample Channel::feed_sample() noexcept {
  const Sample& sample = *outgoing_.sample;
  const auto count = [](const Counter& counter) { return counter.load(std::memory_order_relaxed); };
  const Eigen::Quaternionf q = sample.q_LP.cast<float>();
  const auto floats = [](const Vector3& v) {
    return std::array{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
  };
  const Navigation& place = sample.navigation;
  return {.imu = number,
          .status = sample.status,
          .k = sample.counter,
          .time_ns = sample.time.ns,
          .truth_time = (sample.status & status::at_rest) != 0 ? std::nullopt : sensor.used_until(),
          .is_sent = !is_discarded_ && !paused_ && unit.is_on(),
          .temperature_c = sample.temperature_c,
          .rate = sample.rate,
          .specific_force = sample.specific_force,
          .true_rate = sensor.imu().true_rate(),
          .true_specific_force = sensor.imu().true_specific_force(),
          .extrapolated = count(counters.extrapolated),
          .held = count(counters.held),
          .silent = count(counters.silent),
          .attitude = {q.w(), q.x(), q.y(), q.z()},
          .magnetic_field = floats(sample.magnetic_field),
          .pressure = static_cast<float>(sample.pressure),
          .inclination = sample.inclination ? std::optional(floats(*sample.inclination)) : std::nullopt,
          .has_place = place.is_known,
          .latitude = place.latitude,
          .longitude = place.longitude,
          .height = place.height,
          .solution = feed_solution()};
}

}  // namespace imud
