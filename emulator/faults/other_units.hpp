// OtherUnits: a unit that is replaced, during faults, by units with other settings.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emulator/plan/fault_config.hpp"
#include "protocols/protocol.hpp"

namespace imud {

struct ImuConfig;

// Returns the settings of the imu's product as delivered. Messages that a file describes have none: then returns the
// configured settings.
Settings settings_as_delivered(const ImuConfig& imu);

// All units share the power, samples, edges, clock and host of the own unit. So each is always in the state of a unit
// that was there from the start. Only one unit's frames leave. The own unit gives line, filters, requests, pulses and
// figures. One thread.
class OtherUnits final : public Device {
 public:
  // Makes the units of those `faults` that act on the imu, beside the unit `own`. Passes each unit except `own` to
  // `prepare`.
  template <class Prepare>
  OtherUnits(std::unique_ptr<Device> own, std::span<const FaultConfig> faults, const ImuConfig& imu, Prepare prepare)
      : own_(std::move(own)), others_(others_of(faults, imu)) {
    for (const Other& other : others_) prepare(*other.device);
  }
  // Returns true if any of the faults needs another unit of the imu.
  static bool are_needed(std::span<const FaultConfig> faults, const ImuConfig& imu) noexcept;

  // From now on the unit of this fault makes the frames; nullopt: the own unit does.
  void select(std::optional<std::uint32_t> fault) noexcept;
  std::unique_ptr<Device>& own() noexcept { return own_; }

  void power_on(DeviceTime now) noexcept override;
  void sample(const Sample& sample, FrameBuffer& out) noexcept override;
  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override;
  std::optional<DeviceTime> deadline() const noexcept override;
  void poll(DeviceTime now, FrameBuffer& out) noexcept override;
  void step_clock(Nanoseconds by) noexcept override;
  UartSettings uart() const noexcept override { return own_->uart(); }
  UartSettings second_uart() const noexcept override { return own_->second_uart(); }
  std::span<const std::uint64_t> counts() const noexcept override { return own_->counts(); }
  std::optional<SensorFilters> filters() const noexcept override { return own_->filters(); }
  NavigationRequests navigation_requests() const noexcept override { return own_->navigation_requests(); }
  void trigger(DeviceTime time) noexcept override;
  void pps(DeviceTime time) noexcept override;
  std::optional<Pulse> pulse() const noexcept override { return own_->pulse(); }

 private:
  struct Other {
    std::uint32_t fault;
    std::unique_ptr<Device> device;
  };
  static std::vector<Other> others_of(std::span<const FaultConfig> faults, const ImuConfig& imu);
  // Calls function(Device&, FrameBuffer&) for each unit. The selected unit writes its frames to `out`; the frames of
  // the others are discarded.
  template <class Function>
  void for_all(FrameBuffer& out, Function function) noexcept;

  std::unique_ptr<Device> own_;
  const std::vector<Other> others_;
  const Other* selected_ = nullptr;  // nullptr: the own unit
  FrameBuffer unsent_;
};

}  // namespace imud
