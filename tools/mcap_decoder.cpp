// Reads MCAP, Foxglove's container of messages (mcap.dev/spec, version 0): imud's JSON, and ROS 2's
// sensor_msgs/msg/Imu.
#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <array>
#include <boost/endian/conversion.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "tools/log_formats.hpp"

namespace imud {

extern const Protocol mcap_format;

namespace {

[[noreturn]] void refuse_mcap(const std::string& fault) { throw std::runtime_error("mcap: " + fault); }

// The fields of a record, one after another. After one that lies behind the end, has_ended() is true and all are 0.
class McapFields {
 public:
  explicit McapFields(std::string_view bytes) : rest_(bytes) {}
  template <typename T>
  T number() {
    const std::string_view bytes = take(sizeof(T));
    if (bytes.empty()) return 0;
    return boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(
        reinterpret_cast<const unsigned char*>(bytes.data()));
  }
  std::string_view text() { return take(number<std::uint32_t>()); }
  std::string_view long_bytes() { return take(number<std::uint64_t>()); }
  std::string_view rest() const noexcept { return rest_; }
  bool has_ended() const noexcept { return has_ended_; }

 private:
  std::string_view take(std::uint64_t size) {
    has_ended_ = has_ended_ || size > rest_.size();
    if (has_ended_) return {};
    const std::string_view bytes = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return bytes;
  }

  std::string_view rest_;
  bool has_ended_ = false;
};

// The Common Data Representation of a ROS 2 message (DDS-XTypes 7.4.3.4, XCDR1): four bytes of encapsulation, then
// values at multiples of their size.
class CdrFields {
 public:
  explicit CdrFields(std::string_view bytes) : bytes_(bytes) {
    is_good_ = bytes.size() >= 4 && bytes[0] == 0 && (bytes[1] == 0 || bytes[1] == 1);
    is_little_ = is_good_ && bytes[1] == 1;
  }
  template <typename T>
  T number() {
    at_ = 4 + (at_ - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    is_good_ = is_good_ && at_ + sizeof(T) <= bytes_.size();
    if (!is_good_) return 0;
    const auto* from = reinterpret_cast<const unsigned char*>(bytes_.data() + at_);
    at_ += sizeof(T);
    return is_little_ ? boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(from)
                      : boost::endian::endian_load<T, sizeof(T), boost::endian::order::big>(from);
  }
  void skip_text() {
    const auto size = number<std::uint32_t>();
    is_good_ = is_good_ && size <= bytes_.size() - at_;
    if (is_good_) at_ += size;
  }
  bool is_good() const noexcept { return is_good_; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 4;
  bool is_good_ = false, is_little_ = false;
};

// Reads sensor_msgs/msg/Imu: header, orientation, angular_velocity and linear_acceleration, each with its covariance,
// whose first element is -1 where the quantity is not measured. Returns false if it is none.
bool read_ros_imu(std::string_view bytes, Measurement& out) {
  CdrFields fields(bytes);
  const std::int64_t seconds = fields.number<std::int32_t>(), nanoseconds = fields.number<std::uint32_t>();
  fields.skip_text();
  const auto skip = [&](int count) {
    for (int i = 0; i < count; ++i) fields.number<double>();
  };
  skip(4 + 9);
  for (const auto& [bit, value] : {std::pair{Measurement::rate, &Sample::rate},
                                   std::pair{Measurement::specific_force, &Sample::specific_force}}) {
    for (double& axis : out.sample.*value) axis = fields.number<double>();
    if (fields.number<double>() != -1 && (out.sample.*value).allFinite()) out.fields |= bit;
    skip(8);
  }
  out.sample.time = DeviceTime{seconds * 1'000'000'000 + nanoseconds};
  out.fields |= Measurement::time;
  return fields.is_good();
}

// Reads what imu-decode --mcap writes. Returns false if it is none.
bool read_imud_json(std::string_view text, std::uint64_t log_time, Measurement& out) {
  const auto object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object()) return false;
  Sample& sample = out.sample;
  const auto integer = [&](const char* name, std::uint32_t bit, auto& value) {
    const auto found = object.find(name);
    if (found == object.end() || !found->is_number_integer()) return;
    value = found->get<std::remove_reference_t<decltype(value)>>();
    out.fields |= bit;
  };
  std::int64_t time_ns = static_cast<std::int64_t>(log_time);
  integer("time_ns", Measurement::time, time_ns);
  sample.time = DeviceTime{time_ns};
  out.fields |= Measurement::time;
  integer("counter", Measurement::counter, sample.counter);
  integer("status", Measurement::status, sample.status);
  if (const auto found = object.find("temperature"); found != object.end() && found->is_number()) {
    sample.temperature_c = found->get<double>();
    out.fields |= Measurement::temperature;
  }
  constexpr std::array<const char*, 3> axes{"x", "y", "z"};
  const auto vector = [&](const char* name, std::uint32_t bit, Vector3& value) {
    const auto found = object.find(name);
    if (found == object.end() || !found->is_object()) return;
    for (std::size_t axis = 0; axis < axes.size(); ++axis)
      if (const auto one = found->find(axes[axis]); one != found->end() && one->is_number())
        value[static_cast<Eigen::Index>(axis)] = one->get<double>();
    out.fields |= bit;
  };
  vector("gyro", Measurement::rate, sample.rate);
  vector("accel", Measurement::specific_force, sample.specific_force);
  vector("dtheta", Measurement::delta_angle, sample.delta_angle);
  vector("dvel", Measurement::delta_velocity, sample.delta_velocity);
  if (const auto found = object.find("fields"); found != object.end() && found->is_number_unsigned())
    out.fields &= found->get<std::uint32_t>() | Measurement::time;
  return true;
}

class McapDecoder final : public Decoder {
 public:
  explicit McapDecoder(const Settings& settings) : topic_(settings.text("topic")) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    held_.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    constexpr std::string_view magic("\x89MCAP0\r\n", 8);
    std::size_t at = 0;
    if (!has_begun_) {
      if (held_.size() < magic.size()) return;
      if (!held_.starts_with(magic)) refuse_mcap("this is no MCAP file of version 0");
      has_begun_ = true;
      at = magic.size();
    }
    at += read_records(std::string_view(held_).substr(at), sink);
    held_.erase(0, has_ended_ ? held_.size() : at);
  }

  void finish(MeasurementSink&) override {
    if (!has_begun_) refuse_mcap("the file ends within its magic");
    if (!chosen_ && errors_.checksum + errors_.malformed == 0)
      refuse_mcap(topic_.empty()
                      ? "it has no channel of imud's JSON (imu-decode --mcap) or of sensor_msgs/msg/Imu by cdr"
                      : fmt::format("it has no such channel with the topic {}", topic_));
    if (!held_.empty()) ++errors_.malformed;
    errors_.skipped_bytes += held_.size();
  }

 private:
  enum class Encoding { imud_json, ros_imu };
  struct Channel {
    std::uint16_t number;
    Encoding encoding;
  };
  static constexpr std::uint64_t longest_record = std::uint64_t{1} << 30U;
  static constexpr std::size_t header_size = 9;  // opcode and length

  // Reads whole records. Returns how many bytes they have.
  std::size_t read_records(std::string_view bytes, MeasurementSink& sink) {
    std::size_t at = 0;
    while (!has_ended_ && bytes.size() - at >= header_size) {
      McapFields header(bytes.substr(at + 1, 8));
      const auto size = header.number<std::uint64_t>();
      if (size > longest_record) refuse_mcap("a record of more than 1 GiB; the file is damaged");
      if (bytes.size() - at - header_size < size) break;
      read_record(bytes[at], bytes.substr(at + header_size, size), sink);
      at += header_size + size;
    }
    return at;
  }

  void read_record(char opcode, std::string_view body, MeasurementSink& sink) {
    McapFields fields(body);
    if (opcode == 3) {
      const auto number = fields.number<std::uint16_t>();
      schemas_[number] = fields.text();
    } else if (opcode == 4) {
      read_channel(fields);
    } else if (opcode == 5) {
      read_message(fields, sink);
    } else if (opcode == 6 && !is_in_chunk_) {
      read_chunk(fields, sink);
    } else if (opcode == 15) {
      has_ended_ = true;  // the summary repeats what came before
    }
    if (fields.has_ended()) ++errors_.malformed;
  }

  void read_channel(McapFields& fields) {
    const auto number = fields.number<std::uint16_t>(), schema = fields.number<std::uint16_t>();
    const std::string_view topic = fields.text(), encoding = fields.text();
    if (chosen_ || (!topic_.empty() && topic != topic_)) return;
    const std::string& name = schemas_[schema];
    if (encoding == "json" && name == "imud.Measurement") chosen_ = {number, Encoding::imud_json};
    if (encoding == "cdr" && name == "sensor_msgs/msg/Imu") chosen_ = {number, Encoding::ros_imu};
  }

  void read_message(McapFields& fields, MeasurementSink& sink) {
    const auto channel = fields.number<std::uint16_t>();
    if (!chosen_ || channel != chosen_->number) return;
    fields.number<std::uint32_t>();
    const auto log_time = fields.number<std::uint64_t>();
    fields.number<std::uint64_t>();
    Measurement measurement;
    const bool is_good = !fields.has_ended() && (chosen_->encoding == Encoding::ros_imu
                                                     ? read_ros_imu(fields.rest(), measurement)
                                                     : read_imud_json(fields.rest(), log_time, measurement));
    if (is_good)
      sink.on_measurement(measurement);
    else
      ++errors_.malformed;
  }

  void read_chunk(McapFields& fields, MeasurementSink& sink) {
    fields.number<std::uint64_t>();
    fields.number<std::uint64_t>();
    const auto size = fields.number<std::uint64_t>();
    const auto crc = fields.number<std::uint32_t>();
    const std::string_view compression = fields.text();
    std::string_view content = fields.long_bytes();
    if (fields.has_ended()) return;
    std::string whole;
    if (compression == "zstd") {
      if (size > longest_record) refuse_mcap("a chunk of more than 1 GiB; the file is damaged");
      whole.resize(size);
      if (ZSTD_decompress(whole.data(), whole.size(), content.data(), content.size()) != size)
        return void(++errors_.checksum);
      content = whole;
    } else if (!compression.empty()) {
      refuse_mcap(fmt::format("its chunks are compressed by {}; right would be zstd or none", compression));
    }
    if (crc != 0 && ::crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()) != crc)
      return void(++errors_.checksum);
    is_in_chunk_ = true;
    if (read_records(content, sink) != content.size()) ++errors_.malformed;
    is_in_chunk_ = false;
  }

  const std::string topic_;
  std::string held_;
  bool has_begun_ = false, has_ended_ = false, is_in_chunk_ = false;
  std::map<std::uint16_t, std::string> schemas_;  // names
  std::optional<Channel> chosen_;
};

constexpr Setting mcap_settings[] = {
    {.key = "topic", .help = "topic of the channel; default: the first that fits", .initial = std::string_view()}};

}  // namespace

constexpr Protocol mcap_format = {
    .name = "mcap",
    .summary = "MCAP: what --mcap writes, or a recording of ROS 2 with sensor_msgs/msg/Imu: file:BAG.mcap",
    .link = Link::bytes,
    .document = "mcap.dev/spec, version 0",
    .settings = mcap_settings,
    .has_checksum = true,
    .make_decoder = [](const Settings& settings) -> std::unique_ptr<Decoder> {
      return std::make_unique<McapDecoder>(settings);
    },
};

}  // namespace imud
