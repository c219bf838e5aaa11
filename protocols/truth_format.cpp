#include "protocols/truth_format.hpp"

namespace imud {

void TruthDecoder::acknowledge(const Truth&, TruthTime, std::uint64_t, FrameBuffer&) noexcept {}

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
