// PackedLayout: describes a binary record as a list of fields, which are named by truth quantities
// (protocols/quantities/truth_quantities.hpp).
//
// A field is "NAME:TYPE" or "NAME:TYPE*SCALE". NAME is a quantity with its unit; TYPE is one of u8 i8 u16 i16 u32
// i32 u64 i64 f32 f64. The value of a field is SCALE times the number on the wire. "_:N" stands for N unused
// bytes. The fields follow one another without gaps:
//   "time_us:u32", "_:4", "latitude_deg:i32*1e-7", "p_rad_per_s:f32"
#pragma once

#include <boost/endian/conversion.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/remark_writer.hpp"
#include "protocols/quantities/truth_quantities.hpp"

namespace imud {

// The constructors may throw; read() and describe() allocate nothing. One thread.
class PackedLayout {
 public:
  static constexpr std::size_t largest_size = 65535;  // bytes

  // The first field begins at byte `begin` of a record. A field in the second constructor's list, from a source
  // file, may stand for several fields, as in names_in(). Throws std::invalid_argument, whose message names the
  // field, its fault and the remedy.
  PackedLayout(std::span<const std::string> fields, boost::endian::order order, std::size_t begin = 0);
  PackedLayout(std::span<const std::string_view> fields, boost::endian::order order, std::size_t begin = 0);

  // Returns the offset in bytes of the end of the last field.
  std::size_t size() const noexcept { return size_; }
  const QuantitySet& given() const noexcept { return given_; }
  // Returns the period, ns, after which the record's time since the start wraps, for a time that is given as an
  // integer of at most 32 bits.
  std::optional<std::int64_t> time_modulus() const noexcept { return time_modulus_; }

  // Reads a record of size() bytes or more. Returns ok, or not_finite or out_of_range of its first bad field.
  TruthResult read(std::span<const std::byte> record, TruthReading& out) noexcept;
  // Writes which field of the last record was refused by read(), if any.
  void describe(RemarkWriter& out) const noexcept;

 private:
  enum class Type : std::uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };
  struct Field {
    std::size_t offset = 0;
    Type type = Type::u8;
    double scale = 1;
    TruthField quantity;
  };
  struct Raw {
    std::uint64_t bits = 0;
    std::int64_t integer = 0;  // of integer types
    double number = 0;
  };
  void add(std::string_view text);
  Raw raw(const Field& field, std::span<const std::byte> record) const noexcept;

  bool is_big_;
  std::size_t size_;
  std::vector<Field> fields_;
  QuantitySet given_;
  std::optional<std::int64_t> time_modulus_;
  const Field* refused_ = nullptr;
  double refused_number_ = 0;
};

}  // namespace imud
