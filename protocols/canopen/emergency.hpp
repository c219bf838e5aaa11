// Emergencies (CiA 301, 7.2.7): errors, the error register (1001), the history (1003), and the EMCY messages.
//
// An EMCY has: error code, error register, number of the error (enum Error), detail of the error (u32). An EMCY with
// code 0 reports that the error of this number has ended. EMCYs are at least the inhibit time (1015) apart. An error
// that begins and ends within this time is still reported.
#pragma once

#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

enum class Error : std::uint8_t {
  gyro_range,           // a rate is saturated; detail: the status
  accelerometer_range,  // a force is saturated; detail: the status
  no_measurement,       // the sample is marked as no measurement; detail: the status
  heartbeat,            // the heartbeat of another node is lost; detail: its node id
  life_guarding,
  sync_lost,
  sync_length,  // ends at once (set_for_once())
  count
};

class Emergencies {
 public:
  Emergencies(const ObjectDictionary& dictionary, Alarms& alarms) noexcept
      : dictionary_(dictionary), alarms_(alarms) {}

  // Ends all errors without an EMCY. The next EMCY may be sent at once.
  void reset() noexcept;
  void clear_history() noexcept { history_size_ = 0; }
  // Sets whether an error exists. Call report() afterwards.
  void set(Error error, bool exists, std::uint32_t detail = 0) noexcept;
  // Sets an error that ends at once. Call report() afterwards.
  void set_for_once(Error error) noexcept;
  // Sends EMCYs, and schedules Alarm::emergency if the next one must wait. If not `may_send`, errors only enter the
  // history.
  void report(bool may_send, DeviceTime now, FrameBuffer& out) noexcept;

  std::uint8_t error_register() const noexcept;
  // The history of errors (1003), the newest error first. Requires `i` below history_size().
  std::size_t history_size() const noexcept { return history_size_; }
  std::uint32_t history(std::size_t i) const noexcept { return history_[i]; }
  void step_clock(Nanoseconds by) noexcept {
    if (inhibited_until_) inhibited_until_ = *inhibited_until_ + by;
  }

 private:
  struct One {
    bool exists = false, is_reported = false;
    bool has_begun = false;  // the begin of the error is not reported yet
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
