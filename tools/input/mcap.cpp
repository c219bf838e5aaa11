// Reads the measurements of MCAP: imud's JSON, and ROS 2's sensor_msgs/msg/Imu.
#include <fmt/format.h>

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tools/input/log_formats.hpp"
#include "tools/input/mcap_reader.hpp"

namespace imud {

namespace {

// Reads sensor_msgs/msg/Imu: header, orientation, angular_velocity and linear_acceleration, each with its covariance,
// whose first element is -1 where the quantity is not measured. Returns false if it is none.
bool read_ros_imu(std::string_view bytes, Measurement& out) {
  CdrFields fields(bytes);
  out.sample.time = DeviceTime{fields.header_ns()};
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
  out.fields |= Measurement::time;
  return fields.is_good();
}

// Reads the JSON of imu-decode --mcap. Returns false if the text is no such JSON.
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
    value.setConstant(std::numeric_limits<double>::quiet_NaN());
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

class McapDecoder final : public Decoder, private McapReader {
 public:
  explicit McapDecoder(const Settings& settings) : topic_(settings.text("topic")) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    sink_ = &sink;
    read(frame.bytes);
    const Damage damage = take_damage();
    errors_.malformed += damage.malformed;
    errors_.checksum += damage.checksum;
  }

  void finish(MeasurementSink&) override {
    const std::size_t cut_short = end();
    if (!chosen_ && errors_.checksum + errors_.malformed == 0)
      refuse(topic_.empty() ? "it has no channel of imud's JSON (imu-decode --mcap) or of sensor_msgs/msg/Imu by cdr"
                            : fmt::format("it has no such channel with the topic {}", topic_));
    if (cut_short > 0) ++errors_.malformed;
    errors_.skipped_bytes += cut_short;
  }

 private:
  enum class Encoding { imud_json, ros_imu };
  struct Channel {
    std::uint16_t number;
    Encoding encoding;
  };

  void on_channel(std::uint16_t number, std::string_view schema, std::string_view topic,
                  std::string_view encoding) override {
    if (chosen_ || (!topic_.empty() && topic != topic_)) return;
    if (encoding == "json" && schema == "imud.Measurement") chosen_ = {number, Encoding::imud_json};
    if (encoding == "cdr" && schema == "sensor_msgs/msg/Imu") chosen_ = {number, Encoding::ros_imu};
  }

  void on_message(std::uint16_t channel, std::uint64_t log_time_ns, std::string_view data) override {
    if (!chosen_ || channel != chosen_->number) return;
    Measurement measurement;
    if (chosen_->encoding == Encoding::ros_imu ? read_ros_imu(data, measurement)
                                               : read_imud_json(data, log_time_ns, measurement))
      sink_->on_measurement(measurement);
    else
      count_malformed();
  }

  const std::string topic_;
  MeasurementSink* sink_ = nullptr;  // while feed() runs
  std::optional<Channel> chosen_;
};

constexpr Setting mcap_settings[] = {
    {.key = "topic", .help = "topic of the channel; default: the first that fits", .initial = std::string_view()}};

}  // namespace

extern constexpr Protocol mcap_log_format = {
    .name = "mcap",
    .summary = "MCAP: what --mcap writes, or a recording of ROS 2 with sensor_msgs/msg/Imu: file:BAG.mcap",
    .link = Link::bytes,
    .document = "mcap.dev/spec, version 0",
    .settings = mcap_settings,
    .sends_some_samples = true,  // as the product that was logged may
    .has_checksum = true,
    .make = nullptr,  // only decoded
    .make_decoder = make_as<Decoder, McapDecoder>,
};

}  // namespace imud
