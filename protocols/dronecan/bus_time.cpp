#include "protocols/dronecan/bus_time.hpp"

#include "protocols/dronecan/transfer.hpp"

namespace imud::dronecan {

void BusTime::receive(unsigned master, unsigned transfer_id, std::uint64_t previous_us, DeviceTime now) noexcept {
  const bool is_silent = master_ == 0 || now - last_ > timeout;
  if (is_silent) is_known_ = false;
  if (is_silent || master < master_) {
    master_ = master;
  } else if (master != master_) {
    return;
  } else if (transfer_id == (transfer_id_ + 1) % transfer_ids && now - last_ <= longest_period && previous_us != 0) {
    reference_ = last_;
    reference_us_ = previous_us;
    is_known_ = true;
  }
  transfer_id_ = transfer_id;
  last_ = now;
}

std::uint64_t BusTime::at(DeviceTime time) const noexcept {
  if (!is_known_ || time - last_ > timeout) return 0;
  return (reference_us_ + static_cast<std::uint64_t>(microseconds(time - reference_))) &
         ((std::uint64_t{1} << 56) - 1);
}

void BusTime::step_clock(Nanoseconds by) noexcept {
  last_ = last_ + by;
  reference_ = reference_ + by;
}

}  // namespace imud::dronecan
