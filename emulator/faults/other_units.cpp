#include "emulator/faults/other_units.hpp"

#include <algorithm>
#include <stdexcept>

#include "emulator/plan/config.hpp"

namespace imud {

Settings settings_as_delivered(const ImuConfig& imu) {
  if (imu.settings.frames() != nullptr) {
    // The description stays, and its line; lists are values that the host has saved.
    Settings delivered = imu.settings;
    for (const Setting& setting : imu.protocol->settings)
      if (std::holds_alternative<std::span<const std::string_view>>(setting.initial))
        delivered.set(setting.key, std::vector<std::string>());
    return delivered;
  }
  Settings settings(imu.protocol->settings);
  try {
    static_cast<void>(imu.protocol->make(settings));
    return settings;
  } catch (const std::invalid_argument&) {
    return imu.settings;
  }
}

bool OtherUnits::are_needed(std::span<const FaultConfig> faults, const ImuConfig& imu) noexcept {
  return std::any_of(faults.begin(), faults.end(),
                     [&](const FaultConfig& fault) { return fault.settings_of(imu.name) != nullptr; });
}

std::vector<OtherUnits::Other> OtherUnits::others_of(std::span<const FaultConfig> faults, const ImuConfig& imu) {
  std::vector<Other> others;
  for (std::size_t i = 0; i < faults.size(); ++i)
    if (const Settings* settings = faults[i].settings_of(imu.name))
      others.push_back({static_cast<std::uint32_t>(i), imu.protocol->make(*settings)});
  return others;
}

void OtherUnits::select(std::optional<std::uint32_t> fault) noexcept {
  selected_ = nullptr;
  if (!fault) return;
  for (const Other& other : others_)
    if (other.fault == *fault) selected_ = &other;
}

template <class Function>
void OtherUnits::for_all(FrameBuffer& out, Function function) noexcept {
  const auto call = [&](Device& device, bool is_selected) {
    unsent_.clear();
    function(device, is_selected ? out : unsent_);
  };
  call(*own_, selected_ == nullptr);
  for (const Other& other : others_) call(*other.device, selected_ == &other);
}

void OtherUnits::power_on(DeviceTime now) noexcept {
  for_all(unsent_, [&](Device& device, FrameBuffer&) { device.power_on(now); });
}

void OtherUnits::sample(const Sample& sample, FrameBuffer& out) noexcept {
  for_all(out, [&](Device& device, FrameBuffer& frames) { device.sample(sample, frames); });
}

void OtherUnits::receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept {
  for_all(replies, [&](Device& device, FrameBuffer& frames) { device.receive(from_host, now, frames); });
}

std::optional<DeviceTime> OtherUnits::deadline() const noexcept {
  std::optional<DeviceTime> first = own_->deadline();
  for (const Other& other : others_)
    if (const auto at = other.device->deadline(); at && (!first || *at < *first)) first = at;
  return first;
}

void OtherUnits::poll(DeviceTime now, FrameBuffer& out) noexcept {
  for_all(out, [&](Device& device, FrameBuffer& frames) {
    if (const auto at = device.deadline(); at && *at <= now) device.poll(now, frames);
  });
}

void OtherUnits::step_clock(Nanoseconds by) noexcept {
  for_all(unsent_, [&](Device& device, FrameBuffer&) { device.step_clock(by); });
}

void OtherUnits::trigger(DeviceTime time) noexcept {
  for_all(unsent_, [&](Device& device, FrameBuffer&) { device.trigger(time); });
}

void OtherUnits::pps(DeviceTime time) noexcept {
  for_all(unsent_, [&](Device& device, FrameBuffer&) { device.pps(time); });
}

}  // namespace imud
