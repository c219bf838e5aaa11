#include "emulator/drive/pace.hpp"

namespace imud {

void Pace::transmit(std::span<Channel* const> channels, HostTime due) noexcept {
  if (host_.now() < due) host_.sleep_until(due, options_.spin);
  for (Channel* channel : channels) {
    const HostTime begin = host_.now();
    sink_.set_time(begin);
    channel->transmit();
    channel->record_times(begin - due, host_.now() - begin);
  }
}

}  // namespace imud
