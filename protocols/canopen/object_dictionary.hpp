// The object dictionary: the list of objects, and the values of the parameters among them.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <bitset>
#include <cstdint>
#include <initializer_list>
#include <span>

#include "protocols/canopen/canopen.hpp"

namespace imud::canopen {

// Abort codes of SDO (CiA 301, table 22).
enum class Abort : std::uint32_t {
  none = 0,
  toggle = 0x0503'0000,
  timeout = 0x0504'0000,
  command = 0x0504'0001,
  block_size = 0x0504'0002,
  sequence = 0x0504'0003,
  crc = 0x0504'0004,
  write_only = 0x0601'0001,
  read_only = 0x0601'0002,
  no_object = 0x0602'0000,
  not_mappable = 0x0604'0041,
  mapping_length = 0x0604'0042,
  incompatible = 0x0604'0043,
  length = 0x0607'0010,
  too_long = 0x0607'0012,
  too_short = 0x0607'0013,
  no_subindex = 0x0609'0011,
  value = 0x0609'0030,
  value_too_high = 0x0609'0031,
  not_stored = 0x0800'0020,
  state = 0x0800'0022,    // the present state of the device forbids it
  no_data = 0x0800'0024,  // there is no value at present
};

// Data types (CiA 301, table 44), with the values of their indexes.
enum class Type : std::uint8_t {
  i16 = 0x03,
  i32 = 0x04,
  u8 = 0x05,
  u16 = 0x06,
  u32 = 0x07,
  f32 = 0x08,
  text = 0x09,
  time_of_day = 0x0C,
  u64 = 0x1B
};
// Returns the size of a type in bytes; 0 for a type of variable size.
constexpr std::size_t size_of(Type type) noexcept {
  switch (type) {
    case Type::u8:
      return 1;
    case Type::i16:
    case Type::u16:
      return 2;
    case Type::i32:
    case Type::u32:
    case Type::f32:
      return 4;
    case Type::time_of_day:
      return 6;
    case Type::u64:
      return 8;
    case Type::text:
      break;
  }
  return 0;
}

enum class Access : std::uint8_t { constant, read_only, write_only, read_write };
// The origin of an object's value.
enum class Source : std::uint8_t {
  number,     // the initial value until a value is written
  computed,   // a measurement, state or text
  parameter,  // as `number`; 1010 stores the value
};

struct Object {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  Type type = Type::u8;
  Access access = Access::read_only;
  Source source = Source::number;
  std::uint64_t initial = 0;
  std::uint64_t largest = ~std::uint64_t{0};  // the largest value that can be written
  bool adds_node_id = false;                  // the node id is added to the initial value
  bool is_mappable = false;

  constexpr bool operator==(const Object&) const = default;
};

inline constexpr std::size_t tpdos = 4, largest_mapping = 8, errors_kept = 8, parameter_groups = 4;
inline constexpr std::size_t longest_text = 1024;  // bytes of an object of type text, and so of any object

// The objects of quantity q, a number from 0, are 21q0 to 21q3 (hexadecimal). The subindexes 1 to 3 of the first
// three objects are the axes.
//   21q0: i16, in LSBs of 21q3:1     21q2: f32, in SI
//   21q1: i32, in LSBs of 21q3:2     21q3: the LSBs in SI, f32
enum class Quantity : std::uint8_t { rate, specific_force, delta_angle, delta_velocity, magnetic_field };
inline constexpr unsigned quantities = 5;
inline constexpr std::uint16_t first_quantity = 0x2100;
// The LSBs as delivered: rad/s, m/s^2, rad, m/s, T.
inline constexpr std::array<float, quantities> lsb_16 = {0x1p-11F, 0x1p-8F, 0x1p-17F, 0x1p-13F, 1e-8F};
inline constexpr std::array<float, quantities> lsb_32 = {0x1p-24F, 0x1p-20F, 0x1p-30F, 0x1p-24F, 1e-12F};

// Axes of the inclinometer: 6010 and 6110 longitudinal, 6020 and 6120 lateral, with 16 and 32 bits.
inline constexpr std::array<std::uint16_t, 4> slopes = {0x6010, 0x6020, 0x6110, 0x6120};

// The device type of a two-axis inclinometer of up to 32 bits: profile 410, variant 4. Source: Baumer, GNAMG CANopen
// manual of 2012, p. 18, object 1000. A configurator (rumia) expects 0x2019A, two axes of 16 bits. CiA 410 itself was
// not at hand.
inline constexpr std::uint32_t inclinometer_32_bit = 0x4019A;

namespace detail {

struct ObjectList {
  std::array<Object, 320> all = {};
  std::size_t size = 0;
  constexpr void add(const Object& object) { all[size++] = object; }
};

constexpr ObjectList list_objects() {
  ObjectList list;
  using enum Type;
  using enum Access;
  using enum Source;
  const auto add = [&](const Object& object) { list.add(object); };
  const auto add_count = [&](unsigned index, unsigned count) {
    list.add({static_cast<std::uint16_t>(index), 0, u8, constant, number, count});
  };
  const auto add_measured = [&](unsigned index, unsigned sub, Type type) {
    list.add({static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), type, read_only, computed, 0, 0,
              false, true});
  };
  // The subindexes from 1 on have these types.
  const auto add_all_measured = [&](unsigned index, std::initializer_list<Type> types) {
    add_count(index, static_cast<unsigned>(types.size()));
    unsigned sub = 0;
    for (const Type type : types) add_measured(index, ++sub, type);
  };
  const auto add_parameter = [&](unsigned index, unsigned sub, Type type, std::uint64_t initial,
                                 std::uint64_t largest = ~std::uint64_t{0}) {
    list.add({static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), type, read_write, parameter, initial,
              largest});
  };

  // Communication (CiA 301, 7.5.2). The device type is the profile's number 410, and the variant in the high word.
  add({0x1000, 0, u32, read_only, number, inclinometer_32_bit});
  add_measured(0x1001, 0, u8);
  add_measured(0x1002, 0, u32);
  add({0x1003, 0, u8, read_write, computed, 0, 0});
  for (unsigned sub = 1; sub <= errors_kept; ++sub)
    add({0x1003, static_cast<std::uint8_t>(sub), u32, read_only, computed});
  add_parameter(0x1005, 0, u32, 0x80);
  add_parameter(0x1006, 0, u32, 0);
  add_parameter(0x1007, 0, u32, 0);
  for (unsigned index = 0x1008; index <= 0x100A; ++index)
    add({static_cast<std::uint16_t>(index), 0, text, constant, computed});
  add_parameter(0x100C, 0, u16, 0);
  add_parameter(0x100D, 0, u8, 0);
  for (const std::uint16_t index : std::array<std::uint16_t, 2>{0x1010, 0x1011}) {
    add_count(index, parameter_groups);
    for (unsigned sub = 1; sub <= parameter_groups; ++sub)
      add({index, static_cast<std::uint8_t>(sub), u32, read_write, computed, 1});
    if (index == 0x1011) add_parameter(0x1012, 0, u32, 0x8000'0100);
  }
  add({0x1014, 0, u32, read_write, parameter, emcy_id, ~std::uint64_t{0}, true});
  add_parameter(0x1015, 0, u16, 1000);  // 100 us each
  add_count(0x1016, consumers);
  for (unsigned sub = 1; sub <= consumers; ++sub) add_parameter(0x1016, sub, u32, 0);
  add_parameter(0x1017, 0, u16, 1000);
  add_count(0x1018, 4);
  for (std::uint8_t sub = 1; sub <= 4; ++sub) add({0x1018, sub, u32, read_only, number});
  add_parameter(0x1019, 0, u8, 0, 240);
  add_count(0x1029, 1);
  add_parameter(0x1029, 1, u8, 0, 2);
  add_count(0x1200, 2);
  add({0x1200, 1, u32, read_only, number, sdo_request_id, 0, true});
  add({0x1200, 2, u32, read_only, number, sdo_answer_id, 0, true});
  for (std::uint16_t i = 0; i < tpdos; ++i) {
    const auto index = static_cast<std::uint16_t>(0x1800 + i);
    add_count(index, 6);
    add({index, 1, u32, read_write, parameter, first_tpdo_id + 0x100U * i, ~std::uint64_t{0}, true});
    add_parameter(index, 2, u8, 254);
    add_parameter(index, 3, u16, 0);
    add_parameter(index, 5, u16, 0);
    add_parameter(index, 6, u8, 0, 240);
  }
  for (unsigned i = 0; i < tpdos; ++i) {
    add_parameter(0x1A00 + i, 0, u8, 0);
    for (unsigned sub = 1; sub <= largest_mapping; ++sub) add_parameter(0x1A00 + i, sub, u32, 0);
  }
  add_parameter(0x1F80, 0, u32, 4);

  // The unit.
  add({0x2000, 0, text, read_write, computed});  // a note of the user
  add({0x2001, 0, u8, write_only, number, 0, 1});
  add_count(0x2002, 2);  // settings by LSS: the node id from the next reset on, the index of the bit rate
  add({0x2002, 1, u8, read_only, computed});
  add({0x2002, 2, u8, read_only, computed});
  for (unsigned q = 0; q < quantities; ++q) {
    const unsigned base = first_quantity + 0x10 * q;
    unsigned format = 0;
    for (const Type type : {i16, i32, f32}) add_all_measured(base + format++, {type, type, type});
    add_count(base + 3, 2);
    add_parameter(base + 3, 1, f32, std::bit_cast<std::uint32_t>(lsb_16[q]));
    add({static_cast<std::uint16_t>(base + 3), 2, f32, read_only, number, std::bit_cast<std::uint32_t>(lsb_32[q])});
  }
  add_all_measured(0x2150, {u32, f32});  // pressure: 0.01 Pa, Pa
  add_all_measured(0x2160, {i16, f32});  // temperature: 0.01 degree Celsius, degrees Celsius
  // Time of the sample: 100 us, 1 us and 1 ns of the device's clock; time of day, by TIME.
  add_all_measured(0x2170, {u16, u32, u64, time_of_day});
  add_all_measured(0x2180, {u8, u16, u32, u64});  // counter of samples
  add_all_measured(0x2190, {u8, u16, u32});       // the low bits of the status, as in 1002

  // Inclinometer (CiA 410): resolution in 0.001 degree, and for each slope its value, operating parameter, preset,
  // offset, differential offset.
  add_parameter(0x6000, 0, u16, 10);
  for (const std::uint16_t slope : slopes) {
    const Type type = slope < 0x6100 ? i16 : i32;
    add_measured(slope, 0, type);
    add_parameter(slope + 1U, 0, u8, 0, 3);
    add_parameter(slope + 2U, 0, type, 0);
    add_parameter(slope + 3U, 0, type, 0);
    add_parameter(slope + 4U, 0, type, 0);
  }
  return list;
}

inline constexpr ObjectList list = list_objects();

}  // namespace detail

// All objects, in ascending order of index and subindex.
inline constexpr std::size_t object_count = detail::list.size;
inline constexpr std::span<const Object, object_count> objects(detail::list.all.data(), object_count);

// Returns the position of an object in `objects`; object_count if there is none.
constexpr std::size_t find_object(std::uint16_t index, std::uint8_t sub) noexcept {
  const auto at = std::partition_point(objects.begin(), objects.end(), [&](const Object& object) {
    return object.index < index || (object.index == index && object.sub < sub);
  });
  const bool is_found = at != objects.end() && at->index == index && at->sub == sub;
  return is_found ? static_cast<std::size_t>(at - objects.begin()) : object_count;
}
// Returns true if at least one object has this index.
constexpr bool has_object(std::uint16_t index) noexcept {
  const auto at = std::partition_point(objects.begin(), objects.end(),
                                       [&](const Object& object) { return object.index < index; });
  return at != objects.end() && at->index == index;
}
// Returns the position of an object that exists; otherwise the program does not compile.
consteval std::size_t at(std::uint16_t index, std::uint8_t sub = 0) {
  return find_object(index, sub) < object_count ? find_object(index, sub) : throw "no such object";
}

// The values of numbers and parameters: at present, as delivered, and in non-volatile memory.
class ObjectDictionary {
 public:
  // Sets the value as delivered, without an added node id. Call this before the first load().
  void set_delivered(std::size_t position, std::uint64_t value) noexcept { delivered_[position] = value; }

  std::uint64_t operator[](std::size_t position) const noexcept { return values_[position]; }
  std::uint32_t u32(std::size_t position) const noexcept { return static_cast<std::uint32_t>(values_[position]); }
  double real(std::size_t position) const noexcept {
    return static_cast<double>(std::bit_cast<float>(u32(position)));
  }
  void set(std::size_t position, std::uint64_t value) noexcept { values_[position] = value; }

  // Loads the objects with indexes in [first, last] as after power on: the stored value or, if there is none, the
  // value as delivered. Sets the node id of the device.
  void load(std::uint16_t first, std::uint16_t last, unsigned node_id) noexcept;
  // store() stores the parameters in [first, last]; forget() forgets their stored values. A parameter with its value
  // as delivered is not stored, so that its identifier follows a new node id.
  void store(std::uint16_t first, std::uint16_t last) noexcept;
  void forget(std::uint16_t first, std::uint16_t last) noexcept;

 private:
  std::uint64_t initial(std::size_t position) const noexcept {
    return delivered_[position] + (objects[position].adds_node_id ? node_id_ : 0U);
  }
  static std::array<std::uint64_t, object_count> listed() noexcept;

  std::array<std::uint64_t, object_count> delivered_ = listed(), values_ = delivered_, stored_ = {};
  std::bitset<object_count> is_stored_;
  unsigned node_id_ = 0;
};

}  // namespace imud::canopen
