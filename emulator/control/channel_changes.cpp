// The changes that commands make to a Channel, and the sample that those who watch get of it.
#include "emulator/channel.hpp"

namespace imud {

void Channel::pause(bool paused) noexcept {
  paused_ = paused;
  counters_.is_paused.store(paused, std::memory_order_relaxed);
}

void Channel::set_bias(Quantity quantity, std::size_t axis, double bias) noexcept {
  Vector3 all = imu_.bias(quantity);
  all[static_cast<Eigen::Index>(axis)] = bias;
  imu_.set_bias(quantity, all);
}

FeedSample Channel::feed_sample() const noexcept {
  const auto count = [](const Counter& counter) { return counter.load(std::memory_order_relaxed); };
  const Eigen::Quaternionf q = sample_.q_LP.cast<float>();
  const Eigen::Vector3f field = sample_.magnetic_field.cast<float>();
  const Navigation& place = sample_.navigation;
  return {.imu = number_,
          .status = sample_.status,
          .k = sample_.counter,
          .time_ns = sample_.time.ns,
          .truth_time = is_resting_ ? std::nullopt : used_until(),
          .temperature_c = sample_.temperature_c,
          .rate = sample_.rate,
          .specific_force = sample_.specific_force,
          .true_rate = imu_.true_rate(),
          .true_specific_force = imu_.true_specific_force(),
          .extrapolated = count(counters_.extrapolated),
          .held = count(counters_.held),
          .silent = count(counters_.silent),
          .attitude = {q.w(), q.x(), q.y(), q.z()},
          .magnetic_field = {field.x(), field.y(), field.z()},
          .pressure = static_cast<float>(sample_.pressure),
          .has_place = place.is_known,
          .latitude = place.latitude,
          .longitude = place.longitude,
          .height = place.height};
}

}  // namespace imud
