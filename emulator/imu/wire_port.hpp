// WirePort: a port on whose wire faults act.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/frame.hpp"
#include "emulator/faults/wire_change.hpp"
#include "emulator/ground/step_sink.hpp"
#include "emulator/plan/fault.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {

class Copies;

// Passes everything to the wrapped port. The active faults of wire_faults.hpp change the sent and received bytes.
// While no fault is active, nothing changes.
//
// A frame that a fault loses on the wire counts as sent, because the device has sent it. It counts as dropped where
// the port itself would drop it: the cable is out, the controller is off the bus, or the line is busy. Frames that
// others send (garbage, other nodes) are not counted. All frames of others that are due since the last sample leave
// at once, before the frames of the sample.
//
// Frames are dropped or changed in the call that brings them. Frames that the port held back before pass unchanged.
class WirePort final : public Port {
 public:
  struct Line {
    std::string_view imu;  // the imu's name, which selects the random numbers; only used by the constructor
    unsigned number = 0;   // the line's number: 0, or 1 for the second UART's line
    const Protocol* protocol = nullptr;
    double rate_hz = 0;      // of the samples
    UartSettings uart = {};  // the characters; baud 0: not known
    double bit_rate = 0;     // bit/s of line or bus; 0 if the rate is not known, or is in `uart`
    std::size_t most = 64;   // the number of faults that may act at once
    // Writes the checks of the frames; nullptr: the frames have none.
    std::unique_ptr<FrameSeal> seal = nullptr;
  };
  WirePort(std::unique_ptr<Port> port, Line line, std::uint64_t seed);

  // Sets the faults of the next sample, and sends the frames that other senders have put on the bus since the last
  // call. Must be called once for each sample, before the frames of the sample and of the device's deadlines up to
  // the sample are sent. No allocation.
  void set_active(std::span<const ActiveFault> faults) noexcept;
  // From now on gives `sink` the frames that leave, with the number `interface`, and the dropped frames, with the
  // number `interface` + 2.
  void set_sink(StepSink& sink, std::uint16_t interface) noexcept {
    sink_ = &sink;
    interface_ = interface;
  }
  // Sets the rate of the samples from the next sample on.
  void set_rate(double rate_hz) noexcept { period_s_ = 1 / rate_hz; }
  // Exchanges the writer of the checks, for a device with other settings.
  void exchange(std::unique_ptr<FrameSeal>& seal) noexcept { std::swap(seal_, seal); }
  // Exchanges the wrapped port. The active faults go on. The frames and the counters then belong to the new port
  // alone. Returns how many of the frames that the old port holds back are not the device's.
  std::uint64_t exchange(std::unique_ptr<Port>& port) noexcept;
  // Sets the bit rate of the line or the bus, Line::bit_rate.
  void set_bit_rate(double bit_rate) noexcept { bit_rate_ = bit_rate; }
  // Returns the state of the wrapped port, in which a fault that takes the cable out does not show.
  PortState state_of_port() const noexcept { return port_->state(); }
  // From now on sends the frames that leave to `copies`, too. `copies` must outlive this.
  void set_copies(Copies* copies) noexcept { copies_ = copies; }

  void send(std::span<const Frame> frames) noexcept override;
  void discard_pending() noexcept override;
  void commit() override { port_->commit(); }
  std::optional<Received> receive() noexcept override;
  bool at_end() const noexcept override { return port_->at_end(); }
  std::string_view end_warning() const noexcept override { return port_->end_warning(); }
  std::optional<bool> keeps_datagrams() const noexcept override { return port_->keeps_datagrams(); }
  std::string_view other_content() const noexcept override { return port_->other_content(); }
  void set_line(const UartSettings& line) noexcept override;
  void set_connected(bool connected) noexcept override;
  bool set_break(bool on) noexcept override { return port_->set_break(on); }
  void flush() noexcept override;
  // The channel flushes a port only while frames of its own are held back.
  std::optional<HostTime> next_flush() const noexcept override {
    return own_held_ > 0 ? port_->next_flush() : std::nullopt;
  }
  bool wants_output() const noexcept override { return own_held_ > 0 && port_->wants_output(); }
  bool is_drained() noexcept override;
  bool has_room() const noexcept override { return port_->has_room(); }
  bool can_receive() const noexcept override { return port_->can_receive(); }
  void set_filters(std::span<const CanFilter> filters) noexcept override { port_->set_filters(filters); }
  std::optional<Confirmation> next_confirmation() noexcept override { return port_->next_confirmation(); }
  int descriptor() const noexcept override { return port_->descriptor(); }
  std::string chosen_port() const override { return port_->chosen_port(); }
  std::optional<double> progress() const noexcept override { return port_->progress(); }

 private:
  // The way of the frames of a sample.
  enum class Passage : std::uint8_t {
    open,
    lost,     // the frames leave the device, and arrive nowhere
    dropped,  // the port does not accept them
  };

  void begin(WireChange& change) noexcept;
  void end(WireChange& change) noexcept;
  void prepare(WireChange& change) noexcept;
  void send_others(WireChange& change) noexcept;
  double add_other(const CanHeader& can, std::size_t size, WireChange& change, bool is_random) noexcept;
  void change(std::span<const Frame> transfer, bool is_last) noexcept;
  void add_own(const Frame& frame, std::span<const std::byte> bytes) noexcept;
  void pass(std::span<const Frame> frames, std::size_t own) noexcept;
  void deliver() noexcept;
  void lose(std::span<const Frame> frames) noexcept;
  void mirror() noexcept;
  double bit_rate() const noexcept;

  std::unique_ptr<Port> port_;
  const Protocol& protocol_;
  std::unique_ptr<FrameSeal> seal_;
  double period_s_;
  const std::uint64_t seed_;
  const std::uint32_t stream_;
  UartSettings uart_;
  double bit_rate_;
  StepSink* sink_ = &StepSink::none();
  Copies* copies_ = nullptr;
  std::uint16_t interface_ = 0;

  std::vector<WireChange> active_, last_;  // with room for Line::most
  Passage passage_ = Passage::open;
  bool is_deaf_ = false;
  bool is_off_ = false;  // the cable is out, or the controller is off the bus
  bool has_bus_load_ = false;
  double bus_bits_ = 0;  // of frames since the last sample, for bus_load

  ChangingFrame frame_, other_;
  FrameBuffer out_;          // passed to the port by deliver()
  std::size_t out_own_ = 0;  // frames of the device among these
  std::array<std::byte, FrameBuffer::max_bytes> incoming_;

  // Frames of the device and of others that the port holds back, and its counts at the last look.
  std::uint64_t own_held_ = 0, others_held_ = 0, seen_sent_ = 0, seen_dropped_ = 0;
  std::uint64_t sent_ = 0, dropped_ = 0, lost_replies_ = 0;
  std::uint64_t losses_ = 0, bus_offs_ = 0, bus_restarts_ = 0;  // beside the port's counts
};

}  // namespace imud
