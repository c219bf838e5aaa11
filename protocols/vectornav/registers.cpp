#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/attitude.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {

unsigned BinaryOutput::group_bits() const noexcept {
  unsigned bits = 0;
  for (unsigned g = 0; g < groups; ++g) bits |= masks[g] != 0 ? 1U << g : 0U;
  return bits;
}

std::size_t BinaryOutput::size() const noexcept {
  if (group_bits() == 0) return 0;
  std::size_t size = 2 + 2;  // 0xFA, groups; checksum
  for (unsigned g = 0; g < groups; ++g) {
    if (masks[g] != 0) size += 2;
    for (unsigned bit = 0; bit < mask_bits; ++bit)
      if ((masks[g] >> bit & 1U) != 0) size += field_size(g, bit);
  }
  return size;
}

std::optional<BinaryOutput> BinaryOutput::parse(std::string_view text, Error& error) noexcept {
  const Words words(text);
  error = too_few;
  if (words.count < 3) return std::nullopt;
  BinaryOutput output;
  const auto mode = number_in<unsigned>(words[0]), divisor = number_in<unsigned>(words[1]);
  const auto bits = number_in<unsigned>(words[2], 16);
  error = bad_parameter;
  if (!mode || *mode > 3 || !divisor || *divisor > 0xFFFF || !bits || *bits > 0x7F) return std::nullopt;
  const auto wanted = 3 + static_cast<std::size_t>(std::popcount(*bits));
  error = words.count < wanted ? too_few : too_many;
  if (words.count != wanted) return std::nullopt;
  error = bad_parameter;
  output.mode = *mode;
  output.divisor = *divisor;
  std::size_t at = 3;
  for (unsigned g = 0; g < groups; ++g) {
    if ((*bits >> g & 1U) == 0) continue;
    const auto mask = number_in<std::uint16_t>(words[at++], 16);
    if (!mask) return std::nullopt;
    for (unsigned bit = 0; bit < mask_bits; ++bit)
      if ((*mask >> bit & 1U) != 0 && field_size(g, bit) == 0) return std::nullopt;
    output.masks[g] = *mask;
  }
  if (output.size() > longest) return std::nullopt;
  error = none;
  return output;
}

namespace {
constexpr std::string_view no_calibration =
    "+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+"
    "00.00000";
}

const std::array<Register, kept_count> kept = {{
    {0, 1, ""},
    {21, 6, "+1.00000,+0.00000,+1.80000,+00.0000,+00.0000,-09.7937"},
    {23, 12, no_calibration},
    {25, 12, no_calibration},
    {26, 9, "+1.00000,+0.00000,+0.00000,+0.00000,+1.00000,+0.00000,+0.00000,+0.00000,+1.00000"},
    {30, 7, "0,0,0,0,1,0,1"},
    {32, 9, "3,0,0,0,6,1,0,100000000,0"},
    {33, 3, "0,0,0"},
    {35, 4, "1,1,1,1"},
    {36, 9, "+04.00,+04.00,+04.00,+05.00,+05.00,+05.00,+05.50,+05.50,+05.50"},
    {38, 9, "+05.00,+05.00,+05.00,+03.00,+03.00,+03.00,+04.00,+04.00,+04.00"},
    {43, 3, "+00.000000,+00.000000,+00.000000"},
    {44, 3, "1,3,5"},
    {47, 12, no_calibration, {}, true},
    {50, 3, "+000.000,+000.000,+000.000"},
    {51, 3, "1,+0.10,+0.01"},
    {55, 5, "0,0,5,0,0", {1}},
    {57, 3, "+00.000,+00.000,+00.000", {1}},
    {67, 4, "0,1,1,0", {1}},
    {74, 7, "+00.000000,+00.000000,+00.000000,+00.000000,+00.000000,+00.000000,+00.000000", {1}},
    {82, 5, "0,0,0,0,0"},
    {83, 9, "0,0,0,0,1000,+0000.000,+00.00000000,+000.00000000,+00000.000"},
    {84, 12, no_calibration},
    {85, 10, "0,4,4,0,0,0,3,3,0,0"},
    {93, 6, "+01.000,+00.000,+00.000,+00.025,+00.025,+00.025", {2}},
    {97, 9, "0,0,0,+00.000,+00.000,+00.000,+00.000,+00.000,+00.000", {2}, true},
    // Firmware 3: the parameters of the SDK 0.99 (Interface/Registers.cpp); the initial values are assumed.
    {99, 8, "0001,0,0,0,00,0000,0000,0000", {1, firmware_3}, false, 0xF1},
    {100, 7, "0,0,0,0,0,0,0", {1, firmware_3}},
    {101, 5, "0,0,0,0,0", {1, firmware_3}, false, 0x10},
    {102, 5, "0,0,0,0,0", {1, firmware_3}, false, 0x10},
    {105, 6, "+00.000,+00.000,+00.000,+00.000,+00.000,+00.000", {1, firmware_3}},
    {116, 7, "+00.000,+00.000,+00.000,+00.000,+00.000,+00.000,+00.000", {0, firmware_3}},
    {144, 6, "1,0,0,0,0,0", {1, firmware_3}},
    {157, 3, "+00.000,+00.000,+00.000", {1, firmware_3}},
    {206, 4, "0,0,0,0", {0, firmware_3}},
}};

Configuration::Configuration() noexcept {
  for (std::size_t i = 0; i < kept.size(); ++i) store(registers[i], kept[i].initial);
  for (Text& text : binary_text) store(text, "0,0,00");
}

void Configuration::store(Text& place, std::string_view text) noexcept {
  place = {};
  std::memcpy(place.data(), text.data(), std::min(text.size(), register_size - 1));
}

std::string_view Configuration::text_of(unsigned id) const noexcept {
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i].id == id) return registers[i].data();
  return "";
}

double Configuration::number_of(unsigned id, std::size_t parameter) const noexcept {
  const Words words(text_of(id));
  return parameter < words.count ? real_in(words[parameter]).value_or(0) : 0;
}

namespace {

unsigned& number_of(Configuration::SerialPort& port, unsigned id) noexcept {
  return id == 5 ? port.baud : id == 6 ? port.async_type : port.async_hz;
}

Error write_number(Configuration& c, const Model& model, unsigned asking, unsigned id, const Words& words) noexcept {
  if (words.count > 2) return too_many;
  const auto number = number_in<unsigned>(words[0]);
  const auto uart = uart_in(words.count == 2 ? words[1] : "?", asking);
  if (!number || !uart) return bad_parameter;
  // 0 is off (github.com/winksaville/rw-vn100 4c70450, README.md, with firmware 3.1.0.0).
  constexpr std::array<unsigned, 12> rates = {0, 1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200};
  if (id == 5 && std::find(bauds.begin(), bauds.end(), *number) == bauds.end()) return bad_parameter;
  if (id == 6 && *number != 0 && name_of(*number, model).empty()) return bad_parameter;
  if (id == 7 && std::find(rates.begin(), rates.end(), *number) == rates.end()) return bad_parameter;
  number_of(c.ports[*uart], id) = *number;
  return none;
}

Error write_binary(Configuration& c, std::size_t which, std::string_view value) noexcept {
  Error error{};
  const auto output = BinaryOutput::parse(value, error);
  if (!output) return error;
  c.binary[which] = *output;
  Configuration::store(c.binary_text[which], value);
  return none;
}

constexpr std::array<unsigned, 3> calibrations = {23, 25, 84};

// Returns nullopt if a parameter of register 32 is out of range.
std::optional<SyncControl> sync_control_in(const Words& words) noexcept {
  std::array<std::uint32_t, 9> numbers;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const auto number = number_in<std::uint32_t>(words[k]);
    if (!number) return std::nullopt;
    numbers[k] = *number;
  }
  const auto [in, in_edge, in_skip, in_reserved, out, out_polarity, out_skip, width, out_reserved] = numbers;
  constexpr std::uint32_t most_skipped = 0xFFFF;
  if (!SyncControl::is_in_mode(in) || in_edge > 1 || in_skip > most_skipped || !SyncControl::is_out_mode(out) ||
      out_polarity > 1 || out_skip > most_skipped)
    return std::nullopt;
  return SyncControl{static_cast<SyncControl::In>(in), static_cast<SyncControl::Out>(out), in_skip, out_skip,
                     Nanoseconds(width)};
}

// Reads register 55: the receiver's mode (1 and 2: an external receiver), and the source of the pulse of an external
// receiver.
PulseSource pulse_source_in(const Words& words) noexcept {
  const unsigned mode = number_in<unsigned>(words[0]).value_or(0), source = number_in<unsigned>(words[1]).value_or(0);
  if (mode != 1 && mode != 2) return PulseSource::receiver;
  return source < 2 ? PulseSource::pps_pin : source < 4 ? PulseSource::sync_in : PulseSource::none;
}

bool is_in_range(const Register& kept_one, const Words& words) noexcept {
  const unsigned id = kept_one.id;
  constexpr std::array<double, 7> most_of_30 = {5, 6, 5, 6, 3, 3, 2};  // SDK 0.99, ProtocolControl
  constexpr std::array<double, 4> most_of_35 = {1, 2, 1, 1};           // its VpeBasicControl
  constexpr double largest = 1000;                                     // limit of gains and biases
  constexpr std::size_t longest_tag = 20;
  if (id == 0) return words[0].size() <= longest_tag;
  const bool is_matrix = id == 26 || std::find(calibrations.begin(), calibrations.end(), id) != calibrations.end();
  for (std::size_t k = 0; k < words.count; ++k) {
    if ((kept_one.hexadecimal >> k & 1U) != 0) {
      if (!number_in<std::uint32_t>(words[k], 16)) return false;
      continue;
    }
    const auto number = real_in(words[k]);
    if (!number) return false;
    if (id == 30 && (*number < 0 || *number > most_of_30[k])) return false;
    if (id == 35 && (*number < 0 || *number > most_of_35[k])) return false;
    if (is_matrix && std::abs(*number) > largest) return false;
  }
  return true;
}

Vector3 vector_in(const Words& words, std::size_t first) noexcept {
  const auto number = [&](std::size_t k) { return real_in(words[first + k]).value_or(0); };
  return {number(0), number(1), number(2)};
}
Matrix3 matrix_in(const Words& words) noexcept {
  Matrix3 m;
  for (int row = 0; row < 3; ++row) m.row(row) = vector_in(words, 3 * static_cast<std::size_t>(row)).transpose();
  return m;
}

}  // namespace

std::optional<unsigned> uart_in(std::string_view text, unsigned asking) noexcept {
  if (text == "0" || text == "?") return asking;
  return text == "1" ? std::optional(0U) : text == "2" ? std::optional(1U) : std::nullopt;
}

Error write_register(Configuration& c, const Model& model, unsigned asking, std::string_view rest) noexcept {
  const std::size_t comma = rest.find(',');
  const auto id = number_in<unsigned>(rest.substr(0, comma));
  if (!id) return bad_parameter;
  constexpr unsigned sync_status = 33;  // measured, but can be written
  if (const unsigned type = type_of_register(*id); type != 0 && !is_measured(type, model)) return bad_register;
  if ((*id >= 1 && *id <= 4) || (type_of_register(*id) != 0 && *id != sync_status)) return unauthorised;
  const bool has_value = comma != std::string_view::npos;
  const std::string_view value = has_value ? rest.substr(comma + 1) : std::string_view();
  const Words words(value);
  if ((*id >= 5 && *id <= 7) || (*id >= 75 && *id <= 77)) {
    if (!has_value) return too_few;
    return *id <= 7 ? write_number(c, model, asking, *id, words) : write_binary(c, *id - 75, value);
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (kept[i].id != *id || !kept[i].since.includes(model)) continue;
    if (kept[i].is_read_only) return unauthorised;
    if (!has_value || words.count < kept[i].count) return too_few;
    if (words.count > kept[i].count) return too_many;
    if (value.size() >= Configuration::register_size || !is_in_range(kept[i], words)) return bad_parameter;
    if (*id == sync_status) return none;
    if (*id == 32) {
      const auto sync = sync_control_in(words);
      if (!sync) return bad_parameter;
      c.sync = *sync;
    }
    if (*id == 55) c.pulse_source = pulse_source_in(words);
    if (*id == 26) {
      constexpr double tolerance = 1e-3;
      const Matrix3 frame = matrix_in(words);
      if (!(rotation_defect(frame) < tolerance)) return bad_parameter;
      c.reference_frame = frame;
    }
    for (std::size_t k = 0; k < calibrations.size(); ++k)
      if (calibrations[k] == *id) c.calibrations[k] = {matrix_in(words), vector_in(words, 9)};
    Configuration::store(c.registers[i], value);
    return none;
  }
  return bad_register;
}

double line_load(const Configuration& c, const Model& model, unsigned uart) noexcept {
  const Configuration::SerialPort& port = c.ports[uart];
  double bytes_per_s = 0;
  if (port.async_type != 0) {
    const std::size_t appended = (c.number_of(30, 0) != 0 ? std::string_view(",T4294967295").size() : 0U) +
                                 (c.number_of(30, 1) != 0 ? std::string_view(",S0000").size() : 0U);
    const std::size_t more_digits = c.number_of(30, 4) >= 2 ? 2 : 0;
    bytes_per_s += static_cast<double>((size_of(port.async_type) + appended + more_digits) * port.async_hz);
  }
  for (const BinaryOutput& output : c.binary)
    if (output.goes_to(uart) && output.divisor != 0)
      bytes_per_s += static_cast<double>(output.size()) * model.internal_hz / output.divisor;
  constexpr double bits_per_byte = 10;
  return bits_per_byte * bytes_per_s / port.baud;
}

Error put_register(const Configuration& c, const Model& model, unsigned id, unsigned asking, std::string_view uart,
                   Message& message) noexcept {
  const auto text = [&](std::string_view value) { message.put(",").put(value); };
  switch (id) {
    case 1:
      text(model.name);
      return none;
    case 2:
      text("7");
      return none;
    case 3:
      text("0100012345");
      return none;
    case 4:
      text(model.firmware.data());
      return none;
    case 5:
    case 6:
    case 7: {
      const auto which = uart_in(uart.empty() ? "?" : uart, asking);
      if (!which) return bad_parameter;
      Configuration::SerialPort settings = c.ports[*which];
      message.put(number_of(settings, id), {});
      if (!uart.empty()) text(*which == 0 ? "1" : "2");
      return none;
    }
    case 75:
    case 76:
    case 77:
      text(c.binary_text[id - 75].data());
      return none;
    default:
      break;
  }
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i].id == id && kept[i].since.includes(model)) {
      text(c.registers[i].data());
      return none;
    }
  return bad_register;
}

}  // namespace imud::vectornav
