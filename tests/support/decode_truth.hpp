// Decodes one record of truth, as a datagram.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "protocols/truth_format.hpp"

namespace imud {

// `datagram` must contain exactly one record.
inline TruthResult decode_truth(TruthDecoder& decoder, std::span<const std::byte> datagram, Truth& truth) {
  decoder.feed(datagram, TruthInput::datagram, {});
  const auto result = decoder.next(truth);
  EXPECT_TRUE(result.has_value());
  Truth further;
  EXPECT_FALSE(decoder.next(further).has_value());
  return result.value_or(TruthResult::no_state);
}

// Returns the remark on the last record, which has given `result` and must still be in its memory.
inline std::string remark(const TruthDecoder& decoder, TruthResult result) {
  std::string text(1000, '\0');
  text.resize(decoder.describe(result, text));
  return text;
}

}  // namespace imud
