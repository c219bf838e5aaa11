#include "protocols/truth_format.hpp"

namespace imud {

void TruthDecoder::start(HostTime) noexcept {}
void TruthDecoder::finish() noexcept {}
std::optional<HostTime> TruthDecoder::deadline() const noexcept { return std::nullopt; }
void TruthDecoder::poll(HostTime, FrameBuffer&) noexcept {}
void TruthDecoder::acknowledge(const Truth&, TruthTime, std::uint64_t, FrameBuffer&) noexcept {}

void DatagramTruthDecoder::feed(std::span<const std::byte> bytes, TruthInput, HostTime) noexcept {
  datagram_ = bytes;
}

std::optional<TruthResult> DatagramTruthDecoder::next(Truth& truth) noexcept {
  if (!datagram_) return std::nullopt;
  const std::span<const std::byte> datagram = *datagram_;
  datagram_.reset();
  return decode(datagram, truth);
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
  }
  return "unknown";
}

}  // namespace imud
