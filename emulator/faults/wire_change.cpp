#include "emulator/faults/wire_change.hpp"

#include <algorithm>
#include <cmath>

namespace imud {
namespace {

// The speed of the sender in UartWire. Only the ratio of the two speeds matters.
constexpr unsigned nominal_baud = 100'000;

}  // namespace

void ChangingFrame::assign(std::span<const std::byte> bytes) noexcept {
  resize(bytes.size());
  std::copy_n(bytes.begin(), size_, bytes_.begin());
}

WireChange::WireChange(const ActiveFault& fault, const FaultNumbers& numbers) noexcept
    : fault_(fault), kind_(wire_fault(*fault.kind)), numbers_(numbers), probability_(-1) {
  update(fault);
}

void WireChange::update(const ActiveFault& fault) noexcept {
  fault_ = fault;
  if (kind_ != WireFault::bit_errors && kind_ != WireFault::byte_loss && kind_ != WireFault::byte_insertion) return;
  const double probability = std::clamp(fault.parameters[0] * fault.weight, 0.0, 1.0);
  if (probability == probability_) return;
  // The rest of a run is independent of its past, and drawn with the new probability.
  if (probability_ < 0 && kind_ == WireFault::bit_errors) is_wrong_ = numbers_.happens(probability);
  probability_ = probability;
  draw_run();
}

// Wrong and right bits alternate in runs whose lengths are geometric, so that each bit is wrong with probability p:
// the mean wrong run is L, the mean right run L (1 - p)/p. With L = 1/(1 - p) the bits are independent. (The
// model of E. N. Gilbert, Bell System Technical Journal 39, 1960, with errors only, and always, in its bad state.)
void WireChange::draw_run() noexcept {
  double ends = probability_;  // probability that the run ends with a bit
  if (kind_ == WireFault::bit_errors) {
    const double p = probability_, burst = fault_.parameters[1];
    const double end_of_wrong = burst < 1 ? 1 - p : 1 / burst;
    ends = is_wrong_ ? end_of_wrong : p >= 1 ? 1 : std::min(1.0, p * end_of_wrong / (1 - p));
    if (p >= 1 && is_wrong_) ends = 0;
  }
  left_ = numbers_.trials(ends);
}

void WireChange::change_bits(std::span<std::byte> bytes) noexcept {
  const std::uint64_t bits = 8 * bytes.size();
  for (std::uint64_t bit = 0; bit < bits;) {
    const std::uint64_t end = bit + std::min(left_, bits - bit);
    left_ -= end - bit;
    if (is_wrong_)
      for (; bit < end; ++bit) bytes[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    bit = end;
    if (left_ > 0) continue;
    is_wrong_ = !is_wrong_;
    draw_run();
  }
}

void WireChange::lose_bytes(ChangingFrame& frame) noexcept {
  std::size_t size = 0;
  const std::span<std::byte> bytes = frame.bytes();
  for (const std::byte byte : bytes) {
    if (--left_ > 0)
      bytes[size++] = byte;
    else
      draw_run();
  }
  frame.resize(size);
}

ChangingFrame& WireChange::insert_bytes(ChangingFrame& frame, ChangingFrame& other) noexcept {
  other.resize(0);
  for (const std::byte byte : frame.bytes()) {
    if (--left_ == 0) {
      other.push(static_cast<std::byte>(numbers_.below(256)));
      draw_run();
    }
    other.push(byte);
  }
  return other;
}

void WireChange::cut(ChangingFrame& frame) noexcept {
  const auto& [bytes, fraction, probability, unused] = fault_.parameters;
  if (!numbers_.happens(probability * fault_.weight)) return;
  const auto size = static_cast<double>(frame.bytes().size());
  frame.resize(static_cast<std::size_t>(std::min(size, bytes > 0 ? bytes : fraction * size)));
}

// Gives the frame the checks of a content with one wrong bit. The frame then has this wrong content, or the right
// one.
ChangingFrame& WireChange::reseal(ChangingFrame& frame, ChangingFrame& other, FrameSeal* seal,
                                  const CanHeader& can) noexcept {
  if (!numbers_.happens(fault_.parameters[0] * fault_.weight) || seal == nullptr) return frame;
  const double u = numbers_.uniform();
  const auto open = [&] { other.resize(seal->open(frame.bytes(), other.room())); };
  open();
  const std::span<std::byte> content = seal->reseal(other.bytes(), can);
  if (content.empty()) return frame;
  const std::size_t begin = static_cast<std::size_t>(content.data() - other.bytes().data()),
                    bits = 8 * content.size();
  const auto first = static_cast<std::size_t>(u * static_cast<double>(bits));
  for (std::size_t i = 0; i < bits; ++i) {
    const std::size_t number = (first + i) % bits;
    const auto bit = static_cast<std::byte>(1U << number % 8);
    open();
    std::byte& changed = other.bytes()[begin + number / 8];
    changed ^= bit;
    const std::byte wrong = changed;
    const std::span<std::byte> same = seal->reseal(other.bytes(), can);
    if (same.data() != content.data() || same.size() != content.size()) continue;  // a frame of another form
    if (((changed ^ wrong) & bit) != std::byte{0}) continue;                       // a bit of a check
    if (kind_ == WireFault::checksum_wrong) changed ^= bit;
    frame.resize(seal->close(other.bytes(), frame.room()));
    return frame;
  }
  return frame;
}

ChangingFrame& WireChange::resample(ChangingFrame& frame, ChangingFrame& other, UartSettings uart,
                                    bool is_last) noexcept {
  uart.baud = nominal_baud;
  to_host_.set(uart, static_cast<unsigned>(std::lround(nominal_baud * fault_.parameters[0])));
  std::size_t size = to_host_.carry(frame.bytes(), other.room());
  other.resize(size);
  if (is_last)
    if (const auto rest = to_host_.idle()) other.push(*rest);
  return other;
}

ChangingFrame& WireChange::change(ChangingFrame& frame, ChangingFrame& other, FrameSeal* seal, const CanHeader& can,
                                  const UartSettings& uart, bool is_last) noexcept {
  switch (kind_) {
    case WireFault::bit_errors:
      change_bits(frame.bytes());
      return frame;
    case WireFault::byte_loss:
      lose_bytes(frame);
      return frame;
    case WireFault::byte_insertion:
      return insert_bytes(frame, other);
    case WireFault::cut:
      cut(frame);
      return frame;
    case WireFault::checksum_wrong:
    case WireFault::content_wrong:
      return reseal(frame, other, seal, can);
    case WireFault::baud_wrong:
      return resample(frame, other, uart, is_last);
    case WireFault::garbage:
    case WireFault::line_break:
    case WireFault::silence:
    case WireFault::disconnect:
    case WireFault::half_bandwidth:
    case WireFault::bus_off:
    case WireFault::error_frames:
    case WireFault::same_id:
    case WireFault::babbling:
    case WireFault::bus_load:
    case WireFault::count:
      return frame;
  }
  return frame;
}

std::size_t WireChange::receive(std::span<const std::byte> sent, const UartSettings& uart,
                                std::span<std::byte> received) noexcept {
  UartSettings host = uart;
  host.baud = nominal_baud;
  from_host_.set(host, static_cast<unsigned>(std::lround(nominal_baud / fault_.parameters[0])));
  std::size_t size = from_host_.carry(sent, received.first(received.size() - 1));
  if (const auto rest = from_host_.idle()) received[size++] = *rest;
  return size;
}

std::size_t WireChange::due(double per_s, double period_s) noexcept {
  owed += per_s * fault_.weight * period_s;
  const double whole = std::max(0.0, std::floor(owed + 1e-9));  // ten times a tenth is one
  owed -= whole;
  return static_cast<std::size_t>(whole);
}

}  // namespace imud
