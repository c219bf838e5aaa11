// JsonTruthDecoder: truth formats whose records are JSON objects.
#pragma once

#include <array>
#include <string_view>

#include "protocols/quantities/json_fields.hpp"
#include "protocols/quantities/line_truth_decoder.hpp"

namespace imud {

// In a stream an object is a line, and a blank line is a record without state. In a datagram an object may have
// several lines, and further objects may follow, each on a line of its own; blank lines around them are not records.
class JsonTruthDecoder : public LineTruthDecoder {
 public:
  // Each object must have the `required` quantities. If `map` is empty, the names at the top level must be names
  // of quantities. `frame`: the result of frame(). Throws std::invalid_argument, "columns: ...".
  JsonTruthDecoder(TruthMap map, const QuantitySet& required, const TruthAssembly::Axes& axes, TruthFrame frame = {});

  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override;
  std::optional<TruthResult> next(Truth& truth) noexcept override;
  TruthFrame frame() const noexcept override { return frame_; }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override;
  void finish() noexcept override;

 private:
  // Returns the quantities from which the truth of an object is made. Default: all quantities of the object.
  virtual QuantitySet chosen(const QuantitySet& given) const noexcept { return given; }

  TruthResult decode(std::string_view line, Truth& truth) noexcept final;
  bool is_cut_short(TruthResult) const noexcept final { return !is_blank_; }
  TruthResult decode(std::string_view text, Truth& truth, std::size_t& size) noexcept;
  void describe_missing(RemarkWriter& out) const noexcept;
  void describe_unknown_names(RemarkWriter& out) const noexcept;

  JsonFields fields_;
  const TruthAssembly::Axes axes_;
  const QuantitySet wanted_;
  const TruthFrame frame_;
  TruthReading reading_;
  TruthAssembly assembly_;
  std::string_view datagram_;  // the part that is not decoded yet
  bool has_datagram_ = false;

  // Members of the last record.
  std::string_view record_;
  bool is_blank_ = true;
  JsonFields::Outcome outcome_ = JsonFields::Outcome::whole;
  bool is_assembled_ = false;  // whether assembly_ fits the quantities of the last object
  std::array<char, 400> fault_ = {};
  std::size_t fault_size_ = 0;
};

}  // namespace imud
