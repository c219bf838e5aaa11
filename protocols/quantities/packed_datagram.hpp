// PackedDatagramDecoder: truth formats whose datagrams all have the same PackedLayout.
#pragma once

#include <utility>

#include "protocols/quantities/packed_truth.hpp"

namespace imud {

class PackedDatagramDecoder : public DatagramTruthDecoder {
 public:
  TruthFrame frame() const noexcept override { return truth_.frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    const std::span<const std::byte> record = datagram();
    if (result == TruthResult::too_short || result == TruthResult::too_long)
      (out << "a datagram has " << record.size() << " bytes, and one of this format " << truth_.layout().size()
           << ": ")
          .quote({reinterpret_cast<const char*>(record.data()), record.size()}, 24);
    else if (result == TruthResult::not_finite || result == TruthResult::out_of_range)
      truth_.describe(out);
    return out.size();
  }

 protected:
  explicit PackedDatagramDecoder(PackedTruth truth) : truth_(std::move(truth)) {}
  TruthResult decode(std::span<const std::byte> record, Truth& truth) noexcept override {
    if (record.size() < truth_.layout().size()) return TruthResult::too_short;
    if (record.size() > truth_.layout().size()) return TruthResult::too_long;
    return truth_.convert(record, arrival(), truth);
  }

 private:
  PackedTruth truth_;
};

}  // namespace imud
