// A packed record that the user describes, as Simulink's UDP Send with Byte Packing, LabVIEW's Flatten To String, or
// a C program's packed struct send it: a magic, fields (protocols/quantities/packed_layout.hpp), further bytes, a
// checksum.
//
// A datagram is one record. In a stream, records are found by the magic and the checksum. If there is neither, the
// records follow one another from the first byte of the stream on.
#include <algorithm>
#include <boost/crc.hpp>
#include <stdexcept>
#include <vector>

#include "core/numbers/number_text.hpp"
#include "protocols/quantities/packed_truth.hpp"
#include "protocols/wire/crc32c.hpp"
#include "protocols/wire/record_search.hpp"

namespace imud {
namespace {

enum class Checksum : std::uint8_t { none, sum8, xor8, crc16_ccitt, crc16_modbus, crc32, crc32c };
constexpr std::string_view checksum_choices[] = {"none",         "sum8",  "xor8",  "crc16-ccitt",
                                                 "crc16-modbus", "crc32", "crc32c"};
constexpr std::string_view byte_order_choices[] = {"little", "big"};
constexpr std::string_view initial_fields[] = {
    "time_s:f64",
    "q_NB_w:f64",
    "q_NB_x:f64",
    "q_NB_y:f64",
    "q_NB_z:f64",
    "p_rad_per_s:f64",
    "q_rad_per_s:f64",
    "r_rad_per_s:f64",
    "specific_force_x_m_per_s2:f64",
    "specific_force_y_m_per_s2:f64",
    "specific_force_z_m_per_s2:f64",
};
constexpr Setting settings[] = {
    list_setting(
        "fields",
        "fields in their order: NAME:TYPE or NAME:TYPE*SCALE, padding _:BYTES; types u8 i8 u16 i16 u32 i32 u64 "
        "i64 f32 f64; names: `imud list csv`",
        initial_fields),
    text_setting("byte_order", "byte order of fields and checksum", "little", byte_order_choices),
    text_setting("magic", "first bytes of every record, before the fields, in hexadecimal: \"1acffc1d\"", ""),
    integer_setting("length", "bytes of a whole record, 0: magic, fields and checksum; what is more is not used", 0,
                    0, static_cast<double>(PackedLayout::largest_size)),
    text_setting(
        "checksum",
        "checksum of all bytes before it, at the record's end: the low byte of their sum, their exclusive or, "
        "CRC-16/IBM-3740 (CCITT, initially ffff), CRC-16/MODBUS, CRC-32 (Ethernet) or CRC-32C",
        "none", checksum_choices),
    time_setting,
    level_setting,
    body_setting,
    accumulated_dv_setting,
};

constexpr std::size_t size_of(Checksum checksum) noexcept {
  constexpr std::size_t sizes[] = {0, 1, 1, 2, 2, 4, 4};
  return sizes[static_cast<std::size_t>(checksum)];
}

std::uint32_t value_of(Checksum checksum, std::span<const std::byte> bytes) noexcept {
  std::uint32_t sum = 0;
  const auto crc = [bytes](auto algorithm) {
    algorithm.process_bytes(bytes.data(), bytes.size());
    return static_cast<std::uint32_t>(algorithm.checksum());
  };
  switch (checksum) {
    case Checksum::none:
      return 0;
    case Checksum::sum8:
      for (const std::byte byte : bytes) sum += std::to_integer<std::uint32_t>(byte);
      return sum & 0xFFU;
    case Checksum::xor8:
      for (const std::byte byte : bytes) sum ^= std::to_integer<std::uint32_t>(byte);
      return sum;
    case Checksum::crc16_ccitt:
      return crc(boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false>());
    case Checksum::crc16_modbus:
      return crc(boost::crc_optimal<16, 0x8005, 0xFFFF, 0, true, true>());
    case Checksum::crc32:
      return crc(boost::crc_32_type());
    case Checksum::crc32c:
      return crc32c(bytes);
  }
  return 0;
}

std::vector<std::byte> parse_magic(const std::string& text) {
  constexpr std::size_t longest = 32;
  std::vector<std::byte> magic;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const auto byte = number_in<std::uint8_t>(std::string_view(text).substr(i, 2), 16);
    if (text.size() % 2 != 0 || text.size() > 2 * longest || !byte)
      throw std::invalid_argument(
          "magic: must be at most 32 bytes of two hexadecimal digits each, as in \"1acffc1d\"");
    magic.push_back(static_cast<std::byte>(*byte));
  }
  return magic;
}

class StructTruthDecoder final : public TruthDecoder {
 public:
  explicit StructTruthDecoder(const Settings& chosen)
      : is_big_(chosen.text("byte_order") == byte_order_choices[1]),
        checksum_(static_cast<Checksum>(std::ranges::find(checksum_choices, chosen.text("checksum")) -
                                        std::begin(checksum_choices))),
        magic_(parse_magic(chosen.text("magic"))),
        truth_(make_truth(chosen, magic_.size())),
        length_(length(chosen)),
        search_(length_) {}

  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime arrival) noexcept override {
    arrival_ = arrival;
    is_datagram_ = input == TruthInput::datagram;
    record_ = bytes;
    if (!is_datagram_) search_.feed(bytes);
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    if (is_datagram_) {
      is_datagram_ = false;
      TruthResult result = check(record_);
      if (record_.size() < length_) result = TruthResult::too_short;
      return result == TruthResult::ok ? truth_.convert(record_, arrival_, truth) : result;
    }
    const auto found = search_.next([this](std::span<const std::byte> held) {
      verdict_ = check(held.first(std::min(held.size(), length_)));
      return verdict_ == TruthResult::ok          ? length_
             : verdict_ == TruthResult::too_short ? RecordSearch::need_more
                                                  : RecordSearch::reject;
    });
    if (!found) return std::nullopt;
    record_ = *found;
    return found->empty() ? verdict_ : truth_.convert(*found, arrival_, truth);
  }
  void finish() noexcept override {
    if (const std::size_t size = search_.finish(); size > 0) {
      ++losses_.cut_short;
      losses_.cut_short_by = size;
    }
  }
  TruthFrame frame() const noexcept override { return truth_.frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    RemarkWriter out(room);
    const std::string_view text{reinterpret_cast<const char*>(record_.data()), record_.size()};
    switch (result) {
      case TruthResult::too_short:
      case TruthResult::too_long:
        (out << "a datagram has " << record_.size() << " bytes, and these settings describe " << length_ << ": ")
            .quote(text, 24);
        break;
      case TruthResult::not_this_kind:
        out << "no record begins with the bytes of magic here";
        break;
      case TruthResult::bad_checksum:
        out << "the " << checksum_choices[static_cast<std::size_t>(checksum_)] << " of a record is wrong";
        break;
      case TruthResult::not_finite:
      case TruthResult::out_of_range:
        truth_.describe(out);
        break;
      default:
        break;
    }
    return out.size();
  }

 private:
  static PackedTruth make_truth(const Settings& chosen, std::size_t begin) {
    try {
      const bool is_big = chosen.text("byte_order") == byte_order_choices[1];
      return {PackedLayout(std::span<const std::string>(chosen.list("fields")),
                           is_big ? boost::endian::order::big : boost::endian::order::little, begin),
              TruthAssembly::axes(chosen), chosen.text("time") == time_choices[0]};
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string("fields: ") + error.what());
    }
  }
  std::size_t length(const Settings& chosen) const {
    const std::size_t least = truth_.layout().size() + size_of(checksum_);
    const auto given = static_cast<std::size_t>(chosen.integer("length"));
    if (given == 0) return least;
    if (given < least)
      throw std::invalid_argument("length: magic, fields and checksum have " + std::to_string(least) +
                                  " bytes; give that or more, or 0");
    return given;
  }
  // Checks a record. In a stream, `record` has at most length_ bytes.
  TruthResult check(std::span<const std::byte> record) const noexcept {
    const std::size_t head = std::min(magic_.size(), record.size());
    const bool has_magic = std::ranges::equal(record.first(head), std::span(magic_).first(head));
    if (record.size() < length_) return has_magic ? TruthResult::too_short : TruthResult::not_this_kind;
    if (record.size() > length_) return TruthResult::too_long;
    if (!has_magic) return TruthResult::not_this_kind;
    const std::size_t at = length_ - size_of(checksum_);
    std::uint32_t sent = 0;
    for (std::size_t i = 0; i < size_of(checksum_); ++i)
      sent = sent << 8 | std::to_integer<std::uint32_t>(record[is_big_ ? at + i : length_ - 1 - i]);
    return sent == value_of(checksum_, record.first(at)) ? TruthResult::ok : TruthResult::bad_checksum;
  }

  bool is_big_;
  Checksum checksum_;
  std::vector<std::byte> magic_;
  PackedTruth truth_;
  std::size_t length_;
  RecordSearch search_;
  bool is_datagram_ = false;
  HostTime arrival_;
  std::span<const std::byte> record_;
  TruthResult verdict_ = TruthResult::ok;
};

}  // namespace

extern constexpr TruthFormat struct_truth_format = {
    .name = "struct",
    .summary = "packed records that the settings describe: Simulink, LabVIEW, a C struct",
    .document = "protocols/quantities/packed_layout.hpp",
    .delimits_itself = true,
    .settings = settings,
    .make = make_as<TruthDecoder, StructTruthDecoder>,
    .force_from =
        "fields of a specific force (specific_force_x_m_per_s2 to _z), an acceleration or an accumulated "
        "velocity",
    .derives = true,
};

}  // namespace imud
