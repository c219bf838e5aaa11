// Pace: where the host's clock paces, sends the samples of an instant and measures how late they are.
#pragma once

#include <span>

#include "emulator/engine/engine.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

struct PaceOptions {
  Nanoseconds spin{0};  // the thread spins for this long before each instant
  // The frames of a sample that is later than this are not sent.
  Nanoseconds skip_after = std::chrono::seconds(1);
};

// The same for live truth, a capture and the repetition of a record. No allocation. One thread.
class Pace {
 public:
  Pace(const Engine& engine, Host& host, const PaceOptions& options)
      : sink_(engine.sink()), host_(host), options_(options) {}

  Nanoseconds spin() const noexcept { return options_.spin; }
  // Returns true at `now` if the samples of the instant `due` are so late that their frames are not sent.
  bool is_too_late(HostTime due, HostTime now) const noexcept { return now - due > options_.skip_after; }
  // Waits until `due`, lets the channels transmit their encoded samples, in order, and records their lateness and the
  // time of the writes.
  void transmit(std::span<Channel* const> channels, HostTime due) noexcept;

 private:
  StepSink& sink_;
  Host& host_;
  const PaceOptions options_;
};

}  // namespace imud
