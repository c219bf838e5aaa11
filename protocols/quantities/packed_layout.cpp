#include "protocols/quantities/packed_layout.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

constexpr std::array<std::string_view, 10> type_names = {"u8",  "i8",  "u16", "i16", "u32",
                                                         "i32", "u64", "i64", "f32", "f64"};
constexpr std::array<std::size_t, 10> type_sizes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
constexpr std::string_view padding = "_";

[[noreturn]] void refuse(std::string_view field, const std::string& fault) {
  throw std::invalid_argument("\"" + std::string(field) + "\": " + fault);
}

}  // namespace

PackedLayout::PackedLayout(std::span<const std::string> fields, boost::endian::order order, std::size_t begin)
    : is_big_(order == boost::endian::order::big), size_(begin) {
  for (const std::string& field : fields) add(field);
}

PackedLayout::PackedLayout(std::span<const std::string_view> fields, boost::endian::order order, std::size_t begin)
    : is_big_(order == boost::endian::order::big), size_(begin) {
  for (const std::string_view field : fields)
    for (const std::string& one : names_in(field)) add(one);
}

void PackedLayout::add(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == text.npos) refuse(text, "a field is NAME:TYPE, such as time_s:f64, and padding _:BYTES");
  const std::string_view name = text.substr(0, colon);
  std::string_view type_name = text.substr(colon + 1);
  if (name == padding) {
    const auto bytes = number_in<std::uint32_t>(type_name);
    if (!bytes || *bytes == 0 || *bytes > largest_size) refuse(text, "give the padding's bytes, 1 to 65535, as _:4");
    size_ += *bytes;
  } else {
    Field field;
    const std::size_t star = type_name.find('*');
    if (star != type_name.npos) {
      const auto scale = finite_number_in(type_name.substr(star + 1));
      if (!scale || *scale == 0) refuse(text, "the scale must be a number, as in i32*1e-7");
      field.scale = *scale;
      type_name = type_name.substr(0, star);
    }
    const auto type = std::ranges::find(type_names, type_name);
    if (type == type_names.end())
      refuse(text,
             "unknown type \"" + std::string(type_name) + "\"; there are u8 i8 u16 i16 u32 i32 u64 i64 f32 f64");
    const auto quantity = find_truth_field(name);
    if (!quantity) refuse(text, unknown_quantity(name));
    if (quantity->kind == QuantityKind::text) refuse(text, "a text has no binary type; give unix_time_s");
    if (given_[quantity->quantity]) refuse(text, "this quantity is given twice");
    given_.set(quantity->quantity);
    field.type = static_cast<Type>(type - type_names.begin());
    field.quantity = *quantity;
    field.offset = size_;
    const std::size_t bytes = type_sizes[static_cast<std::size_t>(field.type)];
    size_ += bytes;
    constexpr std::size_t widest_that_wraps = 4;
    if (quantity->quantity == quantity_group(TruthGroup::time).first && bytes <= widest_that_wraps &&
        field.type != Type::f32) {
      const double modulus =
          std::ldexp(field.scale, static_cast<int>(8 * bytes)) * std::pow(10.0, field.quantity.exponent);
      constexpr double longest_round = 0x1p53;  // ns, 104 days: many rounds are still in the range of a time
      if (std::abs(modulus) < longest_round) time_modulus_ = std::llround(std::abs(modulus));
    }
    fields_.push_back(field);
  }
  if (size_ > largest_size) refuse(text, "with this field the record has more than 65535 bytes");
}

PackedLayout::Raw PackedLayout::raw(const Field& field, std::span<const std::byte> record) const noexcept {
  const std::size_t size = type_sizes[static_cast<std::size_t>(field.type)];
  Raw raw;
  for (std::size_t i = 0; i < size; ++i)
    raw.bits = raw.bits << 8 | std::to_integer<std::uint64_t>(record[field.offset + (is_big_ ? i : size - 1 - i)]);
  switch (field.type) {
    case Type::f32:
      raw.number = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw.bits)));
      return raw;
    case Type::f64:
      raw.number = std::bit_cast<double>(raw.bits);
      return raw;
    case Type::i8:
      raw.integer = static_cast<std::int8_t>(raw.bits);
      break;
    case Type::i16:
      raw.integer = static_cast<std::int16_t>(raw.bits);
      break;
    case Type::i32:
      raw.integer = static_cast<std::int32_t>(raw.bits);
      break;
    default:
      raw.integer = static_cast<std::int64_t>(raw.bits);
      break;
  }
  raw.number = field.type == Type::u64 ? static_cast<double>(raw.bits) : static_cast<double>(raw.integer);
  return raw;
}

TruthResult PackedLayout::read(std::span<const std::byte> record, TruthReading& out) noexcept {
  refused_ = nullptr;
  for (const Field& field : fields_) {
    const Raw raw = this->raw(field, record);
    // An integer time is exact; as a double it would be rounded.
    const bool is_exact = field.quantity.kind == QuantityKind::time && field.scale == 1 && field.type != Type::f32 &&
                          field.type != Type::f64;
    const bool fits = field.type != Type::u64 || raw.bits <= std::numeric_limits<std::int64_t>::max();
    const TruthResult result = !is_exact ? out.set(field.quantity, field.scale * raw.number)
                               : fits    ? out.set(field.quantity, raw.integer)
                                         : TruthResult::out_of_range;
    if (result == TruthResult::ok) continue;
    refused_ = &field;
    refused_number_ = raw.number;
    return result;
  }
  return TruthResult::ok;
}

void PackedLayout::describe(RemarkWriter& out) const noexcept {
  if (refused_ == nullptr) return;
  out << quantity_name(refused_->quantity.quantity) << ", " << type_names[static_cast<std::size_t>(refused_->type)]
      << " at byte " << refused_->offset << ", is ";
  if (std::isnan(refused_number_))
    out << "nan";  // whatever its sign
  else
    out << refused_number_;
}

}  // namespace imud
