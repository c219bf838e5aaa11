// Emergencies (CiA 301, 7.2.7): errors, the error register (1001), the history (1003), and the EMCY messages.
//
// EMCY: error code, error register, number of the error (enum Error), what belongs to it (u32). An EMCY with code 0
// reports that the error of that number has ended. EMCYs keep the inhibit time (1015); an error that begins and ends
// meanwhile is still reported.
#pragma once

#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

enum class Error : std::uint8_t {
  gyro_range,           // a rate is saturated; with it: the status
  accelerometer_range,  // a force, with the status
  no_measurement,       // the sample is marked as no measurement; with it: the status
  heartbeat,            // of a consumer; with it: its node id
  life_guarding,
  sync_lost,
  sync_length,  // it has ended as soon as it is reported
  count
};

class Emergencies {
 public:
  Emergencies(const ObjectDictionary& dictionary, Alarms& alarms) noexcept
      : dictionary_(dictionary), alarms_(alarms) {}

  // Ends all errors silently; EMCYs may be sent at once.
  void reset() noexcept;
  void clear_history() noexcept { history_size_ = 0; }
  // Sets whether an error exists. report() follows.
  void set(Error error, bool exists, std::uint32_t detail = 0) noexcept;
  // An event, which ends at once.
  void set_for_once(Error error) noexcept;
  // Sends EMCYs, and schedules Alarm::emergency if some must wait. If not `may_send`, errors only enter the history.
  void report(bool may_send, DeviceTime now, FrameBuffer& out) noexcept;

  std::uint8_t error_register() const noexcept;
  // 1003: the newest error first.
  std::size_t history_size() const noexcept { return history_size_; }
  std::uint32_t history(std::size_t i) const noexcept { return history_[i]; }
  void step_clock(Nanoseconds by) noexcept {
    if (inhibited_until_) inhibited_until_ = *inhibited_until_ + by;
  }

 private:
  struct One {
    bool exists = false, is_reported = false;
    bool has_begun = false;  // and this is not reported yet
    std::uint32_t detail = 0;
  };
  void record(Error error, const One& one) noexcept;
  void transmit(Error error, const One& one, FrameBuffer& out) const noexcept;

  const ObjectDictionary& dictionary_;
  Alarms& alarms_;
  std::array<One, static_cast<std::size_t>(Error::count)> errors_ = {};
  std::array<std::uint32_t, errors_kept> history_ = {};
  std::size_t history_size_ = 0;
  std::optional<DeviceTime> inhibited_until_;
};

}  // namespace imud::canopen
