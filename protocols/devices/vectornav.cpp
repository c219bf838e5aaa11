// VectorNav VN-100, VN-200 and VN-300: ASCII commands and messages, registers, binary outputs. Layouts and sizes are those
// of VectorNav's programming library (vnproglib 1.2, as in github.com/dawonn/vectornav 6824e8b) and of ArduPilot's driver
// (AP_ExternalAHRS_VectorNav.cpp).
//
// ASCII: '$', body, '*', checksum of the body, CR LF: two hexadecimal digits of its XOR, or four of its CRC-16 (0x1021 from
// 0), or "XX" for none; the answer has the form that the host used. Binary: 0xFA, groups, a mask of 16 bits for each group,
// little-endian; the fields in order of groups and bits; the CRC-16 of all after 0xFA, big-endian.
#include <array>
#include <bit>
#include <boost/crc.hpp>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/command_reader.hpp"
#include "protocols/frame_search.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire.hpp"

namespace imud {

namespace {

enum Error : unsigned { bad_checksum = 3, bad_command, too_few, too_many, bad_parameter, bad_register, unauthorised };
constexpr std::size_t longest = 1024;  // of a frame
constexpr std::array<std::uint32_t, 9> bauds = {9600, 19200, 38400, 57600, 115200, 128000, 230400, 460800, 921600};

// Bytes of each field (vnproglib, Packet::BinaryGroupLengths).
enum Group : unsigned { common, time_group, imu, gnss1, attitude, ins, gnss2, groups };
constexpr std::array<std::array<std::uint8_t, 15>, groups> field_sizes = {{
    {8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8},
    {8, 8, 8, 2, 8, 8, 8, 4, 4, 1},
    {2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40},
    {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28},
    {2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12},
    {2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64},
    {8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28},
}};

unsigned xor_of(std::string_view text) noexcept {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  return sum;
}
template <class Bytes>
unsigned crc16(const Bytes& bytes) noexcept {
  boost::crc_optimal<16, 0x1021, 0, 0, false, false> crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

template <class Number>
std::optional<Number> number_in(std::string_view text, int radix = 10) noexcept {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, radix);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}
bool is_number(std::string_view text) noexcept {
  if (text.starts_with('+')) text.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(number);
}

// The words between commas; at most as many as fit.
struct Words {
  explicit Words(std::string_view text) noexcept {
    while (count < words.size()) {
      const std::size_t comma = text.find(',');
      words[count++] = text.substr(0, comma);
      if (comma == std::string_view::npos) return;
      text.remove_prefix(comma + 1);
    }
    ++count;  // too many
  }
  std::array<std::string_view, 20> words;
  std::size_t count = 0;
  std::string_view operator[](std::size_t i) const noexcept { return words[i]; }
};

// A message of text: body, then checksum in the form asked for.
enum class Form : std::uint8_t { two_digits, four_digits };
class Message {
 public:
  Message(FrameBuffer& out, Form form) noexcept : out_(out), form_(form) { text_[size_++] = '$'; }
  Message& put(std::string_view text) noexcept {
    for (const char c : text)
      if (size_ < text_.size() - 16) text_[size_++] = c;
    return *this;
  }
  Message& put(double number, const char* format) noexcept {  // after a comma
    std::array<char, 40> digits;
    const int size = std::snprintf(digits.data(), digits.size(), format, number);
    return put(",").put({digits.data(), static_cast<std::size_t>(std::clamp(size, 0, 39))});
  }
  Message& put(const Vector3& vector, const char* format) noexcept {
    for (int i = 0; i < 3; ++i) put(vector[i], format);
    return *this;
  }
  void send() noexcept {
    const std::string_view body(text_.data() + 1, size_ - 1);
    const unsigned sum = form_ == Form::two_digits ? xor_of(body) : crc16(body);
    size_ += static_cast<std::size_t>(std::snprintf(text_.data() + size_, 16, form_ == Form::two_digits ? "*%02X\r\n" : "*%04X\r", sum));
    if (form_ == Form::four_digits) text_[size_++] = '\n';
    const std::span<std::byte> room = out_.room(size_);
    if (room.empty()) return;
    std::memcpy(room.data(), text_.data(), size_);
    out_.push(size_);
  }

 private:
  FrameBuffer& out_;
  Form form_;
  std::array<char, 300> text_;
  std::size_t size_ = 0;
};

// A register that is kept as it was written.
struct Register {
  unsigned id;
  unsigned count;  // of its parameters
  std::string_view initial;
};
constexpr Register kept[] = {
    {0, 1, ""},
    {21, 6, "+1.00000,+0.00000,+1.80000,+00.0000,+00.0000,-09.7937"},
    {23, 12, "+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000"},
    {25, 12, "+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000"},
    {26, 9, "+1.00000,+0.00000,+0.00000,+0.00000,+1.00000,+0.00000,+0.00000,+0.00000,+1.00000"},
    {30, 7, "0,0,0,0,1,0,1"},
    {32, 9, "3,0,0,0,0,0,1,0,100000000"},
    {33, 3, "0,0,0"},
    {35, 4, "1,1,1,1"},
    {36, 9, "+04.00,+04.00,+04.00,+05.00,+05.00,+05.00,+05.50,+05.50,+05.50"},
    {38, 9, "+05.00,+05.00,+05.00,+03.00,+03.00,+03.00,+04.00,+04.00,+04.00"},
    {44, 3, "1,3,5"},
    {51, 3, "1,+0.10,+0.01"},
    {55, 5, "0,0,5,0,0"},
    {57, 3, "+00.000,+00.000,+00.000"},
    {67, 4, "0,1,1,0"},
    {82, 5, "0,0,0,0,0"},
    {83, 8, "0,0,0,0,+0.00000,+0.00000000,+0.00000000,+0.000"},
    {84, 12, "+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000,+01.00000,+00.00000,+00.00000,+00.00000"},
    {85, 10, "0,4,4,0,0,0,3,3,0,0"},
};
constexpr std::size_t register_size = 160;

struct BinaryOutput {
  unsigned mode = 0, divisor = 1;
  std::array<std::uint16_t, groups> masks = {};

  unsigned group_bits() const noexcept {
    unsigned bits = 0;
    for (unsigned g = 0; g < groups; ++g) bits |= masks[g] != 0 ? 1U << g : 0U;
    return bits;
  }
  // "3,16,01,0721": mode, divisor, groups and their masks in hexadecimal digits.
  static std::optional<BinaryOutput> parse(std::string_view text, Error& error) noexcept {
    const Words words(text);
    error = too_few;
    if (words.count < 3) return std::nullopt;
    BinaryOutput output;
    const auto mode = number_in<unsigned>(words[0]), divisor = number_in<unsigned>(words[1]);
    const auto bits = number_in<unsigned>(words[2], 16);
    error = bad_parameter;
    if (!mode || *mode > 3 || !divisor || *divisor == 0 || *divisor > 0xFFFF || !bits || *bits > 0x7F) return std::nullopt;
    const auto wanted = 3 + static_cast<std::size_t>(std::popcount(*bits));
    error = words.count < wanted ? too_few : too_many;
    if (words.count != wanted) return std::nullopt;
    output.mode = *mode;
    output.divisor = *divisor;
    std::size_t at = 3, size = 2 + 2 * (wanted - 3) + 2;
    for (unsigned g = 0; g < groups; ++g) {
      if ((*bits >> g & 1U) == 0) continue;
      const auto mask = number_in<std::uint16_t>(words[at++], 16);
      error = bad_parameter;
      if (!mask) return std::nullopt;
      for (unsigned bit = 0; bit < 16; ++bit) {
        if ((*mask >> bit & 1U) == 0) continue;
        if (bit > 14 || field_sizes[g][bit] == 0) return std::nullopt;
        size += field_sizes[g][bit];
      }
      output.masks[g] = *mask;
    }
    if (size > longest) return std::nullopt;
    return output;
  }
};

struct Configuration {
  std::uint32_t baud = 115200;
  unsigned async_type = 14, async_hz = 40;
  std::array<BinaryOutput, 3> binary = {};
  std::array<std::array<char, register_size>, 3> binary_text = {};
  std::array<std::array<char, register_size>, std::size(kept)> registers = {};

  Configuration() noexcept {
    for (std::size_t i = 0; i < std::size(kept); ++i) store(registers[i], kept[i].initial);
    for (auto& text : binary_text) store(text, "0,0,00");
  }
  static void store(std::array<char, register_size>& place, std::string_view text) noexcept {
    place = {};
    std::memcpy(place.data(), text.data(), std::min(text.size(), register_size - 1));
  }
};

struct Model {
  std::string_view keyword, name;
  double internal_hz;
};
constexpr Model models[] = {{"vn-100", "VN-100S-CR", 800}, {"vn-200", "VN-200S-CR", 800}, {"vn-300", "VN-300S-CR", 400}};

class VectorNavDevice final : public Device {
 public:
  VectorNavDevice(const Model& model, const Configuration& configuration) noexcept
      : model_(model), factory_(configuration), stored_(configuration), active_(configuration) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    sample_ = sample;
    if (!started_) start_ = sample.time;
    started_ = true;
    for (Sums& sums : sums_) sums.add(sample, 1 / model_.internal_hz);
    if (paused_) return;
    const auto ascii_divisor = static_cast<std::uint64_t>(model_.internal_hz) / std::max(1U, active_.async_hz);
    if (active_.async_type != 0 && sample.counter % ascii_divisor == 0) send_async(active_.async_type, out);
    for (std::size_t i = 0; i < active_.binary.size(); ++i)
      if ((active_.binary[i].mode & 1U) != 0 && sample.counter % active_.binary[i].divisor == 0) send_binary(i, out);
  }

  void receive(const Frame& from_host, FrameBuffer& replies) noexcept override {
    reader_.feed(from_host.bytes, sample_.time, [&](std::string_view line) {
      // What comes before is not ours; a command cut off is followed by another one's beginning.
      if (const std::size_t begin = line.rfind('$'); begin != std::string_view::npos) obey(line.substr(begin + 1), replies);
    });
  }

  LineSettings line() const noexcept override { return {active_.baud}; }

 private:
  // Increments since an output was sent last.
  struct Sums {
    double dt = 0;
    Vector3 delta_angle = Vector3::Zero(), delta_velocity = Vector3::Zero();
    void add(const Sample& sample, double step_s) noexcept {
      dt += step_s;
      delta_angle += sample.delta_angle;
      delta_velocity += sample.delta_velocity;
    }
  };
  static constexpr std::size_t of_ascii = 3;

  Vector3 ypr_deg() const noexcept {
    return yaw_pitch_roll_from_dcm(sample_.q_LP.conjugate().toRotationMatrix()) / units::degree;
  }
  // The true acceleration without gravity is not known here: that of the specific force, and of a vertical of 9.8.
  Vector3 linear_acceleration_N() const noexcept {
    return sample_.q_LP * sample_.specific_force + Vector3(0, 0, units::standard_gravity);
  }
  Form async_form() const noexcept {  // register 30, parameter 5
    return Words(text_of(30))[4] == "3" ? Form::four_digits : Form::two_digits;
  }
  std::string_view text_of(unsigned id) const noexcept {
    for (std::size_t i = 0; i < std::size(kept); ++i)
      if (kept[i].id == id) return active_.registers[i].data();
    return "";
  }

  static constexpr const char *angle = "%+08.3f", *field = "%+08.4f", *acceleration = "%+07.3f", *rate = "%+010.6f",
                              *quaternion = "%+09.6f";

  // What a measurement register or a message says, without its name. False if there is none of that kind.
  bool put_measurement(unsigned type, Message& message) noexcept {
    const Vector3 none = Vector3::Zero();
    const Quaternion& q = sample_.q_LP;
    const auto put_q = [&] {
      for (const double part : {q.x(), q.y(), q.z(), q.w()}) message.put(part, quaternion);
    };
    switch (type) {
      case 1: message.put(ypr_deg(), angle); return true;
      case 2: put_q(); return true;
      case 8: put_q(); message.put(none, field).put(sample_.specific_force, acceleration).put(sample_.rate, rate); return true;
      case 10: message.put(none, field); return true;
      case 11: message.put(sample_.specific_force, acceleration); return true;
      case 12: message.put(sample_.rate, rate); return true;
      case 13: message.put(none, field).put(sample_.specific_force, acceleration).put(sample_.rate, rate); return true;
      case 14:
        message.put(ypr_deg(), angle).put(none, field).put(sample_.specific_force, acceleration).put(sample_.rate, rate);
        return true;
      case 16:
        message.put(ypr_deg(), angle).put(Vector3(q.conjugate() * linear_acceleration_N()), acceleration).put(sample_.rate, rate);
        return true;
      case 17: message.put(ypr_deg(), angle).put(linear_acceleration_N(), acceleration).put(sample_.rate, rate); return true;
      case 19:
        message.put(none, field).put(sample_.specific_force, acceleration).put(sample_.rate, rate);
        message.put(sample_.temperature_c, "%+05.1f").put(0.0, "%+08.3f");
        return true;
      case 30: {
        const Sums sums = std::exchange(sums_[of_ascii], {});
        message.put(sums.dt, "%+09.6f").put(Vector3(sums.delta_angle / units::degree), "%+011.6f").put(sums.delta_velocity, "%+011.6f");
        return true;
      }
      default: return false;
    }
  }

  static std::string_view name_of(unsigned type) noexcept {
    constexpr std::array<std::pair<unsigned, std::string_view>, 12> names = {
        {{1, "VNYPR"}, {2, "VNQTN"}, {8, "VNQMR"}, {10, "VNMAG"}, {11, "VNACC"}, {12, "VNGYR"}, {13, "VNMAR"}, {14, "VNYMR"},
         {16, "VNYBA"}, {17, "VNYIA"}, {19, "VNIMU"}, {30, "VNDTV"}}};
    for (const auto& [known, name] : names)
      if (known == type) return name;
    return "";
  }

  void send_async(unsigned type, FrameBuffer& out) noexcept {
    Message message(out, async_form());
    message.put(name_of(type));
    if (put_measurement(type, message)) message.send();
  }

  // --- Binary ---
  class Frame8 {  // little-endian bytes in a FrameBuffer
   public:
    explicit Frame8(FrameBuffer& out) noexcept : out_(out), room_(out.room(longest)) {}
    template <class Number>
    void put(Number number) noexcept {
      if constexpr (std::is_same_v<Number, float>) return put(std::bit_cast<std::uint32_t>(number));
      else {
        if (room_.size() < size_ + sizeof number) return;
        const Number little = boost::endian::native_to_little(number);
        std::memcpy(room_.data() + size_, &little, sizeof little);
        size_ += sizeof little;
      }
    }
    void put(const Vector3& vector) noexcept {
      for (int i = 0; i < 3; ++i) put(to_float(vector[i]));
    }
    std::size_t size() const noexcept { return size_; }
    void finish() noexcept {
      if (room_.empty()) return;
      const unsigned crc = crc16(room_.subspan(1, size_ - 1));
      put(static_cast<std::uint8_t>(crc >> 8));
      put(static_cast<std::uint8_t>(crc));
      out_.push(size_);
    }

   private:
    FrameBuffer& out_;
    std::span<std::byte> room_;
    std::size_t size_ = 0;
  };

  void send_binary(std::size_t which, FrameBuffer& out) noexcept {
    const BinaryOutput& output = active_.binary[which];
    if (output.group_bits() == 0) return;
    Frame8 frame(out);
    frame.put(std::uint8_t{0xFA});
    frame.put(static_cast<std::uint8_t>(output.group_bits()));
    for (const std::uint16_t mask : output.masks)
      if (mask != 0) frame.put(mask);
    const Sums sums = std::exchange(sums_[which], {});
    for (unsigned g = 0; g < groups; ++g)
      for (unsigned bit = 0; bit < 15; ++bit) {
        if ((output.masks[g] >> bit & 1U) == 0) continue;
        const std::size_t end = frame.size() + field_sizes[g][bit];
        put_field(g, bit, sums, frame);
        while (frame.size() < end) frame.put(std::uint8_t{0});  // what an IMU does not know
      }
    frame.finish();
  }

  void put_field(unsigned group, unsigned bit, const Sums& sums, Frame8& frame) const noexcept {
    const Quaternion& q = sample_.q_LP;
    const auto put_time = [&] { frame.put(static_cast<std::uint64_t>((sample_.time - start_).count())); };
    const auto put_q = [&] {
      for (const double part : {q.x(), q.y(), q.z(), q.w()}) frame.put(to_float(part));
    };
    const auto put_delta_angle = [&] {
      frame.put(to_float(sums.dt));
      frame.put(Vector3(sums.delta_angle / units::degree));
    };
    switch (group << 4 | bit) {
      case common << 4 | 0:
      case time_group << 4 | 0: return put_time();
      case common << 4 | 3:
      case attitude << 4 | 1: return frame.put(ypr_deg());
      case common << 4 | 4:
      case attitude << 4 | 2: return put_q();
      case common << 4 | 5:
      case imu << 4 | 3:
      case imu << 4 | 10: return frame.put(sample_.rate);
      case common << 4 | 8:
      case imu << 4 | 2:
      case imu << 4 | 9: return frame.put(sample_.specific_force);
      case common << 4 | 9:
        frame.put(sample_.specific_force);
        return frame.put(sample_.rate);
      case common << 4 | 10:
        frame.put(Vector3(Vector3::Zero()));
        return frame.put(to_float(sample_.temperature_c));
      case common << 4 | 11:
        put_delta_angle();
        return frame.put(sums.delta_velocity);
      case imu << 4 | 4: return frame.put(to_float(sample_.temperature_c));
      case imu << 4 | 6: return put_delta_angle();
      case imu << 4 | 7: return frame.put(sums.delta_velocity);
      case imu << 4 | 11:
        return frame.put(static_cast<std::uint16_t>((sample_.status >> 3 & 7U) << 3 | (sample_.status & 7U) << 6));
      case attitude << 4 | 3: {
        const Matrix3 dcm = q.conjugate().toRotationMatrix();
        for (int r = 0; r < 3; ++r) frame.put(Vector3(dcm.row(r).transpose()));
        return;
      }
      case attitude << 4 | 5: return frame.put(Vector3(q * sample_.specific_force));
      case attitude << 4 | 6: return frame.put(Vector3(q.conjugate() * linear_acceleration_N()));
      case attitude << 4 | 7: return frame.put(linear_acceleration_N());
      default: return;
    }
  }

  // --- Commands ---
  void obey(std::string_view line, FrameBuffer& replies) noexcept {
    const std::size_t star = line.rfind('*');
    Form form = Form::two_digits;
    const auto refuse = [&](unsigned error) {
      std::array<char, 24> text;
      std::snprintf(text.data(), text.size(), "VNERR,%02X", error);
      Message(replies, form).put(text.data()).send();
    };
    if (star == std::string_view::npos) return refuse(bad_checksum);
    const std::string_view body = line.substr(0, star), sum = line.substr(star + 1);
    if (sum.size() == 4) form = Form::four_digits;
    const auto given = number_in<unsigned>(sum, 16);
    const bool good = sum == "XX" || sum == "XXXX" ||
                      (given && ((sum.size() == 2 && *given == xor_of(body)) || (sum.size() == 4 && *given == crc16(body))));
    if (!good) return refuse(bad_checksum);
    const std::string_view name = body.substr(0, 5);
    const std::string_view rest = body.size() > 6 ? body.substr(6) : std::string_view();
    if (body.size() > 5 && body[5] != ',') return refuse(bad_command);
    const auto echo = [&] { Message(replies, form).put(body).send(); };
    if (name == "VNRRG") {
      if (rest.empty()) return refuse(too_few);
      return read_register(rest, body, form, replies, refuse);
    }
    if (name == "VNWRG") {
      if (rest.empty()) return refuse(too_few);
      if (const unsigned error = write_register(rest); error != 0) return refuse(error);
      return echo();
    }
    if (name == "VNASY") {
      if (rest.empty()) return refuse(too_few);
      if (rest != "0" && rest != "1") return refuse(bad_parameter);
      paused_ = rest == "0";
      return echo();
    }
    if (name == "VNWNV") {
      stored_ = active_;
      return echo();
    }
    if (name == "VNRFS" || name == "VNRST") {
      if (name == "VNRFS") stored_ = factory_;
      echo();
      active_ = stored_;
      paused_ = false;
      started_ = false;
      sums_ = {};
      return;
    }
    if (name == "VNBOM") {
      const auto which = number_in<unsigned>(rest);
      if (!which || *which < 1 || *which > 3) return refuse(rest.empty() ? too_few : bad_parameter);
      return send_binary(*which - 1, replies);
    }
    if (name == "VNTAR" || name == "VNSGB" || name == "VNKMD" || name == "VNKAD" || name == "VNCMD") return echo();
    refuse(bad_command);
  }

  template <class Refuse>
  void read_register(std::string_view rest, std::string_view body, Form form, FrameBuffer& replies, Refuse&& refuse) noexcept {
    const std::string_view word = rest.substr(0, rest.find(','));
    const auto id = number_in<unsigned>(word);
    if (!id) return refuse(bad_parameter);
    Message message(replies, form);
    message.put(body.substr(0, 6)).put(word);
    const auto text = [&](std::string_view value) { message.put(",").put(value).send(); };
    const auto number = [&](unsigned value) { message.put(value, "%.0f").send(); };
    // Measurement registers by the type of message that says the same.
    constexpr std::array<std::pair<unsigned, unsigned>, 9> measurements = {
        {{8, 1}, {9, 2}, {15, 8}, {17, 10}, {18, 11}, {19, 12}, {20, 13}, {27, 14}, {54, 19}}};
    for (const auto& [known, type] : measurements)
      if (known == *id) {
        put_measurement(type, message);
        return message.send();
      }
    switch (*id) {
      case 1: return text(model_.name);
      case 2: return text("7");
      case 3: return text("0100012345");
      case 4: return text("2.1.0.0");
      case 5: return number(active_.baud);
      case 6: return number(active_.async_type);
      case 7: return number(active_.async_hz);
      case 75: case 76: case 77: return text(active_.binary_text[*id - 75].data());
      default: break;
    }
    for (std::size_t i = 0; i < std::size(kept); ++i)
      if (kept[i].id == *id) return text(active_.registers[i].data());
    refuse(bad_register);
  }

  // 0, or the error.
  unsigned write_register(std::string_view rest) noexcept {
    const std::size_t comma = rest.find(',');
    const auto id = number_in<unsigned>(rest.substr(0, comma));
    if (!id) return bad_parameter;
    const bool has_value = comma != std::string_view::npos;
    const std::string_view value = has_value ? rest.substr(comma + 1) : std::string_view();
    const Words words(value);
    switch (*id) {
      case 1: case 2: case 3: case 4: case 8: case 9: case 15: case 17: case 18: case 19: case 20: case 27: case 54:
        return unauthorised;
      case 5: case 6: case 7: {
        if (!has_value) return too_few;
        if (words.count > 2) return too_many;
        const auto number = number_in<unsigned>(words[0]);
        const auto port = words.count == 2 ? number_in<unsigned>(words[1]) : std::optional<unsigned>(1);
        if (!number || !port || *port < 1 || *port > 2) return bad_parameter;
        if (*id == 5 && std::find(bauds.begin(), bauds.end(), *number) == bauds.end()) return bad_parameter;
        if (*id == 6 && *number != 0 && name_of(*number).empty()) return bad_parameter;
        constexpr std::array<unsigned, 11> rates = {1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200};
        if (*id == 7 && std::find(rates.begin(), rates.end(), *number) == rates.end()) return bad_parameter;
        if (*port == 2) return 0;  // the other connector
        if (*id == 5) active_.baud = *number;
        if (*id == 6) active_.async_type = *number;
        if (*id == 7) active_.async_hz = *number;
        return 0;
      }
      case 75: case 76: case 77: {
        if (!has_value) return too_few;
        Error error{};
        const auto output = BinaryOutput::parse(value, error);
        if (!output) return error;
        active_.binary[*id - 75] = *output;
        Configuration::store(active_.binary_text[*id - 75], value);
        sums_[*id - 75] = {};
        return 0;
      }
      default: break;
    }
    for (std::size_t i = 0; i < std::size(kept); ++i) {
      if (kept[i].id != *id) continue;
      if (!has_value || words.count < kept[i].count) return too_few;
      if (words.count > kept[i].count) return too_many;
      if (value.size() >= register_size) return bad_parameter;
      if (*id != 0)
        for (std::size_t k = 0; k < words.count; ++k)
          if (!is_number(words[k])) return bad_parameter;
      Configuration::store(active_.registers[i], value);
      return 0;
    }
    return bad_register;
  }

  const Model& model_;
  const Configuration factory_;
  Configuration stored_, active_;
  bool paused_ = false, started_ = false;
  DeviceTime start_;
  Sample sample_;  // the newest
  std::array<Sums, 4> sums_;
  CommandReader<256> reader_;
};

// Of binary frames, and of the messages of text that have rates or accelerations.
class VectorNavDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    errors_.skipped_bytes += search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return judge(held, sink); });
  }
  void finish(MeasurementSink&) override { errors_.skipped_bytes += search_.finish(); }

 private:
  using Search = FrameSearch<longest>;

  std::size_t judge(std::span<const std::byte> held, MeasurementSink& sink) {
    if (held[0] == std::byte{0xFA}) return judge_binary(held, sink);
    if (held[0] == std::byte{'$'}) return judge_text(held, sink);
    return Search::reject;
  }

  std::size_t judge_binary(std::span<const std::byte> held, MeasurementSink& sink) {
    if (held.size() < 2) return Search::need_more;
    const auto bits = std::to_integer<unsigned>(held[1]);
    if (bits == 0 || bits > 0x7F) return Search::reject;
    std::size_t size = 2 + 2 * static_cast<std::size_t>(std::popcount(bits));
    if (held.size() < size) return Search::need_more;
    std::array<unsigned, groups> masks = {};
    std::size_t at = 2;
    for (unsigned g = 0; g < groups; ++g) {
      if ((bits >> g & 1U) == 0) continue;
      masks[g] = std::to_integer<unsigned>(held[at]) | std::to_integer<unsigned>(held[at + 1]) << 8;
      at += 2;
      for (unsigned bit = 0; bit < 16; ++bit) {
        if ((masks[g] >> bit & 1U) == 0) continue;
        if (bit > 14 || field_sizes[g][bit] == 0) return Search::reject;
        size += field_sizes[g][bit];
      }
    }
    size += 2;
    if (size > longest) return Search::reject;
    if (held.size() < size) return Search::need_more;
    if (crc16(held.subspan(1, size - 1)) != 0) {
      ++errors_.checksum;
      return Search::reject;
    }
    Measurement measurement;
    bool finite = true;
    for (unsigned g = 0; g < groups; ++g)
      for (unsigned bit = 0; bit < 15; ++bit)
        if ((masks[g] >> bit & 1U) != 0) {
          finite = take(g << 4 | bit, held.subspan(at, field_sizes[g][bit]), measurement) && finite;
          at += field_sizes[g][bit];
        }
    if (!finite) ++errors_.malformed;
    else if (measurement.fields != 0) sink.on_measurement(measurement);
    return size;
  }

  template <class Number>
  static Number number(std::span<const std::byte> bytes, std::size_t at) noexcept {
    Number value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return boost::endian::little_to_native(value);
  }
  static double real(std::span<const std::byte> bytes, std::size_t i) noexcept {
    return static_cast<double>(std::bit_cast<float>(number<std::uint32_t>(bytes, 4 * i)));
  }
  static Vector3 vector(std::span<const std::byte> bytes, std::size_t i) noexcept {
    return {real(bytes, i), real(bytes, i + 1), real(bytes, i + 2)};
  }

  // False if a number is none.
  static bool take(unsigned field, std::span<const std::byte> data, Measurement& m) noexcept {
    Sample& s = m.sample;
    switch (field) {
      case common << 4 | 0:
      case time_group << 4 | 0:
        s.time.ns = static_cast<std::int64_t>(number<std::uint64_t>(data, 0));
        m.fields |= Measurement::time;
        return true;
      case common << 4 | 5:
      case imu << 4 | 10:
        s.rate = vector(data, 0);
        m.fields |= Measurement::rate;
        return s.rate.allFinite();
      case common << 4 | 8:
      case imu << 4 | 9:
        s.specific_force = vector(data, 0);
        m.fields |= Measurement::specific_force;
        return s.specific_force.allFinite();
      case common << 4 | 11:
        s.delta_velocity = vector(data, 4);
        m.fields |= Measurement::delta_velocity;
        [[fallthrough]];
      case imu << 4 | 6:
        s.delta_angle = units::degree * vector(data, 1);
        m.fields |= Measurement::delta_angle;
        return s.delta_angle.allFinite() && s.delta_velocity.allFinite();
      case imu << 4 | 7:
        s.delta_velocity = vector(data, 0);
        m.fields |= Measurement::delta_velocity;
        return s.delta_velocity.allFinite();
      case imu << 4 | 4:
        s.temperature_c = real(data, 0);
        m.fields |= Measurement::temperature;
        return std::isfinite(s.temperature_c);
      case imu << 4 | 11: {
        const unsigned bits = number<std::uint16_t>(data, 0);
        s.status = (bits >> 6 & 7U) | (bits >> 3 & 7U) << 3;
        m.fields |= Measurement::status;
        return true;
      }
      default: return true;
    }
  }

  std::size_t judge_text(std::span<const std::byte> held, MeasurementSink& sink) {
    constexpr std::size_t longest_text = 300;
    const std::string_view text(reinterpret_cast<const char*>(held.data()), std::min(held.size(), longest_text));
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return text.size() == longest_text ? Search::reject : Search::need_more;
    const std::size_t star = text.substr(0, end).rfind('*');
    if (star == std::string_view::npos || end < star + 4) return Search::reject;
    const std::string_view body = text.substr(1, star - 1), sum = text.substr(star + 1, end - star - 2);
    const auto given = number_in<unsigned>(sum, 16);
    if (!given || !((sum.size() == 2 && *given == xor_of(body)) || (sum.size() == 4 && *given == crc16(body)))) {
      ++errors_.checksum;
      return Search::reject;
    }
    measure(Words(body), sink);
    return end + 1;
  }

  static void measure(const Words& words, MeasurementSink& sink) {
    // Where the acceleration and the rate begin.
    struct Layout {
      std::string_view name;
      std::size_t count, acceleration, rate;
    };
    constexpr std::array<Layout, 7> layouts = {{{"VNQMR", 14, 8, 11}, {"VNACC", 4, 1, 0}, {"VNGYR", 4, 0, 1},
                                                {"VNMAR", 10, 4, 7}, {"VNYMR", 13, 7, 10}, {"VNIMU", 12, 4, 7},
                                                {"VNYBA", 10, 0, 7}}};
    for (const Layout& layout : layouts) {
      if (words[0] != layout.name || words.count != layout.count) continue;
      Measurement m;
      const auto get = [&](std::size_t at) {
        Vector3 v = Vector3::Zero();
        for (std::size_t i = 0; i < 3; ++i) {
          std::string_view word = words[at + i];
          if (word.starts_with('+')) word.remove_prefix(1);
          v[static_cast<int>(i)] = number_in_real(word);
        }
        return v;
      };
      if (layout.acceleration != 0) m.sample.specific_force = get(layout.acceleration);
      if (layout.rate != 0) m.sample.rate = get(layout.rate);
      m.fields = (layout.acceleration != 0 ? Measurement::specific_force : 0U) | (layout.rate != 0 ? Measurement::rate : 0U);
      sink.on_measurement(m);
    }
  }
  static double number_in_real(std::string_view text) noexcept {
    double number = 0;
    std::from_chars(text.data(), text.data() + text.size(), number);
    return number;
  }

  Search search_;
};

constexpr std::array<std::string_view, 3> model_names = {models[0].keyword, models[1].keyword, models[2].keyword};
constexpr Setting declared[] = {
    {.key = "model", .help = "which device", .initial = models[0].keyword, .choices = model_names},
    {.key = "baud", .help = "bit/s", .initial = std::int64_t{115200}, .min = 9600, .max = 921600},
    {.key = "async_type", .help = "register 6: the message of text that is streamed; 0: none", .initial = std::int64_t{14},
     .min = 0, .max = 30},
    {.key = "async_hz", .help = "register 7", .initial = std::int64_t{40}, .min = 1, .max = 200},
    {.key = "binary_1", .help = "register 75, such as \"1,16,01,0029\"", .initial = std::string_view("")},
    {.key = "binary_2", .help = "register 76", .initial = std::string_view("")},
    {.key = "binary_3", .help = "register 77", .initial = std::string_view("")},
};

const Model& model_of(const Settings& settings) {
  for (const Model& model : models)
    if (model.keyword == settings.text("model")) return model;
  return models[0];
}

Configuration configuration(const Settings& settings) {
  Configuration c;
  c.baud = static_cast<std::uint32_t>(settings.integer("baud"));
  if (std::find(bauds.begin(), bauds.end(), c.baud) == bauds.end())
    throw std::invalid_argument("baud: give 9600, 19200, 38400, 57600, 115200, 128000, 230400, 460800 or 921600");
  c.async_type = static_cast<unsigned>(settings.integer("async_type"));
  c.async_hz = static_cast<unsigned>(settings.integer("async_hz"));
  if (static_cast<unsigned>(model_of(settings).internal_hz) % c.async_hz != 0)
    throw std::invalid_argument("async_hz: give 1, 2, 4, 5, 10, 20, 25, 40, 50, 100 or 200");
  constexpr std::array<const char*, 3> keys = {"binary_1", "binary_2", "binary_3"};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string& text = settings.text(keys[i]);
    if (text.empty()) continue;
    Error error{};
    const auto output = BinaryOutput::parse(text, error);
    if (!output || text.size() >= register_size)
      throw std::invalid_argument(std::string(keys[i]) + ": give mode, divisor, groups and their masks, such as \"1,16,01,0029\"");
    c.binary[i] = *output;
    Configuration::store(c.binary_text[i], text);
  }
  return c;
}

// 0.0035 deg/s/sqrt(Hz), 0.14 mg/sqrt(Hz), 2000 deg/s, 16 g.
Product product(const Settings& settings) {
  Product product;
  product.rate_hz = model_of(settings).internal_hz;
  const double root = std::sqrt(product.rate_hz);
  product.gyro.max = 2000 * units::degree;
  product.gyro.walk_transition.setZero();
  product.gyro.walk_sqrt_cov = 0.0035 * units::degree * root * Matrix3::Identity();
  product.accelerometer.max = 16 * units::standard_gravity;
  product.accelerometer.walk_transition.setZero();
  product.accelerometer.walk_sqrt_cov = 0.14e-3 * units::standard_gravity * root * Matrix3::Identity();
  configuration(settings);
  return product;
}

}  // namespace

extern const Protocol vectornav_protocol;
constexpr Protocol vectornav_protocol = {
    .name = "vectornav",
    .summary = "VectorNav VN-100, VN-200, VN-300 as IMU and attitude source: commands, registers, text and binary outputs",
    .link = Link::bytes,
    .document = "vnproglib 1.2; ArduPilot AP_ExternalAHRS_VectorNav",
    .settings = declared,
    .fields = Measurement::rate | Measurement::specific_force | Measurement::delta_angle | Measurement::delta_velocity |
              Measurement::temperature | Measurement::status,
    .resolution = {.rate = 0x1p-18, .specific_force = 0x1p-16, .delta_angle = 0x1p-18 * units::degree,
                   .delta_velocity = 0x1p-20, .temperature_c = 0x1p-17},
    .range = {.rate = 63, .specific_force = 255, .delta_angle = 1, .delta_velocity = 15, .temperature_c = 128},
    .counter_bits = 0,
    .status_bits = 0x3F,
    .has_checksum = true,
    .burst_bits = 16,
    .product = product,
    .trial = "async_type=0 binary_1=1,1,04,0ED0",
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<VectorNavDevice>(model_of(settings), configuration(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<VectorNavDecoder>(); },
};

}  // namespace imud
