// VectorNav VN-100, VN-200, VN-300: the declarations shared by the device (device.cpp), its registers
// (registers.cpp), its text messages (messages.cpp), its binary fields (fields.cpp) and its decoder (decoder.cpp).
// Layouts and sizes are those of VectorNav's programming library (vnproglib 1.2, as in github.com/dawonn/vectornav
// 6824e8b) and of ArduPilot's driver (AP_ExternalAHRS_VectorNav.cpp).
//
// ASCII: '$', body, '*', checksum of the body, CR LF: two hexadecimal digits of its XOR, or four of its CRC-16
// (0x1021 from 0), or "XX" for none. The answer has the kind of checksum that the host used. Binary: 0xFA, groups, a
// mask of 16 bits for each group, little-endian; the fields in order of groups and bits; the CRC-16 of all after
// 0xFA, big-endian.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/sample.hpp"
#include "protocols/frame_writer.hpp"
#include "protocols/number_text.hpp"
#include "protocols/protocol.hpp"

namespace imud::vectornav {

// Codes of VNERR (VN-200 user manual UM004, page 23, table 20).
enum Error : unsigned {
  none = 0,
  input_overflow = 2,
  bad_checksum,
  bad_command,
  too_few,
  too_many,
  bad_parameter,
  bad_register,
  unauthorised,
  insufficient_baud = 12
};
inline constexpr std::size_t longest = 1024;  // bytes of the longest frame
inline constexpr std::array<std::uint32_t, 9> bauds = {9600,   19200,  38400,  57600, 115200,
                                                       128000, 230400, 460800, 921600};

// Groups of binary fields, each with a mask of its own.
enum Group : unsigned { common, time_group, imu, gnss1, attitude, ins, gnss2, groups };
inline constexpr unsigned mask_bits = 16;
// Returns the size of a field in bytes; 0: there is no such field.
std::size_t field_size(unsigned group, unsigned bit) noexcept;

unsigned xor_of(std::string_view text) noexcept;
unsigned crc16(std::span<const std::byte> bytes) noexcept;
unsigned crc16(std::string_view text) noexcept;
// Returns true if `sum`, the text after '*', is the checksum of `body`.
bool is_checksum_of(std::string_view body, std::string_view sum) noexcept;

// The words between commas. `count` is greater than words.size() if there are more words than that.
struct Words {
  explicit Words(std::string_view text) noexcept;
  std::string_view operator[](std::size_t i) const noexcept { return words[i]; }
  std::array<std::string_view, 20> words;
  std::size_t count = 0;
};
// Parses a number, on which a plus is allowed. Returns nullopt if the text is not a finite number.
std::optional<double> real_in(std::string_view text) noexcept;

// Writes a text message; send() adds the checksum and sends the message.
enum class Form : std::uint8_t { two_digits, four_digits };  // of the checksum: XOR, CRC-16
class Message {
 public:
  Message(FrameBuffer& out, Form form) noexcept : out_(out), form_(form) { text_[size_++] = '$'; }
  Message& put(std::string_view text) noexcept;
  Message& put(double number, const char* format) noexcept;  // both: a comma first, in printf()'s format
  Message& put(const Vector3& vector, const char* format) noexcept;
  void send() noexcept;

 private:
  FrameBuffer& out_;
  Form form_;
  std::array<char, 300> text_;
  std::size_t size_ = 0;
};

struct Model {
  std::string_view keyword, name;
  double internal_hz;
  unsigned receivers;  // GNSS
};
inline constexpr Model models[] = {
    {"vn-100", "VN-100S-CR", 800, 0}, {"vn-200", "VN-200S-CR", 800, 1}, {"vn-300", "VN-300S-CR", 400, 2}};

// --- Registers ---

struct BinaryOutput {
  unsigned mode = 0, divisor = 1;  // divisor 0: sent only when polled (VN-100 user manual UM001, page 56)
  std::array<std::uint16_t, groups> masks = {};

  bool is_streamed() const noexcept { return (mode & 1U) != 0 && divisor != 0; }  // to the host's port
  unsigned group_bits() const noexcept;
  std::size_t size() const noexcept;  // of the frame, in bytes; 0 if it has no fields
  // "3,16,01,0721": mode, divisor, groups and their masks in hexadecimal digits.
  static std::optional<BinaryOutput> parse(std::string_view text, Error& error) noexcept;
};

// A register that returns what was written to it.
struct Register {
  unsigned id;
  unsigned count;  // parameters
  std::string_view initial;
  unsigned receivers = 0;  // fewest GNSS receivers of a model with this register
  bool is_read_only = false;
};
inline constexpr std::size_t kept_count = 26;
extern const std::array<Register, kept_count> kept;

// Registers 23, 25 and 84: turns sensed values into compensated ones.
struct Calibration {
  Matrix3 gain = Matrix3::Identity();
  Vector3 bias = Vector3::Zero();
  Vector3 operator()(const Vector3& v) const noexcept { return gain * (v - bias); }
};

struct Configuration {
  static constexpr std::size_t register_size = 160;
  using Text = std::array<char, register_size>;
  struct SerialPort {
    unsigned baud = 115200, async_type = 14, async_hz = 40;
  };

  // The host's port, and the other one, whose settings can be written and read; nothing is sent there.
  std::array<SerialPort, 2> ports;
  std::array<BinaryOutput, 3> binary = {};
  std::array<Text, 3> binary_text = {};
  std::array<Text, kept_count> registers = {};
  std::array<Calibration, 3> calibrations;        // magnetometer, accelerometer, gyro: registers 23, 25, 84
  Matrix3 reference_frame = Matrix3::Identity();  // register 26

  Configuration() noexcept;
  static void store(Text& place, std::string_view text) noexcept;
  // Returns the parameters of a kept register; empty if there is no such register.
  std::string_view text_of(unsigned id) const noexcept;
  // Returns one parameter of a kept register, counted from 0; 0 if there is no such parameter.
  double number_of(unsigned id, std::size_t parameter) const noexcept;
};

// Writes a register of `configuration`. `rest` is the number of the register and its parameters ("06,14").
Error write_register(Configuration& configuration, const Model& model, std::string_view rest) noexcept;
// Returns the load of the host's serial line by all streams; the line cannot carry more than 1.
double line_load(const Configuration& configuration, const Model& model) noexcept;
// Appends the parameters of register `id`, which is not a measurement register. Only registers 5 to 7 use `port`: "1"
// and "2" are the serial ports, "0" and "?" the host's, and the answer ends with the number of the port. If `port` is
// empty, the answer is that of the host's port, without a number.
Error put_register(const Configuration& configuration, const Model& model, unsigned id, std::string_view port,
                   Message& message) noexcept;

// --- Measurements ---

// Increments since an output was last sent.
struct Sums {
  double dt = 0;  // s
  Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
  void add(const Sample& sample, double step_s) noexcept {
    dt += step_s;
    delta_angle += sample.delta_angle;
    delta_velocity += sample.delta_velocity;
  }
};

// The data that messages and fields report.
struct Reading {
  const Model& model;
  const Sample& sample;  // compensated, in the host's reference frame; zeros before the first one
  const Sample& raw;     // as sensed
  const Quaternion&
      tare;  // rotation from north-east-down to the frame set by VNTAR; applied to reported attitudes only
  Nanoseconds since_start;  // at the time of the message
  Nanoseconds age;          // of the sample, at the time of the message
};

// Returns the name of the message of that type; empty if the model has no such message.
std::string_view name_of(unsigned type, const Model& model) noexcept;
// Returns the size of the longest message of that type, in bytes: from '$' to LF, with a checksum of two digits and
// nothing appended.
std::size_t size_of(unsigned type) noexcept;
// Returns the type of the message with the content of measurement register `id`; 0: it is not a measurement register.
unsigned type_of_register(unsigned id) noexcept;
// Appends the content of a message. If the message has increments, `sums` restarts at 0.
void put_measurement(unsigned type, const Reading& reading, Sums& sums, Message& message) noexcept;
// Appends to a streamed message the status ("S"; mode 0: none, 1: VPE, 2: INS) and the count ("T"; mode 0: none) that
// register 30 configures (UM001, page 69).
void put_appended(double count_mode, double status_mode, const Reading& reading, Message& message) noexcept;
using BinaryFrame = FrameWriter<boost::endian::order::little>;
// Appends all fields of an output, with zeros for those that the emulated device does not have.
void put_fields(const BinaryOutput& output, const Reading& reading, const Sums& sums, BinaryFrame& frame) noexcept;

// Decodes binary frames, and the text messages that have rates, accelerations or increments.
std::unique_ptr<Decoder> make_decoder();

}  // namespace imud::vectornav
