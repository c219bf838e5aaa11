// StepSink: takes the events and packets of a run, in their order. A record is made of them.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "transports/capture/pcapng_writer.hpp"
#include "transports/capture/record_packet.hpp"
#include "transports/endpoint.hpp"

namespace imud {

// An Engine gives the sink every event, every received packet, and every frame that was passed to a port. A sink that
// keeps nothing costs a comparison.
class StepSink {
 public:
  // Returns the sink of runs without a record, which keeps nothing. Any thread.
  static StepSink& none() noexcept;
  virtual ~StepSink() = default;

  // Returns true if this keeps its input.
  bool keeps() const noexcept { return keeps_; }

  // --- Before the run ---
  // Adds an interface and returns its number.
  virtual std::uint16_t add_interface(std::string name, std::uint16_t link_type) = 0;
  // Sets the address of the truth port.
  virtual void set_truth_address(const Endpoint& address) = 0;

  // --- The sampling thread ---
  // Sets the time of the next events.
  void set_time(HostTime now) noexcept {
    if (keeps_) now_ = now;
  }
  HostTime now() const noexcept { return now_; }
  void event(const RecordEvent& event) noexcept {
    if (keeps_) keep_event(event);
  }
  // A packet of that interface, at its own time.
  void packet(std::uint16_t interface, PacketDirection direction, HostTime time, const Frame& frame,
              const Endpoint& peer = {}) noexcept {
    if (keeps_) keep_packet(interface, direction, time, frame, peer);
  }
  // Frames that were passed to a port, which has dropped the last `dropped` of them. Sent frames get `interface`,
  // dropped frames `interface` + 2.
  void frames(std::uint16_t interface, std::span<const Frame> frames, std::uint64_t dropped) noexcept {
    if (keeps_) keep_frames(interface, frames, dropped);
  }

 protected:
  explicit StepSink(bool keeps) noexcept : keeps_(keeps) {}

 private:
  virtual void keep_event(const RecordEvent& event) noexcept = 0;
  virtual void keep_packet(std::uint16_t interface, PacketDirection direction, HostTime time, const Frame& frame,
                           const Endpoint& peer) noexcept = 0;
  void keep_frames(std::uint16_t interface, std::span<const Frame> frames, std::uint64_t dropped) noexcept;

  const bool keeps_;
  HostTime now_;
};

}  // namespace imud
