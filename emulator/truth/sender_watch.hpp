// SenderWatch: detects that two simulators send truth to the same port.
#pragma once

#include <array>
#include <cstddef>

#include "core/time.hpp"
#include "transports/endpoint.hpp"

namespace imud {

// Two senders share the port if one of them sends again after the other has sent. A simulator that starts again sends
// from another port, and its old port stays silent: it counts as a single sender. Allocates nothing.
class SenderWatch {
 public:
  const Endpoint& newest() const noexcept { return newest_; }
  // Called for a truth whose sender is not newest(). Returns true if `from` comes back within 10 s after another
  // sender, which is other().
  bool has_come_back(const Endpoint& from, HostTime arrival) noexcept {
    constexpr Nanoseconds soon = std::chrono::seconds(10);
    bool back = false;
    for (const Seen& seen : former_)
      back = back || (seen.endpoint == from && seen.endpoint.port != 0 && arrival - seen.time < soon);
    former_[next_++ % former_.size()] = {newest_, arrival};
    newest_ = from;
    return back;
  }
  // The sender before the newest.
  const Endpoint& other() const noexcept { return former_[(next_ - 1) % former_.size()].endpoint; }

 private:
  struct Seen {
    Endpoint endpoint;
    HostTime time;  // when the next one followed
  };
  Endpoint newest_;
  std::array<Seen, 4> former_;
  std::size_t next_ = 0;
};

}  // namespace imud
