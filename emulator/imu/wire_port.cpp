#include "emulator/imu/wire_port.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "emulator/imu/copies.hpp"
#include "transports/can/can_bits.hpp"
#include "transports/can/can_error.hpp"

namespace imud {

namespace {

constexpr CanHeader highest_priority = {.id = 0}, lowest_priority = {.id = 0x7FF};

}  // namespace

WirePort::WirePort(std::unique_ptr<Port> port, Line line, std::uint64_t seed)
    : port_(std::move(port)),
      protocol_(*line.protocol),
      seal_(std::move(line.seal)),
      period_s_(1 / line.rate_hz),
      seed_(seed),
      stream_(stream_id(fmt::format("{}/wire/{}", line.imu, line.number))),
      uart_(line.uart),
      bit_rate_(line.bit_rate) {
  active_.reserve(line.most);
  last_.reserve(line.most);
  mirror();
}

double WirePort::bit_rate() const noexcept { return uart_.baud != 0 ? static_cast<double>(uart_.baud) : bit_rate_; }

void WirePort::set_active(std::span<const ActiveFault> faults) noexcept {
  if (faults.empty() && active_.empty()) return;
  faults = faults.first(std::min(faults.size(), active_.capacity()));
  std::swap(active_, last_);
  active_.clear();
  const std::span<WireChange> before(last_);
  const auto same = [](const ActiveFault& fault) {
    return [&fault](const WireChange& change) {
      const ActiveFault& other = change.fault();
      return fault.since > 0 && other.kind == fault.kind && other.number == fault.number &&
             other.occurrence == fault.occurrence;
    };
  };
  for (WireChange& change : before)
    if (std::ranges::none_of(faults, [&](const ActiveFault& fault) { return same(fault)(change); })) end(change);

  passage_ = Passage::open;
  is_deaf_ = is_off_ = has_bus_load_ = false;
  for (const ActiveFault& fault : faults) {
    WireChange& change = active_.emplace_back();
    const auto old = std::ranges::find_if(before, same(fault));
    if (old != before.end()) {
      change = *old;
      change.update(fault);
    } else {
      change = WireChange(fault, FaultNumbers(seed_, stream_, fault.number, fault.occurrence));
      begin(change);
    }
    prepare(change);
  }
  for (WireChange& change : active_) send_others(change);
  deliver();
  mirror();
}

std::uint64_t WirePort::exchange(std::unique_ptr<Port>& port) noexcept {
  const auto has = [this](WireFault kind) {
    return std::ranges::any_of(active_, [&](WireChange& change) { return change.kind() == kind; });
  };
  if (has(WireFault::line_break)) {
    port_->set_break(false);
    port->set_break(true);
  }
  if (has(WireFault::disconnect)) port->set_connected(false);
  std::swap(port_, port);
  own_held_ = seen_sent_ = seen_dropped_ = sent_ = dropped_ = lost_replies_ = losses_ = bus_offs_ = bus_restarts_ = 0;
  const std::uint64_t of_others = std::exchange(others_held_, 0);
  mirror();
  return of_others;
}

void WirePort::begin(WireChange& change) noexcept {
  if (change.kind() == WireFault::line_break && !port_->set_break(true)) {
    change.owed = 1;  // the byte that a receiver gets
  } else if (change.kind() == WireFault::disconnect) {
    port_->set_connected(false);
    if (port_->state() != PortState::lost) ++losses_;
  } else if (change.kind() == WireFault::bus_off) {
    ++losses_;
    ++bus_offs_;
  }
}

void WirePort::end(WireChange& change) noexcept {
  if (change.kind() == WireFault::line_break) port_->set_break(false);
  if (change.kind() == WireFault::disconnect) port_->set_connected(true);
  if (change.kind() == WireFault::bus_off) ++bus_restarts_;
}

// Determines the passage of the sample's frames.
void WirePort::prepare(WireChange& change) noexcept {
  switch (change.kind()) {
    case WireFault::line_break:
      passage_ = std::max(passage_, Passage::lost);
      break;
    case WireFault::silence:
      passage_ = std::max(passage_, Passage::lost);
      is_deaf_ = true;
      break;
    case WireFault::disconnect:
    case WireFault::bus_off:
      passage_ = Passage::dropped;
      is_deaf_ = is_off_ = true;
      break;
    case WireFault::bus_load:
      has_bus_load_ = true;
      break;
    case WireFault::half_bandwidth: {
      // The bits that the line has still to carry.
      const auto& [part, baud, unused, unused_too] = change.fault().parameters;
      change.owed = std::max(0.0, change.owed - part * (bit_rate() > 0 ? bit_rate() : baud) * period_s_);
      if (change.owed > 1e-6) passage_ = Passage::dropped;
      break;
    }
    case WireFault::bit_errors:
    case WireFault::byte_loss:
    case WireFault::byte_insertion:
    case WireFault::cut:
    case WireFault::checksum_wrong:
    case WireFault::content_wrong:
    case WireFault::garbage:
    case WireFault::baud_wrong:
    case WireFault::error_frames:
    case WireFault::same_id:
    case WireFault::babbling:
    case WireFault::count:
      break;
  }
}

// Adds the frames of other senders in the time of a sample.
void WirePort::send_others(WireChange& change) noexcept {
  const auto& parameters = change.fault().parameters;
  const bool is_break = change.kind() == WireFault::line_break;
  if (protocol_.link == Link::bytes && passage_ != Passage::open && !(is_break && passage_ == Passage::lost)) return;
  switch (change.kind()) {
    case WireFault::line_break:
      if (std::exchange(change.owed, 0) > 0) add_other({}, 1, change, false);
      break;
    case WireFault::garbage:
      for (std::size_t bytes = change.due(parameters[0], period_s_); bytes > 0;) {
        constexpr std::size_t most = 1024;
        const std::size_t size = std::min(bytes, most);
        add_other({}, size, change, true);
        bytes -= size;
      }
      break;
    case WireFault::error_frames:
      for (std::size_t n = change.due(parameters[0], period_s_); n > 0; --n)
        add_other(bus_error_header, bus_error_data.size(), change, false);
      break;
    case WireFault::babbling:
      for (std::size_t n = change.due(parameters[0], period_s_); n > 0; --n)
        add_other(highest_priority, 8, change, false);
      break;
    case WireFault::bus_load: {
      const double per_sample = (bit_rate() > 0 ? bit_rate() : parameters[1]) * period_s_;
      const double share = parameters[0] / 100 * change.fault().weight;
      // A sample whose frames exceed the load has no effect on later samples.
      change.owed = std::max(0.0, change.owed + share * per_sample - std::exchange(bus_bits_, 0));
      while (change.owed >= most_can_bits(lowest_priority, 8).nominal)
        change.owed -= add_other(lowest_priority, 8, change, true);
      bus_bits_ = 0;
      break;
    }
    case WireFault::bit_errors:
    case WireFault::byte_loss:
    case WireFault::byte_insertion:
    case WireFault::cut:
    case WireFault::checksum_wrong:
    case WireFault::content_wrong:
    case WireFault::silence:
    case WireFault::baud_wrong:
    case WireFault::disconnect:
    case WireFault::half_bandwidth:
    case WireFault::bus_off:
    case WireFault::same_id:
    case WireFault::count:
      break;
  }
}

// Adds a frame that is not the device's, and returns its bits on a CAN bus.
double WirePort::add_other(const CanHeader& can, std::size_t size, WireChange& change, bool is_random) noexcept {
  if (out_.room(size).size() < size || out_.frames().size() == FrameBuffer::max_frames) deliver();
  const std::span<std::byte> data = out_.room(size);
  if (data.size() < size) return 0;
  for (std::size_t i = 0; i < size; ++i)
    data[i] = is_random   ? static_cast<std::byte>(change.numbers().below(256))
              : can.error ? bus_error_data[i]
                          : std::byte{};
  out_.push(size, can);
  const double bits = protocol_.link == Link::can && !can.error ? can_bits(out_.frames().back()).nominal : 0;
  bus_bits_ += bits;
  return bits;
}

void WirePort::send(std::span<const Frame> frames) noexcept {
  if (active_.empty() || frames.empty()) {
    pass(frames, frames.size());
  } else if (passage_ != Passage::open) {
    lose(frames);
  } else {
    while (!frames.empty()) {
      const std::size_t size = seal_ != nullptr ? seal_->transfer(frames) : 1;
      change(frames.first(size), size == frames.size());
      frames = frames.subspan(size);
    }
    deliver();
  }
  mirror();
}

// Changes one frame, or the frames of a transfer, whose sizes and headers stay as they are.
void WirePort::change(std::span<const Frame> transfer, bool is_last) noexcept {
  frame_.resize(0);
  for (const Frame& frame : transfer)
    for (const std::byte byte : frame.bytes) frame_.push(byte);
  ChangingFrame* changed = &frame_;
  for (WireChange& fault : active_) {
    ChangingFrame& other = changed == &frame_ ? other_ : frame_;
    changed = &fault.change(*changed, other, seal_.get(), transfer[0].can, uart_, is_last);
    if (fault.kind() == WireFault::half_bandwidth)
      fault.owed += static_cast<double>(changed->bytes().size() * uart_.bits_per_character());
  }
  std::span<const std::byte> bytes = changed->bytes();
  for (const Frame& frame : transfer) {
    const std::size_t size = transfer.size() == 1 ? bytes.size() : frame.bytes.size();
    add_own(frame, bytes.first(size));
    bytes = bytes.subspan(size);
  }
}

// Adds a frame of the device, changed to `bytes`, and the frames of others that follow it.
void WirePort::add_own(const Frame& frame, std::span<const std::byte> bytes) noexcept {
  if (bytes.empty() && !frame.bytes.empty()) {
    ++sent_;
    if (is_reply_) ++lost_replies_;
    return;
  }
  if (out_.room(bytes.size()).size() < bytes.size() || out_.frames().size() == FrameBuffer::max_frames) deliver();
  out_.append(bytes, frame.can, frame.uart);
  ++out_own_;
  if (has_bus_load_) bus_bits_ += can_bits(out_.frames().back()).nominal;
  if (is_reply_ || frame.can.remote) return;
  for (WireChange& fault : active_)
    if (fault.kind() == WireFault::same_id &&
        fault.numbers().happens(fault.fault().parameters[0] * fault.fault().weight))
      add_other(frame.can, bytes.size(), fault, true);
}

void WirePort::deliver() noexcept {
  if (out_.frames().empty()) return;
  pass(out_.frames(), out_own_);
  out_.clear();
  out_own_ = 0;
}

// `own` of the frames are the device's.
void WirePort::pass(std::span<const Frame> frames, std::size_t own) noexcept {
  port_->set_time(time_);
  const std::uint64_t dropped = port_->counters().dropped;
  if (is_reply_)
    port_->reply(frames);
  else
    port_->send(frames);
  own_held_ += own;
  others_held_ += frames.size() - own;
  sink_->frames(interface_, frames, port_->counters().dropped - dropped);
  if (copies_ != nullptr) copies_->send(frames, time_, is_reply_);
}

void WirePort::lose(std::span<const Frame> frames) noexcept {
  (passage_ == Passage::lost ? sent_ : dropped_) += frames.size();
  if (passage_ == Passage::lost && is_reply_) lost_replies_ += frames.size();
  sink_->frames(interface_, frames, frames.size());
}

std::optional<Port::Received> WirePort::receive() noexcept {
  if (is_deaf_) {
    for (int n = 0; n < 16 && port_->receive(); ++n) {
    }
    mirror();
    return std::nullopt;
  }
  std::optional<Received> received = port_->receive();
  mirror();
  if (!received) return received;
  for (WireChange& fault : active_) {
    if (fault.kind() != WireFault::baud_wrong) continue;
    const std::size_t size = fault.receive(received->frame.bytes, uart_, incoming_);
    if (size == 0) return std::nullopt;
    received->frame.bytes = std::span<const std::byte>(incoming_).first(size);
    break;  // there is one UART
  }
  return received;
}

void WirePort::set_line(const UartSettings& line) noexcept {
  uart_ = line;
  port_->set_line(line);
  mirror();
}

void WirePort::set_connected(bool connected) noexcept {
  port_->set_connected(connected);
  mirror();
}

void WirePort::discard_pending() noexcept {
  port_->discard_pending();
  mirror();
}

void WirePort::flush() noexcept {
  port_->flush();
  mirror();
}

bool WirePort::is_drained() noexcept {
  const bool is_drained = port_->is_drained();
  mirror();
  return is_drained;
}

// Copies the state and the counters of the port. Of the frames that the port has sent or dropped, the frames of other
// senders are counted first. So no frame that the port holds back counts as sent.
void WirePort::mirror() noexcept {
  const PortCounters& now = port_->counters();
  const auto settle = [this](std::uint64_t frames, std::uint64_t& own) {
    const std::uint64_t others = std::min(frames, others_held_);
    const std::uint64_t ours = std::min(frames - others, own_held_);
    others_held_ -= others;
    own_held_ -= ours;
    own += ours;
  };
  settle(now.sent - std::exchange(seen_sent_, now.sent), sent_);
  settle(now.dropped - std::exchange(seen_dropped_, now.dropped), dropped_);
  counters_ = now;
  counters_.sent = sent_;
  counters_.dropped = dropped_;
  counters_.replies = std::min(now.replies + lost_replies_, sent_);
  counters_.lost_count += losses_;
  counters_.bus_offs += bus_offs_;
  counters_.bus_restarts += bus_restarts_;
  state_ = is_off_ ? PortState::lost : port_->state();
  error_ = port_->error();
  speeds_ = port_->speeds();
}

}  // namespace imud
