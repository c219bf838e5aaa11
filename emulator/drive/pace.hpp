// Pace: sends the samples of an instant, by the host's clock or at once.
#pragma once

#include <atomic>
#include <optional>

#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

struct PaceOptions {
  Nanoseconds spin{0};  // the thread spins for this long before each instant
  // The frames of a sample that is later than this are not sent.
  Nanoseconds skip_after = std::chrono::seconds(1);
};

// Serves live truth, a capture and the repetition of a record alike. Where the host's clock paces, Pace waits for the
// instant, measures how late the samples leave, and skips samples that are too late; elsewhere Pace waits for the
// readers of the ports. No allocation. One thread.
class Pace {
 public:
  // `options`: nullopt: the host's clock does not pace. `stop` ends the waits.
  Pace(Engine& engine, Host& host, const std::optional<PaceOptions>& options, const std::atomic<bool>& stop)
      : engine_(engine), host_(host), is_paced_(options), options_(options.value_or(PaceOptions{})), stop_(stop) {}

  bool is_paced() const noexcept { return is_paced_; }
  Nanoseconds spin() const noexcept { return options_.spin; }
  // Returns true at `now` if the samples of the instant `due` are so late that their frames are not sent.
  bool is_too_late(HostTime due, HostTime now) const noexcept { return is_paced_ && now - due > options_.skip_after; }
  // The devices receive the prepared samples of `instant` now, and their frames leave at `due`. Engine::complete()
  // must be called after transmit(), and after skip().
  void transmit(HostTime instant, HostTime due) noexcept;
  // The devices receive the prepared samples, and their frames are discarded. So counters, clocks and increments show
  // a sensor that went on while this host was held up.
  void skip(HostTime instant) noexcept;

 private:
  void transmit_at(HostTime instant, HostTime due) noexcept;
  void transmit_at_once(HostTime instant) noexcept;

  Engine& engine_;
  Host& host_;
  const bool is_paced_;
  const PaceOptions options_;
  const std::atomic<bool>& stop_;
};

}  // namespace imud
