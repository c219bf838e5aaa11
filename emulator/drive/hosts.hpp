// Hosts: the descriptors of a run, and the host's bytes and deadlines that become steps.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

// Reads the ports of the imus' hosts, and proposes their bytes as steps. Knows which imus have changed since the last
// wait, and looks at the others only when an input of theirs is ready or a deadline is due. Allocates only in the
// constructor. One thread.
class Hosts {
 public:
  // `is_paced`: the host's clock paces, and measures the durations from the arrivals to the ends of the writes of the
  // replies.
  Hosts(Engine& engine, Host& host, bool is_paced);

  // Must be called when an imu, or all, may have a frame to flush, a new deadline or another port.
  void touch(const Channel& channel) noexcept { is_touched_[channel.number] = has_touched_ = true; }
  void touch_all() noexcept;

  // Before a wait: polls the deadlines that are due at `now`, sends frames that ports hold back, and publishes the
  // counters of the touched imus. Then next_wake() returns when settle() has to be called next; nullopt if nothing
  // waits for a time.
  void settle(HostTime now) noexcept;
  std::optional<HostTime> next_wake() const noexcept;
  // Waits for truth if `truth`, and for the hosts, at most until `until`, and does not sleep for the first `spin` of
  // the wait. Returns true if truth is ready.
  bool wait(HostTime until, bool truth, Nanoseconds spin) noexcept;
  // Serves the hosts that wait() has found ready. Returns false if the next wait would return at once again, because
  // of a lasting error or a flood.
  bool serve_ready(HostTime now) noexcept;
  // Serves the hosts of the prepared samples.
  void serve_prepared(HostTime now) noexcept {
    if (are_there_)
      for (Channel* channel : engine_.prepared()) serve(*channel, now);
  }
  // Serves all hosts. Lost ports check whether their device is back.
  void serve_all(HostTime now) noexcept;
  // Sends frames that ports hold back.
  void flush() noexcept;

 private:
  bool serve(Channel& channel, HostTime now) noexcept;
  static constexpr std::size_t most_lines = 2;  // of an imu
  static std::size_t input_of(const Channel& channel, std::size_t line) noexcept {
    return 1 + most_lines * channel.number + line;
  }
  void watch(const Channel& channel, bool again) noexcept;

  Engine& engine_;
  Host& host_;
  const bool is_paced_;
  std::vector<char> is_touched_;  // by imu
  bool has_touched_ = true;
  bool are_there_ = true;                       // a port may receive
  std::vector<std::optional<HostTime>> wakes_;  // by imu
  std::span<const Host::Ready> ready_;          // by wait()
  std::vector<short> seen_;                     // by imu, in serve_ready()
};

}  // namespace imud
