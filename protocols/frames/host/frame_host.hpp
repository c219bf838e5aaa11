// FrameHost: the receiver of a described unit: holds the unit's settings, and executes the host's requests.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.hpp"
#include "protocols/frames/host/frame_requests.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud {

// A line consists of printable characters and ends with CR or LF. At any other byte a binary request may begin. An
// unfinished line is discarded if no byte is received for 1 s, since people may type it. The first byte of an
// unfinished binary request is discarded after 1 s, and after 2 s at the latest; then requests behind this byte are
// executed. So noise that looks like the begin of a request delays answers, but does not hide requests. At power on,
// and at a restart by a request, the unit loads its stored settings and streams. After construction nothing here
// allocates or throws. One thread.
class FrameHost {
 public:
  // The unit that owns the FrameHost.
  class Unit {
   public:
    virtual Reading newest() const noexcept = 0;  // sample
    // Must send a message once: immediately with the newest sample or, if there is no sample yet, with the first one.
    virtual void poll_message(std::size_t message, FrameBuffer& out) noexcept = 0;
    // Is called when settings have changed, or the stream was switched.
    virtual void switch_messages() noexcept = 0;
    // Must start the unit as at power on.
    virtual void restart(DeviceTime now) noexcept = 0;

   protected:
    ~Unit() = default;
  };

  explicit FrameHost(std::shared_ptr<const FrameRequests> requests);

  const FrameRequests& requests() const noexcept { return *requests_; }
  // Stores a value as if a host had saved it.
  void store(FrameChosen chosen) noexcept;

  void power_on() noexcept;
  void receive(std::span<const std::byte> bytes, DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept;
  // Returns the time at which the next delayed answer is due, or an unfinished request is to be discarded. An answer
  // waits for all earlier answers.
  std::optional<DeviceTime> deadline() const noexcept;
  // Sends the delayed answers that are due, and discards an unfinished request if its time is over.
  void poll(DeviceTime now, Unit& unit, FrameBuffer& out) noexcept;
  void step_clock(Nanoseconds by) noexcept;

  bool is_streaming() const noexcept { return is_streaming_; }
  std::span<const FrameValue> values() const noexcept { return values_; }  // of all settings
  // Returns the bit rate of the line; nullopt if no setting has it. A new bit rate takes effect after the answer.
  std::optional<unsigned> baud() const noexcept;
  // Returns the index of the last request that was executed, or refused with the answer `otherwise`.
  std::optional<std::size_t> newest_request() const noexcept { return newest_request_; }
  std::uint64_t unknown_bytes() const noexcept { return unknown_bytes_; }  // bytes that no request has matched
  std::uint64_t lost_answers() const noexcept { return lost_answers_; }    // answers for which there was no room

 private:
  using Search = FrameSearch<FrameHostDescription::longest_request>;
  struct Delayed {
    DeviceTime due;
    std::size_t request = 0, size = 0;
    bool is_refusal = false;
  };
  static constexpr std::size_t most_delayed = 8;

  void start() noexcept;
  DeviceTime expiry() const noexcept;
  void expire(DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept;
  std::size_t parse(std::span<const std::byte> held, DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept;
  std::size_t parse_unknown(std::span<const std::byte> held, bool& is_unfinished, const Unit& unit,
                            FrameBuffer& replies) noexcept;
  std::size_t parse_line(std::span<const std::byte> held, std::size_t size, bool is_unfinished, DeviceTime now,
                         Unit& unit, FrameBuffer& replies) noexcept;
  void execute(std::size_t index, const FrameCaptures& captures, DeviceTime now, Unit& unit,
               FrameBuffer& replies) noexcept;
  void change_settings(const FrameRequest& request, const FrameCaptures& captures) noexcept;
  void set(FrameChosen chosen) noexcept;
  void answer(const FrameAnswer& answer, const FrameCaptures& captures, const Unit& unit, FrameBuffer& out) noexcept;
  void delay(std::size_t index, const FrameAnswer& answer, const FrameCaptures& captures, DeviceTime now,
             const Unit& unit) noexcept;
  void set_line() noexcept;
  void finish(std::size_t index, DeviceTime now, Unit& unit, FrameBuffer& out) noexcept;
  std::span<std::byte> delayed_bytes(std::size_t slot) noexcept;

  std::shared_ptr<const FrameRequests> requests_;
  std::vector<FrameValue> stored_, values_;
  FrameValue line_value_ = 0;  // of the setting that has the bit rate
  bool is_streaming_ = true;
  Search search_;
  bool holds_line_ = false;  // the held bytes are the begin of a line, and of no binary request
  DeviceTime last_;          // of the newest byte
  DeviceTime begun_;         // time at which the newest of the `old_` bytes was received
  std::size_t old_ = 0;      // number of the held bytes, from the first one on, that expire together
  std::array<Delayed, most_delayed> delayed_;
  std::size_t first_delayed_ = 0, delayed_count_ = 0;
  std::vector<std::byte> delayed_bytes_;
  std::optional<std::size_t> newest_request_;
  std::uint64_t unknown_bytes_ = 0, lost_answers_ = 0;
};

}  // namespace imud
