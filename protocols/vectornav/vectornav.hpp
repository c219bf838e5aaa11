// VectorNav VN-100, VN-200, VN-300: the declarations shared by the device (device.cpp), its settings (settings.cpp),
// registers (registers.cpp), text (text.cpp), text messages (messages.cpp), binary fields (fields.cpp), pins
// (sync_pins.cpp) and decoder (decoder.cpp).
// Layouts and sizes are from VectorNav's programming library (vnproglib 1.2, as in github.com/dawonn/vectornav
// 6824e8b) and ArduPilot's driver (AP_ExternalAHRS_VectorNav.cpp).
//
// ASCII: '$', body, '*', checksum of the body, CR LF: two hexadecimal digits of its XOR, or four of its CRC-16
// (0x1021 from 0), or "XX" for none. The answer has the kind of checksum that the host used. Binary: 0xFA, groups, a
// mask of 16 bits for each group, little-endian; the fields in order of groups and bits; the CRC-16 of all after
// 0xFA, big-endian.
//
// A product has two UARTs, 1 and 2, each with its own registers 5 to 7. This program counts the UARTs from 0.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/numbers/lanes.hpp"
#include "core/numbers/number_text.hpp"
#include "core/numbers/plus_zero.hpp"
#include "core/sample.hpp"
#include "protocols/protocol.hpp"
#include "protocols/vectornav/sync_pins.hpp"
#include "protocols/wire/frame_writer.hpp"

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

// Groups of binary fields. Each group has its own mask.
enum Group : unsigned { common, time_group, imu, gnss1, attitude, ins, gnss2, groups };
inline constexpr unsigned mask_bits = 16;
// Returns the size of a field in bytes; 0: there is no such field.
std::size_t field_size(unsigned group, unsigned bit) noexcept;

unsigned xor_of(std::string_view text) noexcept;
unsigned crc16(std::span<const std::byte> bytes) noexcept;
unsigned crc16(std::string_view text) noexcept;
// Returns true if `sum`, the text after '*', is the checksum of `body`.
bool is_checksum_of(std::string_view body, std::string_view sum) noexcept;

// Writes the end of a text message after its body: "*", the checksum, CR LF, and a NUL. Requires room for 16
// characters at `place`. Returns the number of characters before the NUL.
enum class Form : std::uint8_t { two_digits, four_digits };  // of the checksum: XOR, CRC-16
std::size_t write_checksum(std::string_view body, Form form, char* place) noexcept;

// The head of a binary frame: the offset of its fields, and the size of the whole frame. While the head is
// incomplete, `size` is the size of the head.
struct BinaryHead {
  std::array<unsigned, groups> masks = {};
  std::size_t fields = 0, size = 0;
};
// Reads the head at the begin of `held`, which may be a part of a frame. Returns nullopt if no frame begins so.
std::optional<BinaryHead> binary_head(std::span<const std::byte> held) noexcept;
// FrameSeal::reseal().
std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader&) noexcept;

// The words of a text between commas. `count` is their number, which may be greater than words.size(): further words
// are not kept.
struct Words {
  explicit Words(std::string_view text) noexcept;
  std::string_view operator[](std::size_t i) const noexcept { return words[i]; }
  std::array<std::string_view, 20> words;
  std::size_t count = 0;
};
// Parses a number, which may begin with a plus sign. Returns nullopt if the text is not a finite number.
std::optional<double> real_in(std::string_view text) noexcept;

// The form of a number in a text message: {3, 8, true} is printf()'s "%+08.3f".
struct Digits {
  int decimals = 0;
  std::size_t width = 0;  // of the text with its sign, at least, with zeros before the digits
  bool has_plus = false;  // before a number without a minus
};

// Writes a text message; send() adds the checksum and sends the message.
class Message {
 public:
  // `uart`: Frame::uart.
  Message(FrameBuffer& out, Form form, std::uint8_t uart) noexcept : out_(out), form_(form), uart_(uart) {
    text_[size_++] = '$';
  }
  Message& put(std::string_view text) noexcept;
  Message& put(double number, const Digits& digits) noexcept;  // both: a comma first
  Message& put(const Vector3& vector, const Digits& digits) noexcept;
  void send() noexcept;

 private:
  FrameBuffer& out_;
  Form form_;
  std::uint8_t uart_;
  std::array<char, 300> text_;
  std::size_t size_ = 0;
};

struct Model {
  std::string_view keyword, name;
  double internal_hz;
  unsigned receivers;  // GNSS
  std::array<char, 20> firmware = {"2.1.0.0"};
  unsigned major = 2;  // the first number of the firmware's version
};
inline constexpr Model models[] = {
    {"vn-100", "VN-100S-CR", 800, 0}, {"vn-200", "VN-200S-CR", 800, 1}, {"vn-300", "VN-300S-CR", 400, 2}};

// The condition for the models that have a register or a message.
struct Since {
  unsigned receivers = 0;  // at least so many GNSS receivers
  unsigned major = 0;      // at least this firmware
  bool includes(const Model& model) const noexcept { return receivers <= model.receivers && major <= model.major; }
};
inline constexpr unsigned firmware_3 = 3;

struct BinaryOutput {
  unsigned mode = 0;     // a bit for each UART
  unsigned divisor = 1;  // 0: sent only when polled (UM001, page 56), or at an event of SyncIn
  std::array<std::uint16_t, groups> masks = {};

  bool goes_to(unsigned uart) const noexcept { return (mode >> uart & 1U) != 0; }
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
  Since since = {};
  bool is_read_only = false;
  unsigned hexadecimal = 0;  // a bit for each parameter that is a hexadecimal number
};
inline constexpr std::size_t kept_count = 35;
extern const std::array<Register, kept_count> kept;

// A matrix that is the identity in most units. The product is left out there if it cannot change a bit.
class Gain {
 public:
  Gain() = default;
  Gain(const Matrix3& matrix) noexcept : matrix_(matrix), is_identity_(matrix == Matrix3::Identity()) {}
  const Matrix3& matrix() const noexcept { return matrix_; }
  Vector3 operator*(const Vector3& v) const noexcept {
    // The product adds zeros, which may change the sign of a zero, or make infinity NaN, but change no other number.
    const double product = v.x() * v.y() * v.z();
    const bool is_ordinary = product != 0 && product - product == 0;
    if (is_identity_ && (is_ordinary || is_plus_zero(v))) [[likely]]
      return v;
    return times_matrix(v);
  }

 private:
  // Out of line, so that the shortcuts are inline.
  [[gnu::noinline]] Vector3 times_matrix(const Vector3& v) const noexcept { return matrix_ * v; }

  Matrix3 matrix_ = Matrix3::Identity();
  bool is_identity_ = true;
};

// Registers 23, 25 and 84: turns sensed values into compensated ones.
struct Calibration {
  Gain gain;
  Vector3 bias = Vector3::Zero();
  Vector3 operator()(const Vector3& v) const noexcept { return gain * (v - bias); }
};

struct Configuration {
  static constexpr std::size_t register_size = 160;
  using Text = std::array<char, register_size>;
  struct SerialPort {
    unsigned baud = 115200, async_type = 14, async_hz = 40;
  };

  std::array<SerialPort, 2> ports;  // UART 1 and 2
  std::array<BinaryOutput, 3> binary = {};
  std::array<Text, 3> binary_text = {};
  std::array<Text, kept_count> registers = {};
  std::array<Calibration, 3> calibrations;           // magnetometer, accelerometer, gyro: registers 23, 25, 84
  Matrix3 reference_frame = Matrix3::Identity();     // register 26
  SyncControl sync;                                  // register 32
  PulseSource pulse_source = PulseSource::receiver;  // register 55

  Configuration() noexcept;
  static void store(Text& place, std::string_view text) noexcept;
  // Returns the parameters of a kept register; empty if there is no such register.
  std::string_view text_of(unsigned id) const noexcept;
  // Returns one parameter of a kept register, counted from 0; 0 if there is no such parameter.
  double number_of(unsigned id, std::size_t parameter) const noexcept;
};

// Returns the UART that a host means by `text`, a parameter of registers 5 to 7: "1" or "2"; or "0" or "?" for
// `asking`, the UART at which the command came. Returns nullopt for any other text.
std::optional<unsigned> uart_in(std::string_view text, unsigned asking) noexcept;
// Writes a register of `configuration`. `rest` is the number of the register and its parameters ("06,14").
Error write_register(Configuration& configuration, const Model& model, unsigned asking,
                     std::string_view rest) noexcept;
// Returns the load of a UART by all streams, as a share of its capacity: above 1, it cannot carry them.
double line_load(const Configuration& configuration, const Model& model, unsigned uart) noexcept;
// Appends the parameters of register `id`, which must not be a measurement register. Only registers 5 to 7 use `uart`
// (see uart_in()); their answer ends with the number of this UART. If `uart` is empty, the answer is for `asking`,
// and has no number.
Error put_register(const Configuration& configuration, const Model& model, unsigned id, unsigned asking,
                   std::string_view uart, Message& message) noexcept;

// Increments since an output was last sent.
struct Sums {
  double dt = 0;  // s
  LaneVector delta_angle, delta_velocity;
  [[gnu::always_inline]] void add(Lanes angle, Lanes velocity, double step_s) noexcept {
    dt += step_s;
    delta_angle.add(angle);
    delta_velocity.add(velocity);
  }
};

// The measurements without compensation, in the host's reference frame; zeros before the first sample.
struct Sensed {
  Vector3 magnetic_field = Vector3::Zero();  // T
  Vector3 specific_force = Vector3::Zero();  // m/s^2
  Vector3 rate = Vector3::Zero();            // rad/s
};

// The data that messages and fields report.
struct Reading {
  const Model& model;
  const Sample& sample;  // compensated, in the host's reference frame; zeros before the first one
  const Sensed& raw;
  const OwnFigures& figures;
  const Quaternion&
      tare;  // rotation from north-east-down to the frame set by VNTAR; applied to reported attitudes only
  Nanoseconds since_start;  // at the time of the message
  Nanoseconds age;          // of the sample, at the time of the message
  SyncStatus sync;          // at the time of the message
};

// Returns the name of the message of that type; empty if the model has no such message.
std::string_view name_of(unsigned type, const Model& model) noexcept;
// Returns the size of the longest message of that type, in bytes: from '$' to LF, with a checksum of two digits and
// nothing appended.
std::size_t size_of(unsigned type) noexcept;
// Returns the type of the message with the content of measurement register `id`; 0: it is not a measurement register.
unsigned type_of_register(unsigned id) noexcept;
// Returns true if the model has the content of that type, as a message or as a register only.
bool is_measured(unsigned type, const Model& model) noexcept;
// Appends the content of a message. If the message has increments, `sums` restarts at 0.
void put_measurement(unsigned type, const Reading& reading, Sums& sums, Message& message) noexcept;
// Appends to a streamed message the status ("S"; mode 0: none, 1: VPE, 2: INS) and the count ("T"; mode 0: none) that
// register 30 configures (UM001, page 69).
void put_appended(double count_mode, double status_mode, const Reading& reading, Message& message) noexcept;
using BinaryFrame = FrameWriter<boost::endian::order::little>;
// Appends all fields of an output, with zeros for fields that the emulated device lacks.
void put_fields(const BinaryOutput& output, const Reading& reading, const Sums& sums, BinaryFrame& frame) noexcept;

extern const Setting declared_settings[11];
// Returns the UART, counted from 0, that is at the port.
unsigned uart_of(const Settings& settings);
// These functions throw std::invalid_argument as Protocol::make does. The model has the firmware of the settings.
Model model_of(const Settings& settings);
Configuration configuration_of(const Settings& settings);
Product product_of(const Settings& settings);

// Decodes binary frames, and the text messages that have rates, accelerations or increments.
std::unique_ptr<Decoder> make_decoder();

}  // namespace imud::vectornav
