// MicroStrain MIP, as the 3DM-GX5-25 and the 3DM-CV7-AHRS speak it. The layouts are those of MicroStrain's mip_sdk
// (github.com/LORD-MicroStrain/mip_sdk e5a847d, src/c/mip/definitions), against whose capture the tests hold them.
//
// A packet, big-endian: 0x75 0x65, descriptor set, length of what follows, fields, two bytes of checksum: the sum of all
// bytes before, and the sum of these sums. A field: its own length, descriptor, data. A command's answer is a packet of
// its set: field 0xF1 {command, code} for each command, followed by its data.
//
// What the document does not say and a user would expect: out of the box the device streams (ArduPilot sends nothing and
// waits for that); reference time is the device's own time.
#include <array>
#include <boost/endian/conversion.hpp>
#include <bit>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/frame_search.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire.hpp"

namespace imud {

namespace {

constexpr std::uint8_t sync[2] = {0x75, 0x65};
constexpr std::size_t header_size = 4, checksum_size = 2, longest = header_size + 255 + checksum_size;
constexpr double internal_hz = 1000;
constexpr std::uint8_t base = 0x01, three_dm = 0x0C, sensor = 0x80, filter = 0x82, reply = 0xF1;
enum Code : std::uint8_t { ok = 0, unknown_command = 1, bad_parameter = 3 };
enum Function : std::uint8_t { write = 1, read, save, load, to_default };

// The fields that are sent, with the keywords of the configuration.
struct DataField {
  std::string_view name;
  std::uint8_t set, descriptor, size;  // of the data
};
constexpr DataField data_fields[] = {
    {"acceleration", sensor, 0x04, 12},   {"rate", sensor, 0x05, 12},
    {"delta_angle", sensor, 0x07, 12},    {"delta_velocity", sensor, 0x08, 12},
    {"quaternion", sensor, 0x0A, 16},     {"euler", sensor, 0x0C, 12},
    {"gps_time", sensor, 0x12, 12},       {"temperature", sensor, 0x14, 12},
    {"overrange", sensor, 0x18, 2},       {"event_source", sensor, 0xD0, 1},
    {"ticks", sensor, 0xD1, 4},           {"delta_ticks", sensor, 0xD2, 4},
    {"shared_gps_time", sensor, 0xD3, 12}, {"delta_time", sensor, 0xD4, 8},
    {"reference_time", sensor, 0xD5, 8},  {"reference_delta", sensor, 0xD6, 8},
    {"filter_quaternion", filter, 0x03, 18}, {"filter_euler", filter, 0x05, 14},
    {"filter_status", filter, 0x10, 6},   {"filter_gps_time", filter, 0x11, 12},
    {"filter_reference_time", filter, 0xD5, 8}, {"filter_reference_delta", filter, 0xD6, 8},
};
const DataField* find_field(std::uint8_t set, std::uint8_t descriptor) noexcept {
  for (const DataField& field : data_fields)
    if (field.set == set && field.descriptor == descriptor) return &field;
  return nullptr;
}

std::array<std::uint8_t, 2> checksum_of(std::span<const std::byte> bytes) noexcept {
  std::uint8_t a = 0, b = 0;
  for (const std::byte byte : bytes) {
    a = static_cast<std::uint8_t>(a + std::to_integer<unsigned>(byte));
    b = static_cast<std::uint8_t>(b + a);
  }
  return {a, b};
}

// Writes one into a FrameBuffer.
class Packet {
 public:
  Packet(FrameBuffer& out, std::uint8_t set) noexcept : out_(out), room_(out.room(longest)) {
    put(sync[0]);
    put(sync[1]);
    put(set);
    put(std::uint8_t{0});
  }
  template <class Number>
  void put(Number number) noexcept {
    if constexpr (std::is_same_v<Number, float>) return put(std::bit_cast<std::uint32_t>(number));
    else if constexpr (std::is_same_v<Number, double>) return put(std::bit_cast<std::uint64_t>(number));
    else {
      if (room_.size() < size_ + sizeof number) return;
      const Number big = boost::endian::native_to_big(number);
      std::memcpy(room_.data() + size_, &big, sizeof big);
      size_ += sizeof big;
    }
  }
  void put(const Vector3& vector) noexcept {
    for (int i = 0; i < 3; ++i) put(to_float(vector[i]));
  }
  void put_text(std::string_view text, std::size_t width) noexcept {
    for (std::size_t i = 0; i < width; ++i) put(static_cast<std::uint8_t>(i < text.size() ? text[i] : ' '));
  }
  void begin(std::uint8_t descriptor) noexcept {
    field_ = size_;
    put(std::uint8_t{0});
    put(descriptor);
  }
  void end() noexcept {
    if (!room_.empty()) room_[field_] = static_cast<std::byte>(size_ - field_);
  }
  std::size_t size() const noexcept { return size_; }
  void set_byte(std::size_t at, std::uint8_t byte) noexcept {
    if (at < size_) room_[at] = std::byte{byte};
  }
  bool has_room_for(std::size_t data) const noexcept { return size_ + 2 + data <= longest - checksum_size; }
  void finish() noexcept {
    if (room_.empty() || size_ == header_size) return;
    room_[3] = static_cast<std::byte>(size_ - header_size);
    for (const std::uint8_t sum : checksum_of(room_.first(size_))) put(sum);
    out_.push(size_);
  }

 private:
  FrameBuffer& out_;
  std::span<std::byte> room_;
  std::size_t size_ = 0, field_ = 0;
};

// Takes numbers from a field's data; zeros when there are no more.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}
  template <class Number>
  Number take() noexcept {
    if constexpr (std::is_same_v<Number, float>) return std::bit_cast<float>(take<std::uint32_t>());
    else {
      Number number = 0;
      is_whole_ = is_whole_ && rest_.size() >= sizeof number;
      if (!is_whole_) return 0;
      std::memcpy(&number, rest_.data(), sizeof number);
      rest_ = rest_.subspan(sizeof number);
      return boost::endian::big_to_native(number);
    }
  }
  bool is_whole() const noexcept { return is_whole_; }       // nothing was missing
  bool is_done() const noexcept { return is_whole_ && rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
  bool is_whole_ = true;
};

// How long the packet is that these bytes begin with; nullopt: none; more than there are: not all there yet.
std::optional<std::size_t> packet_size(std::span<const std::byte> held) noexcept {
  for (std::size_t i = 0; i < std::min<std::size_t>(held.size(), 2); ++i)
    if (held[i] != std::byte{sync[i]}) return std::nullopt;
  if (held.size() < header_size) return header_size;
  return header_size + std::to_integer<std::size_t>(held[3]) + checksum_size;
}
bool is_intact(std::span<const std::byte> packet) noexcept {
  const auto sums = checksum_of(packet.first(packet.size() - checksum_size));
  return packet[packet.size() - 2] == std::byte{sums[0]} && packet[packet.size() - 1] == std::byte{sums[1]};
}
// Calls `act(descriptor, data)` for each field. False if they do not fill the packet.
template <class Act>
bool for_each_field(std::span<const std::byte> packet, Act&& act) {
  std::span<const std::byte> rest = packet.subspan(header_size, packet.size() - header_size - checksum_size);
  while (rest.size() >= 2) {
    const auto length = std::to_integer<std::size_t>(rest[0]);
    if (length < 2 || length > rest.size()) return false;
    act(std::to_integer<std::uint8_t>(rest[1]), rest.subspan(2, length - 2));
    rest = rest.subspan(length);
  }
  return rest.empty();
}

// What is streamed of a descriptor set.
struct Stream {
  struct Rate {
    std::uint8_t descriptor = 0;
    std::uint16_t decimation = 1;
  };
  std::uint8_t set = 0;
  std::uint16_t base_hz = 0;
  bool enabled = true;
  std::uint8_t count = 0;
  std::array<Rate, 32> format = {};

  void add(std::uint8_t descriptor, std::uint16_t decimation) noexcept {
    if (count < format.size()) format[count++] = {descriptor, decimation};
  }
};
struct Configuration {
  std::array<Stream, 2> streams;  // sensor, filter
  std::uint32_t baud = 115200;
};

struct Model {
  std::string_view keyword, name, number, options;
  std::uint16_t filter_hz, filter_state;  // GX5: running, solution valid; CV7: AHRS
  double gyro_max, accelerometer_max_g;  // rad/s
  double gyro_noise, accelerometer_noise;  // rad/s/sqrt(Hz), m/s^2/sqrt(Hz)
};
// Densities: 0.005 deg/s/sqrt(Hz) and 80 ug/sqrt(Hz); 0.17 deg/sqrt(h) and 0.03 m/s/sqrt(h).
constexpr Model models[] = {
    {"3dm-gx5-25", "3DM-GX5-25", "6254-4220", "8g, 300d/s", 500, 2, 300 * units::degree, 8, 0.005 * units::degree,
     80e-6 * units::standard_gravity},
    {"3dm-cv7-ahrs", "3DM-CV7-AHRS", "6286-9968", "8g, 500d/s", 1000, 3, 500 * units::degree, 8, 0.17 / 60 * units::degree,
     0.03 / 60},
};

class MipDevice final : public Device {
 public:
  MipDevice(const Model& model, const Configuration& configuration) noexcept
      : model_(model), factory_(configuration), stored_(configuration), active_(configuration) {}

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    sample_ = sample;
    delta_angle_ += sample.delta_angle;
    delta_velocity_ += sample.delta_velocity;
    for (std::size_t i = 0; i < active_.streams.size(); ++i) {
      const Stream& stream = active_.streams[i];
      if (idle_ || !stream.enabled || stream.count == 0) continue;
      const auto divisor = static_cast<std::uint64_t>(internal_hz) / stream.base_hz;
      if (sample.counter % divisor != 0) continue;
      Packet packet(out, stream.set);
      for (std::size_t k = 0; k < stream.count; ++k)
        if (sample.counter / divisor % stream.format[k].decimation == 0) put_field(packet, i, stream.format[k].descriptor);
      packet.finish();
    }
  }

  void receive(const Frame& from_host, FrameBuffer& replies) noexcept override {
    constexpr Nanoseconds patience = std::chrono::milliseconds(500);
    if (sample_.time - heard_ > patience) search_.finish();
    heard_ = sample_.time;
    search_.feed(from_host.bytes, [&](std::span<const std::byte> held) -> std::size_t {
      const auto size = packet_size(held);
      if (!size) return Search::reject;
      if (held.size() < *size) return Search::need_more;
      if (!is_intact(held.first(*size))) return Search::reject;
      answer(held.first(*size), replies);
      return *size;
    });
  }

  void restart() noexcept override {
    active_ = stored_;
    idle_ = false;
  }
  LineSettings line() const noexcept override { return {active_.baud}; }

 private:
  using Search = FrameSearch<longest>;

  void put_field(Packet& packet, std::size_t stream, std::uint8_t descriptor) noexcept {
    const std::uint8_t set = active_.streams[stream].set;
    const DataField* field = find_field(set, descriptor);
    if (field == nullptr || !packet.has_room_for(field->size)) return;
    packet.begin(descriptor);
    const std::uint64_t time_ns = static_cast<std::uint64_t>(sample_.time.ns);
    const double time_s = 1e-9 * static_cast<double>(sample_.time.ns);
    const Quaternion& q = sample_.q_LP;
    const auto put_quaternion = [&] {  // v_P = q* v_N q
      for (const double part : {q.w(), q.x(), q.y(), q.z()}) packet.put(to_float(part));
    };
    const auto put_gps_time = [&] {  // of the week that the device time is in
      constexpr double week_s = 604'800;
      packet.put(time_s - week_s * std::floor(time_s / week_s));
      packet.put(static_cast<std::uint16_t>(std::floor(time_s / week_s)));
      packet.put(std::uint16_t{0});  // not valid: no GNSS
    };
    if (descriptor >= 0xD0) {
      std::uint64_t& last_ns = last_ns_[stream];
      switch (descriptor) {
        case 0xD0: packet.put(std::uint8_t{0}); break;
        case 0xD1: packet.put(static_cast<std::uint32_t>(sample_.counter)); break;
        case 0xD2: packet.put(static_cast<std::uint32_t>(sample_.counter - std::exchange(last_tick_, sample_.counter))); break;
        case 0xD3: put_gps_time(); break;
        case 0xD4: packet.put(1e-9 * static_cast<double>(time_ns - std::exchange(last_ns, time_ns))); break;
        case 0xD5: packet.put(time_ns); break;
        default: packet.put(time_ns - std::exchange(last_ns, time_ns)); break;
      }
    } else if (set == sensor) {
      switch (descriptor) {
        case 0x04: packet.put(Vector3(sample_.specific_force / units::standard_gravity)); break;
        case 0x05: packet.put(sample_.rate); break;
        case 0x07: packet.put(std::exchange(delta_angle_, Vector3::Zero())); break;
        case 0x08: packet.put(Vector3(std::exchange(delta_velocity_, Vector3::Zero()) / units::standard_gravity)); break;
        case 0x0A: put_quaternion(); break;
        case 0x0C: packet.put(roll_pitch_yaw(q)); break;
        case 0x12: put_gps_time(); break;
        case 0x14:
          for (int i = 0; i < 3; ++i) packet.put(to_float(sample_.temperature_c));
          break;
        default:
          packet.put(static_cast<std::uint16_t>((sample_.status & 7U) << 4 | (sample_.status >> 3 & 7U)));
          break;
      }
    } else {
      switch (descriptor) {
        case 0x03:
          put_quaternion();
          packet.put(std::uint16_t{1});
          break;
        case 0x05:
          packet.put(roll_pitch_yaw(q));
          packet.put(std::uint16_t{1});
          break;
        case 0x10:
          packet.put(model_.filter_state);
          packet.put(std::uint16_t{1});
          packet.put(std::uint16_t{0});
          break;
        default: put_gps_time(); break;
      }
    }
    packet.end();
  }

  // 3-2-1 from N to P.
  static Vector3 roll_pitch_yaw(const Quaternion& q) noexcept {
    const Vector3 ypr = yaw_pitch_roll_from_dcm(q.conjugate().toRotationMatrix());
    return {ypr[2], ypr[1], ypr[0]};
  }

  void answer(std::span<const std::byte> packet, FrameBuffer& replies) noexcept {
    const auto set = std::to_integer<std::uint8_t>(packet[2]);
    polled_ = 0;
    bool acknowledges = true;
    {
      Packet answer(replies, set);
      for_each_field(packet, [&](std::uint8_t command, std::span<const std::byte> data) {
        if (!answer.has_room_for(2)) return;
        answer.begin(reply);
        answer.put(command);
        const std::size_t at = answer.size();
        answer.put(std::uint8_t{ok});
        answer.end();
        Reader reader(data);
        const Code code = set == base ? obey_base(command, reader, answer)
                          : set == three_dm ? obey_3dm(command, reader, answer, acknowledges)
                                            : unknown_command;
        answer.set_byte(at, code);
      });
      if (acknowledges) answer.finish();
    }
    if (polled_ == 0) return;
    const std::size_t stream = polled_set_ == sensor ? 0 : 1;
    Packet data(replies, polled_set_);
    for (std::size_t i = 0; i < polled_; ++i) put_field(data, stream, poll_[i]);
    data.finish();
  }

  Code obey_base(std::uint8_t command, Reader& reader, Packet& answer) noexcept {
    switch (command) {
      case 0x01: return ok;
      case 0x02: idle_ = true; return ok;
      case 0x03:
        answer.begin(0x81);
        answer.put(std::uint16_t{1100});
        for (const std::string_view text : {model_.name, model_.number, std::string_view("6254.123456"),
                                            std::string_view("I2Q"), model_.options})
          answer.put_text(text, 16);
        answer.end();
        return ok;
      case 0x04:
      case 0x07:
        answer.begin(command == 0x04 ? 0x82 : 0x86);
        if (command == 0x04) put_descriptors(answer);
        answer.end();
        return ok;
      case 0x05:
        answer.begin(0x83);
        answer.put(std::uint32_t{0});
        answer.end();
        return ok;
      case 0x06: idle_ = false; return ok;
      case 0x08:
        answer.begin(0x88);
        for (int i = 0; i < 16; ++i) answer.put(std::uint8_t{0});
        answer.end();
        return ok;
      case 0x09: {
        const auto function = reader.take<std::uint8_t>();
        const auto port = reader.take<std::uint8_t>();
        if (port > 1) return bad_parameter;
        return baud(function, reader, answer, 0x89, true);
      }
      case 0x72: return ok;
      case 0x7E: restart(); return ok;
      default: return unknown_command;
    }
  }

  Code baud(std::uint8_t function, Reader& reader, Packet& answer, std::uint8_t descriptor, bool with_port) noexcept {
    constexpr std::array<std::uint32_t, 6> known = {9600, 19200, 115200, 230400, 460800, 921600};
    std::uint32_t wanted = active_.baud;
    switch (function) {
      case write: wanted = reader.take<std::uint32_t>(); break;
      case read: break;
      case save: stored_.baud = active_.baud; break;
      case load: wanted = stored_.baud; break;
      case to_default: wanted = factory_.baud; break;
      default: return bad_parameter;
    }
    if (!reader.is_done() || std::find(known.begin(), known.end(), wanted) == known.end()) return bad_parameter;
    active_.baud = wanted;
    if (function != read) return ok;
    answer.begin(descriptor);
    if (with_port) answer.put(std::uint8_t{1});
    answer.put(active_.baud);
    answer.end();
    return ok;
  }

  Code obey_3dm(std::uint8_t command, Reader& reader, Packet& answer, bool& acknowledges) noexcept {
    switch (command) {
      case 0x01: return poll(sensor, true, reader, acknowledges);
      case 0x03: return poll(filter, true, reader, acknowledges);
      case 0x0D: return poll(reader.take<std::uint8_t>(), false, reader, acknowledges);
      case 0x06: return base_rate(sensor, 0x83, answer, false);
      case 0x0B: return base_rate(filter, 0x8A, answer, false);
      case 0x0E: return base_rate(reader.take<std::uint8_t>(), 0x8E, answer, true);
      case 0x08: return format(reader.take<std::uint8_t>(), sensor, 0x80, reader, answer, false);
      case 0x0A: return format(reader.take<std::uint8_t>(), filter, 0x82, reader, answer, false);
      case 0x0F: {
        const auto function = reader.take<std::uint8_t>();
        return format(function, reader.take<std::uint8_t>(), 0x8F, reader, answer, true);
      }
      case 0x11: return stream_control(reader, answer);
      case 0x30: {
        const auto function = reader.take<std::uint8_t>();
        if (!reader.is_done()) return bad_parameter;
        if (function == save) stored_ = active_;
        else if (function == load) active_ = stored_;
        else if (function == to_default) active_ = factory_;
        else return bad_parameter;
        return ok;
      }
      case 0x40: {
        const auto function = reader.take<std::uint8_t>();
        return baud(function, reader, answer, 0x87, false);
      }
      default: return unknown_command;
    }
  }

  template <class Any>  // const or not
  static auto find(Any& configuration, std::uint8_t set) noexcept -> decltype(configuration.streams.data()) {
    for (auto& stream : configuration.streams)
      if (stream.set == set) return &stream;
    return nullptr;
  }

  Code poll(std::uint8_t set, bool with_rates, Reader& reader, bool& acknowledges) noexcept {
    const bool suppress = reader.take<std::uint8_t>() != 0;
    const auto count = reader.take<std::uint8_t>();
    const Stream* stream = find(active_, set);
    if (stream == nullptr || !reader.is_whole() || count > poll_.size()) return bad_parameter;
    for (std::size_t i = 0; i < count; ++i) {
      poll_[i] = reader.take<std::uint8_t>();
      if (with_rates) reader.take<std::uint16_t>();
      if (find_field(set, poll_[i]) == nullptr) return bad_parameter;
    }
    if (!reader.is_done()) return bad_parameter;
    polled_set_ = set;
    polled_ = count;
    if (count == 0)  // as it is streamed
      for (; polled_ < stream->count; ++polled_) poll_[polled_] = stream->format[polled_].descriptor;
    if (suppress) acknowledges = false;
    return ok;
  }

  Code base_rate(std::uint8_t set, std::uint8_t descriptor, Packet& answer, bool with_set) noexcept {
    const Stream* stream = find(active_, set);
    if (stream == nullptr) return bad_parameter;
    answer.begin(descriptor);
    if (with_set) answer.put(set);
    answer.put(stream->base_hz);
    answer.end();
    return ok;
  }

  Code format(std::uint8_t function, std::uint8_t set, std::uint8_t descriptor, Reader& reader, Packet& answer,
              bool with_set) noexcept {
    Stream *active = find(active_, set), *stored = find(stored_, set);
    const Stream* factory = find(factory_, set);
    if (active == nullptr || !reader.is_whole()) return bad_parameter;
    switch (function) {
      case write: {
        Stream wanted = *active;
        wanted.count = 0;
        const auto count = reader.take<std::uint8_t>();
        if (count > wanted.format.size()) return bad_parameter;
        for (unsigned i = 0; i < count; ++i) {
          const auto field = reader.take<std::uint8_t>();
          const auto decimation = reader.take<std::uint16_t>();
          if (find_field(set, field) == nullptr || decimation == 0) return bad_parameter;
          wanted.add(field, decimation);
        }
        if (!reader.is_done()) return bad_parameter;
        *active = wanted;
        return ok;
      }
      case read:
        answer.begin(descriptor);
        if (with_set) answer.put(set);
        answer.put(active->count);
        for (std::size_t i = 0; i < active->count; ++i) {
          answer.put(active->format[i].descriptor);
          answer.put(active->format[i].decimation);
        }
        answer.end();
        return ok;
      case save: *stored = *active; return ok;
      case load: *active = *stored; return ok;
      case to_default: *active = *factory; return ok;
      default: return bad_parameter;
    }
  }

  Code stream_control(Reader& reader, Packet& answer) noexcept {
    const auto function = reader.take<std::uint8_t>();
    auto set = reader.take<std::uint8_t>();
    if (set == 0x01) set = sensor;  // as older devices number them
    if (set == 0x03) set = filter;
    Stream *active = find(active_, set), *stored = find(stored_, set);
    if (active == nullptr) return bad_parameter;
    switch (function) {
      case write: {
        const auto enable = reader.take<std::uint8_t>();
        if (!reader.is_done() || enable > 1) return bad_parameter;
        active->enabled = enable != 0;
        return ok;
      }
      case read:
        answer.begin(0x85);
        answer.put(set);
        answer.put(static_cast<std::uint8_t>(active->enabled));
        answer.end();
        return ok;
      case save: stored->enabled = active->enabled; return ok;
      case load: active->enabled = stored->enabled; return ok;
      case to_default: active->enabled = find(factory_, set)->enabled; return ok;
      default: return bad_parameter;
    }
  }

  static void put_descriptors(Packet& answer) noexcept {
    for (const int command : {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x72, 0x7E})
      answer.put(static_cast<std::uint16_t>(base << 8 | command));
    for (const int command : {0x01, 0x03, 0x06, 0x08, 0x0A, 0x0B, 0x0D, 0x0E, 0x0F, 0x11, 0x30, 0x40})
      answer.put(static_cast<std::uint16_t>(three_dm << 8 | command));
    for (const DataField& field : data_fields) answer.put(static_cast<std::uint16_t>(field.set << 8 | field.descriptor));
  }

  const Model& model_;
  const Configuration factory_;
  Configuration stored_, active_;
  bool idle_ = false;
  Sample sample_;  // the newest
  Vector3 delta_angle_ = Vector3::Zero(), delta_velocity_ = Vector3::Zero();  // since they were sent last
  std::array<std::uint64_t, 2> last_ns_ = {};                                // of the streams' time differences
  std::uint64_t last_tick_ = 0;
  std::array<std::uint8_t, 32> poll_ = {};
  std::size_t polled_ = 0;
  std::uint8_t polled_set_ = sensor;
  DeviceTime heard_;
  Search search_;
};

// Of sensor data packets.
class MipDecoder final : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) override {
    errors_.skipped_bytes +=
        search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return judge(held, sink); });
  }
  void finish(MeasurementSink&) override { errors_.skipped_bytes += search_.finish(); }

 private:
  using Search = FrameSearch<longest>;

  std::size_t judge(std::span<const std::byte> held, MeasurementSink& sink) {
    const auto size = packet_size(held);
    if (!size) return Search::reject;
    if (held.size() < *size) return Search::need_more;
    const std::span<const std::byte> packet = held.first(*size);
    if (!is_intact(packet)) {
      ++errors_.checksum;
      return Search::reject;
    }
    if (packet[2] != std::byte{sensor}) return *size;
    Measurement measurement;
    Sample& sample = measurement.sample;
    bool is_finite = true;
    const bool is_good = for_each_field(packet, [&](std::uint8_t descriptor, std::span<const std::byte> data) {
      const DataField* field = find_field(sensor, descriptor);
      if (field == nullptr || data.size() != field->size) return;
      Reader reader(data);
      const auto vector = [&](double unit, Measurement::Field carried) {
        measurement.fields |= carried;
        Vector3 v;
        for (int i = 0; i < 3; ++i) v[i] = unit * static_cast<double>(reader.take<float>());
        is_finite = is_finite && v.allFinite();
        return v;
      };
      switch (descriptor) {
        case 0x04: sample.specific_force = vector(units::standard_gravity, Measurement::specific_force); break;
        case 0x05: sample.rate = vector(1, Measurement::rate); break;
        case 0x07: sample.delta_angle = vector(1, Measurement::delta_angle); break;
        case 0x08: sample.delta_velocity = vector(units::standard_gravity, Measurement::delta_velocity); break;
        case 0x14: sample.temperature_c = vector(1, Measurement::temperature)[2]; break;
        case 0x18: {
          const unsigned bits = reader.take<std::uint16_t>();
          sample.status = (bits >> 4 & 7U) | (bits & 7U) << 3;
          measurement.fields |= Measurement::status;
          break;
        }
        case 0xD5:
          sample.time.ns = static_cast<std::int64_t>(reader.take<std::uint64_t>());
          measurement.fields |= Measurement::time;
          break;
        default: break;
      }
    });
    if (!is_good || !is_finite)
      ++errors_.malformed;
    else if (measurement.fields != 0)
      sink.on_measurement(measurement);
    return *size;
  }

  Search search_;
};

constexpr std::array<std::string_view, 2> model_names = {models[0].keyword, models[1].keyword};
constexpr std::array<std::string_view, 7> sensor_defaults = {"reference_time", "acceleration", "rate",     "delta_angle",
                                                             "delta_velocity", "temperature",  "overrange"};
constexpr std::array<std::string_view, 3> filter_defaults = {"filter_reference_time", "filter_status", "filter_euler"};
constexpr Setting declared[] = {
    {.key = "model", .help = "which device", .initial = models[0].keyword, .choices = model_names},
    {.key = "sensor_rate_hz", .help = "of the sensor data; a divisor of 1000", .initial = std::int64_t{100}, .min = 1, .max = 1000},
    {.key = "sensor_fields", .help = "what is streamed", .initial = std::span<const std::string_view>(sensor_defaults)},
    {.key = "filter_rate_hz", .help = "of the filter data; a divisor of its base rate", .initial = std::int64_t{10}, .min = 1,
     .max = 1000},
    {.key = "filter_fields", .help = "what is streamed", .initial = std::span<const std::string_view>(filter_defaults)},
    {.key = "baud", .help = "bit/s", .initial = std::int64_t{115200}, .min = 9600, .max = 921600},
};

const Model& model_of(const Settings& settings) {
  return settings.text("model") == models[0].keyword ? models[0] : models[1];
}

Configuration configuration(const Settings& settings) {
  Configuration c;
  c.baud = static_cast<std::uint32_t>(settings.integer("baud"));
  const auto fill = [&](Stream& stream, std::uint8_t set, std::uint16_t base_hz, const char* rate, const char* fields) {
    stream.set = set;
    stream.base_hz = base_hz;
    const std::int64_t hz = settings.integer(rate);
    if (hz > base_hz || base_hz % hz != 0)
      throw std::invalid_argument(std::string(rate) + ": give a divisor of " + std::to_string(base_hz));
    for (const std::string& name : settings.list(fields)) {
      const auto* field = std::find_if(std::begin(data_fields), std::end(data_fields),
                                       [&](const DataField& f) { return f.set == set && f.name == name; });
      if (field == std::end(data_fields)) {
        std::string known;
        for (const DataField& f : data_fields)
          if (f.set == set) known += " " + std::string(f.name);
        throw std::invalid_argument(std::string(fields) + ": there is no \"" + name + "\"; known:" + known);
      }
      stream.add(field->descriptor, static_cast<std::uint16_t>(base_hz / hz));
    }
  };
  fill(c.streams[0], sensor, 1000, "sensor_rate_hz", "sensor_fields");
  fill(c.streams[1], filter, model_of(settings).filter_hz, "filter_rate_hz", "filter_fields");
  return c;
}

Product product(const Settings& settings) {
  const Model& model = model_of(settings);
  Product product;
  product.rate_hz = internal_hz;
  product.gyro.max = model.gyro_max;
  product.gyro.walk_transition.setZero();
  product.gyro.walk_sqrt_cov = model.gyro_noise * std::sqrt(internal_hz) * Matrix3::Identity();
  product.accelerometer.max = model.accelerometer_max_g * units::standard_gravity;
  product.accelerometer.walk_transition.setZero();
  product.accelerometer.walk_sqrt_cov = model.accelerometer_noise * std::sqrt(internal_hz) * Matrix3::Identity();
  return product;
}

}  // namespace

extern const Protocol mip_protocol;
constexpr Protocol mip_protocol = {
    .name = "mip",
    .summary = "MicroStrain 3DM-GX5-25 and 3DM-CV7-AHRS: MIP commands, sensor and filter data",
    .link = Link::bytes,
    .document = "mip_sdk e5a847d, src/c/mip/definitions",
    .settings = declared,
    .fields = Measurement::time | Measurement::rate | Measurement::specific_force | Measurement::delta_angle |
              Measurement::delta_velocity | Measurement::temperature | Measurement::status,
    .resolution = {.rate = 0x1p-21, .specific_force = 0x1p-20 * units::standard_gravity, .delta_angle = 0x1p-24,
                   .delta_velocity = 0x1p-24 * units::standard_gravity, .temperature_c = 0x1p-17},
    .range = {.rate = 8, .specific_force = 15.99 * units::standard_gravity, .delta_angle = 1,
              .delta_velocity = 0.99 * units::standard_gravity, .temperature_c = 128},
    .counter_bits = 0,
    .status_bits = 0x3F,
    .has_checksum = true,
    .burst_bits = 8,
    .product = product,
    .trial = "sensor_rate_hz=1000 filter_fields=",
    .make = [](const Settings& settings) -> std::unique_ptr<Device> {
      return std::make_unique<MipDevice>(model_of(settings), configuration(settings));
    },
    .make_decoder = [](const Settings&) -> std::unique_ptr<Decoder> { return std::make_unique<MipDecoder>(); },
};

}  // namespace imud
