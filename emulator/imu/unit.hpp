// Unit: the electronics of an emulated sensor, from a Sample or the host's bytes to Frames.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "emulator/faults/channel_faults.hpp"
#include "emulator/faults/other_units.hpp"
#include "emulator/faults/power_faults.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// A Device with its supply, and the faults of its messages, its power and its clock. Times are by the clock of the
// sensor; the device's own clock may be ahead of it by a fault. After construction nothing here allocates, locks or
// throws. One thread.
class Unit {
 public:
  // `faults` are the faults of the imu; nullptr if there are none.
  Unit(const ImuConfig& config, ChannelFaults* faults);
  // Prepares for faults of the power: makes a second device with the settings as delivered. Throws as Protocol::make.
  void enable_faults(const ImuConfig& config, std::uint64_t seed);

  Device& device() noexcept { return *device_; }
  // Stores the counts of the devices.
  void publish(ImuCounters& counters) const noexcept;

  // --- Power ---
  bool is_on() const noexcept { return is_supplied_ && power_step_.is_on; }
  // Switches the device on at `now`.
  void start(DeviceTime now) noexcept { device_->power_on(now + clock_offset_); }
  // Switches the supply, without start(). Returns false if the supply was on or off as demanded.
  bool set_supply(bool on) noexcept { return std::exchange(is_supplied_, on) != on; }
  // The supply goes off and on between two samples. Returns true if the device has to start now. Otherwise its supply
  // is off, or a fault keeps it off, or delays its start until a later sample.
  bool cycle_power() noexcept;
  // Sets the faults of the power of the next sample. Returns whether the sensor starts or goes off with that
  // sample.
  enum class PowerChange : std::uint8_t { none, starts, goes_off };
  PowerChange set_power_faults(std::span<const ActiveFault> faults) noexcept;
  // Returns true if the device is on at the last sample and at the next one, without a start: set_power_faults() and
  // apply_power_faults() change nothing while no fault acts.
  bool is_steady() const noexcept { return power_step_.is_on && next_power_step_.is_on && !next_power_step_.starts; }
  // Executes the faults of set_power_faults(). Must be called at the sample's instant. Returns true if the device has
  // to start.
  bool apply_power_faults() noexcept { return !is_steady() && take_power_step(); }

  // --- Messages: the results are frames() or others(), until the next call ---
  // Step the device's clock: by `step`, or to the offset that a fault of the messages demands.
  void step_clock(Nanoseconds step) noexcept { device_->step_clock(step); }
  void apply_clock_fault() noexcept;
  // Makes the frames of the sample. The frames of a `discarded` sample are not in frames().
  void take(Sample& sample, bool discarded) noexcept;
  // Returns when poll() has to be called; nullopt: it need not be.
  std::optional<DeviceTime> deadline() const noexcept {
    const auto deadline = is_on() ? device_->deadline() : std::nullopt;
    return deadline ? std::optional(*deadline - clock_offset_) : std::nullopt;
  }
  void poll(DeviceTime deadline) noexcept;
  void receive(const Frame& frame, DeviceTime now) noexcept;
  // The frames of the last sample.
  std::span<const Frame> frames() const noexcept { return frames_.frames(); }
  // The frames of the last deadline or answer, or of a discarded sample.
  std::span<const Frame> others() const noexcept { return others_.frames(); }

  // Exchanges model figures, and the device if the reload has one. Returns true if the device has been exchanged.
  bool exchange(Reload::Sensor& next) noexcept;

 private:
  bool take_power_step() noexcept;
  void take_faulty(Sample& sample, bool discarded) noexcept;
  // Returns the figures that a unit has of these errors.
  static OwnFigures figures_of(const ImuModel& model) noexcept;

  std::unique_ptr<Device> device_;
  std::unique_ptr<Device> other_device_;  // as delivered, or after a loss of the settings the configured one
  ChannelFaults* const faults_;
  bool has_lost_settings_ = false;
  OtherUnits* other_units_ = nullptr;  // the device, if faults have other units in its place
  // By how much the clock of the device is ahead of the sensor's, because of a fault.
  Nanoseconds clock_offset_{0};
  std::optional<PowerFaults> power_faults_;
  bool is_supplied_ = true;                 // by set_supply()
  PowerStep power_step_, next_power_step_;  // by faults: now, and from the next sample on
  FrameBuffer frames_, others_;
};

}  // namespace imud
