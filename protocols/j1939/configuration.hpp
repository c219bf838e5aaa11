// The settings that hosts write and read by ACEINNA's proprietary messages. The numbers of these messages are 0xFF00
// + a group extension; a host may change the extensions as well (banks). Layouts: github.com/Aceinna/openIMU335RI-lib
// 487c4fc, Lib/CAN_J1939, and openIMU300-lib dee364f.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/vector.hpp"
#include "protocols/j1939/measured.hpp"
#include "protocols/j1939/message.hpp"
#include "protocols/settings.hpp"

namespace imud::j1939 {

// The functions. Each has its own group extension.
enum Function : unsigned {
  reset_algorithm,
  save,
  hardware_status,
  software_status,
  master_status,
  packet_rate,
  packet_type,
  filter,
  orientation,
  user_behavior,
  algorithm,
  fine_rate,          // ARI-HR
  fine_acceleration,  // ACCS-HR
  functions,          // the number of functions; also stands for no function
};
inline constexpr std::array<std::uint8_t, functions> initial_extensions = {0x50, 0x51, 0x52, 0x53, 0x54, 0x55, 0x56,
                                                                           0x57, 0x58, 0x59, 0x5B, 0x6B, 0x6D};
inline constexpr std::uint8_t bank_0 = 0xF0, bank_1 = 0xF1;

// The bits of the user behavior that affect the device.
inline constexpr unsigned swap_slots = 0x0008;       // slots in J1939's order: pitch, roll; lateral, longitudinal
inline constexpr unsigned z_up = 0x0040;             // y and z of all vectors negated
inline constexpr unsigned raw_rates = 0x0080;        // ARI has rates without the corrections of a filter
inline constexpr unsigned swapped_request = 0x0200;  // a request's number has its high byte first

struct Model {
  std::string_view keyword, name;
  std::array<Packet, 6> packet_bits;          // of the mask of packet types, from bit 0; `packets`: none
  std::array<Function, 7> bank_0, bank_1;     // the functions whose extensions the banks change, from byte 1
  std::span<const std::uint8_t> unsupported;  // extensions of the product that are not emulated
  std::uint8_t last_extension;                // the extensions that banks may assign are 0x40 to this one
  bool rounds;                                // to nearest; false: down
  bool has_merits;                            // false: figures of merit are "not available", and ACCS has no latency
  bool pads;                                  // each frame has 8 bytes, padded with 0xAA
  Nanoseconds claim_period;                   // between repeated address claims; 0: claims are not repeated
  double gyro_max, gyro_noise;                // rad/s, rad/s/sqrt(Hz)
  double accelerometer_max, accelerometer_noise;  // m/s^2, m/s^2/sqrt(Hz)
};
extern const std::array<Model, 2> models;

// The settings that a host can change, and save.
struct Configuration {
  std::uint8_t address = 0x80;
  unsigned divider = 1;                                    // of 100 Hz; 0: no output
  unsigned packet_types = 7;                               // bits of Model::packet_bits
  std::uint8_t rate_filter_hz = 25, force_filter_hz = 25;  // cut-offs; 0: no filter
  unsigned orientation = 0;
  unsigned behavior = 0x0082;
  std::array<std::uint16_t, 3> algorithm = {2000, 2000, 10};  // kept and reported
  unsigned rate_priority = 3, force_priority = 2, angle_priority = 3;
  std::array<std::uint8_t, functions> extensions = initial_extensions;

  // Returns the function with that extension, or `functions`.
  Function function_of(unsigned extension) const noexcept;
  // Returns the header of a sensor message, without its source.
  Header header_of(Packet packet) const noexcept;
};

inline constexpr std::array<unsigned, 9> dividers = {0, 1, 2, 4, 5, 10, 20, 25, 50};

// Returns the rotation from the sensor's own axes to the axes of an orientation word, v_O = dcm_OP * v_P; nullopt if
// these would not be a right-handed triad. Bits: 0 sign of X (1: minus), 1-2 axis on X (x, y, z), 3 sign of Y, 4-5
// axis on Y (y, z, x), 6 sign of Z, 7-8 axis on Z (z, x, y).
std::optional<Matrix3> dcm_of_orientation(unsigned word) noexcept;

// Executes a message that sets a function. Byte 0 of the message must be the device's address. Returns false, and
// changes nothing, if the value is not possible.
bool set(Configuration& configuration, const Model& model, Function function, const Message& message) noexcept;
// Executes a message that sets a bank. Extensions out of range leave the present ones unchanged.
void set_bank(Configuration& configuration, const Model& model, unsigned bank, const Message& message) noexcept;

// The answer to a request for the settings of a function, of `size` bytes.
struct Report {
  std::uint64_t word = 0;
  std::size_t size = 0;
};
// Returns the report of a function; nullopt if the function has none. `host`: address of the requesting node.
std::optional<Report> report(const Configuration& configuration, Function function, std::uint8_t host) noexcept;

}  // namespace imud::j1939
