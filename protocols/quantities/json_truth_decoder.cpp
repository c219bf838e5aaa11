#include "protocols/quantities/json_truth_decoder.hpp"

#include <algorithm>
#include <utility>

#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

using Outcome = JsonFields::Outcome;

std::string_view first_line(std::string_view text) noexcept { return text.substr(0, text.find('\n')); }

}  // namespace

JsonTruthDecoder::JsonTruthDecoder(TruthMap map, const QuantitySet& required, const TruthAssembly::Axes& axes,
                                   TruthFrame frame)
    : fields_(std::move(map)), axes_(axes), wanted_(required), frame_(frame) {}

void JsonTruthDecoder::feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept {
  has_datagram_ = input == TruthInput::datagram;
  datagram_ = {reinterpret_cast<const char*>(bytes.data()), has_datagram_ ? bytes.size() : 0};
  LineTruthDecoder::feed(bytes.first(has_datagram_ ? 0 : bytes.size()), TruthInput::stream, arrival);
}

std::optional<TruthResult> JsonTruthDecoder::next(Truth& truth) noexcept {
  if (const auto result = LineTruthDecoder::next(truth)) return result;
  if (!std::exchange(has_datagram_, false)) return std::nullopt;
  datagram_ = trim(without_order_mark(datagram_));
  std::size_t end = 0;
  const TruthResult result = decode(datagram_, truth, end);
  datagram_.remove_prefix(end);
  has_datagram_ = !datagram_.empty();
  return result;
}

// A parser may ignore a byte order mark (RFC 8259, 8.1).
TruthResult JsonTruthDecoder::decode(std::string_view line, Truth& truth) noexcept {
  std::size_t end = 0;
  return decode(without_order_mark(line), truth, end);
}

// Decodes the record at the begin of `text`, and sets `size` to the size of the record. If the text does not begin
// with an object, or if more text follows the object on its last line, the record is the first line.
TruthResult JsonTruthDecoder::decode(std::string_view text, Truth& truth, std::size_t& size) noexcept {
  record_ = first_line(text);
  size = record_.size();
  outcome_ = Outcome::whole;
  is_blank_ = trim(record_).empty();
  if (is_blank_) return TruthResult::no_state;
  outcome_ = fields_.read(text, reading_);
  if (outcome_ == Outcome::cut || outcome_ == Outcome::faulty) outcome_ = fields_.read(record_, reading_);
  if (outcome_ == Outcome::cut) return TruthResult::too_short;
  if (outcome_ == Outcome::faulty) return TruthResult::not_this_kind;
  const std::string_view after = first_line(text.substr(fields_.position()));
  if (!trim(after).empty()) {
    outcome_ = Outcome::faulty;
    return TruthResult::not_this_kind;
  }
  size = fields_.position() + after.size();
  record_ = text.substr(0, size);
  if (outcome_ == Outcome::refused) return fields_.refused().cause;
  const QuantitySet given = chosen(fields_.given());
  if (given.none()) return TruthResult::no_state;
  if ((wanted_ & ~given).any()) return TruthResult::too_short;
  if (!is_assembled_ || given != assembly_.given()) {
    RemarkWriter fault(fault_);
    is_assembled_ = assembly_.choose(given, axes_, fault);
    fault_size_ = fault.size();
  }
  return is_assembled_ ? assembly_.convert(reading_, truth) : TruthResult::no_columns;
}

std::size_t JsonTruthDecoder::describe(TruthResult result, std::span<char> room) const noexcept {
  RemarkWriter out(room);
  switch (result) {
    case TruthResult::no_state:
      if (is_blank_) break;
      (out << "an object has no quantity of truth: ").quote(record_);
      describe_unknown_names(out);
      break;
    case TruthResult::not_this_kind:
      (out << "no JSON object, or something after it, at character " << fields_.position() << ": ").quote(record_);
      break;
    case TruthResult::too_short:
      if (outcome_ == Outcome::cut)
        (out << "the text ends within an object: ").quote(record_);
      else
        describe_missing(out);
      break;
    case TruthResult::no_columns:
      if (outcome_ == Outcome::refused) {
        out << "an object has " << quantity_name(fields_.refused().quantity) << " twice; the second is ";
        out.quote(fields_.refused().value, 64);
        break;
      }
      out << std::string_view(fault_.data(), fault_size_);
      describe_unknown_names(out);
      break;
    case TruthResult::bad_number:
    case TruthResult::not_finite:
    case TruthResult::out_of_range:
      if (outcome_ != Outcome::refused) {
        assembly_.describe(reading_, out);
        break;
      }
      (out << quantity_name(fields_.refused().quantity) << " has ").quote(fields_.refused().value, 64);
      if (fields_.refused().quantity == quantity_group(TruthGroup::utc).first) out << date_form;
      break;
    default:
      break;
  }
  return out.size();
}

void JsonTruthDecoder::describe_missing(RemarkWriter& out) const noexcept {
  const char* separator = "an object lacks ";
  for (const MappedQuantity& mapped : fields_.map()) {
    if (!wanted_[mapped.field.quantity] || fields_.given()[mapped.field.quantity]) continue;
    (out << std::exchange(separator, ", ")).quote(mapped.theirs, 64);
    out << " (" << mapped.ours;
    for (const std::string_view name : fields_.unknown())
      if (is_near(name, mapped.theirs)) (out << "; is it ").quote(name, 64) << "?";
    out << ")";
  }
}

// Without a map the names are names of quantities.
void JsonTruthDecoder::describe_unknown_names(RemarkWriter& out) const noexcept {
  if (!fields_.map().empty()) return;
  for (const std::string_view name : fields_.unknown()) describe_no_quantity(name, out);
}

void JsonTruthDecoder::finish() noexcept {
  LineTruthDecoder::finish();
  assembly_.begin();
}

}  // namespace imud
