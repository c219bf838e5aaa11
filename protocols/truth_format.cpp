#include "protocols/truth_format.hpp"

#include <utility>

namespace imud {

void TruthDecoder::start(HostTime) noexcept {}
TruthFrame TruthDecoder::frame() const noexcept { return {}; }
std::size_t TruthDecoder::describe(TruthResult, std::span<char>) const noexcept { return 0; }
void TruthDecoder::end_of_file() noexcept {}
void TruthDecoder::finish() noexcept {}
std::optional<HostTime> TruthDecoder::deadline() const noexcept { return std::nullopt; }
void TruthDecoder::poll(HostTime, FrameBuffer&) noexcept {}
void TruthDecoder::acknowledge(const Truth&, TruthTime, std::uint64_t, FrameBuffer&) noexcept {}
void TruthDecoder::set_servo(std::size_t, std::uint16_t) noexcept {}

void DatagramTruthDecoder::feed(std::span<const std::byte> bytes, TruthInput, HostTime arrival) noexcept {
  datagram_ = bytes;
  arrival_ = arrival;
  is_new_ = true;
}

std::optional<TruthResult> DatagramTruthDecoder::next(Truth& truth) noexcept {
  if (!std::exchange(is_new_, false)) return std::nullopt;
  return decode(datagram_, truth);
}

std::string_view cause(TruthResult result) noexcept {
  switch (result) {
    case TruthResult::ok:
      return "";
    case TruthResult::no_state:
      return "no_state";
    case TruthResult::too_short:
      return "short";
    case TruthResult::too_long:
      return "long";
    case TruthResult::not_this_kind:
      return "magic";
    case TruthResult::bad_version:
      return "version";
    case TruthResult::bad_checksum:
      return "crc";
    case TruthResult::bad_number:
      return "number";
    case TruthResult::not_finite:
      return "not_finite";
    case TruthResult::out_of_range:
      return "range";
    case TruthResult::no_columns:
      return "columns";
    case TruthResult::withheld:
      return "withheld";
  }
  return "unknown";
}

}  // namespace imud
