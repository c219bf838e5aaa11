// Reads the sensors of a ULog, PX4's format of flight logs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/input/log_formats.hpp"
#include "tools/input/ulog_reader.hpp"

namespace imud {

namespace {

// The quantity that a topic's field has. `field`: an array of three; empty: the fields x, y and z. In the order of
// preference.
struct UlogSource {
  std::string_view topic, field;
  std::uint32_t bit;
  Vector3 Sample::*value;
};
constexpr UlogSource ulog_sources[] = {
    {"imud_measurement", "gyro", Measurement::rate, &Sample::rate},
    {"imud_measurement", "accel", Measurement::specific_force, &Sample::specific_force},
    {"imud_measurement", "dtheta", Measurement::delta_angle, &Sample::delta_angle},
    {"imud_measurement", "dvel", Measurement::delta_velocity, &Sample::delta_velocity},
    {"sensor_combined", "gyro_rad", Measurement::rate, &Sample::rate},
    {"sensor_combined", "accelerometer_m_s2", Measurement::specific_force, &Sample::specific_force},
    {"vehicle_imu", "delta_angle", Measurement::delta_angle, &Sample::delta_angle},
    {"vehicle_imu", "delta_velocity", Measurement::delta_velocity, &Sample::delta_velocity},
    {"sensor_gyro", "", Measurement::rate, &Sample::rate},
    {"sensor_accel", "", Measurement::specific_force, &Sample::specific_force},
};
constexpr std::string_view ulog_topics[] = {"auto",        "imud_measurement", "sensor_combined",
                                            "vehicle_imu", "sensor_gyro",      "sensor_accel"};

class UlogDecoder final : public Decoder, private UlogReader {
 public:
  explicit UlogDecoder(const Settings& settings)
      : topic_(settings.text("topic")), instance_(static_cast<std::uint8_t>(settings.integer("instance"))) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    sink_ = &sink;
    read(frame.bytes);
    errors_.malformed += take_malformed();
  }

  void finish(MeasurementSink&) override {
    const std::size_t cut_short = end();
    if (!chosen_ && has_data_) refuse(fmt::format("it has no topic {}; --set topic=... chooses another", wanted()));
    if (cut_short > 0) ++errors_.malformed;
    errors_.skipped_bytes += cut_short;
  }

 private:
  std::string wanted() const {
    return topic_ == "auto" ? fmt::format("{}", fmt::join(std::span(ulog_topics).subspan(1), ", "))
                            : fmt::format("{} with instance {}", topic_, instance_);
  }

  void on_data(std::uint16_t number, std::string_view body) override {
    has_data_ = true;
    if (chosen_ && chosen_->number == number) decode(body);
  }

  void on_subscription(std::uint8_t instance, std::uint16_t number, std::string_view name) override {
    const auto preference = std::ranges::find(ulog_topics, name);
    if (preference == std::end(ulog_topics) || instance != instance_ || (topic_ != "auto" && topic_ != name)) return;
    const auto rank = preference - std::begin(ulog_topics);
    if (chosen_ && (chosen_->rank <= rank || has_data_)) return;
    const UlogFormat* known = format(name);
    if (known == nullptr) return;
    chosen_ = {number, rank, name == ulog_topics[1], known, {}};
    const std::array<std::string_view, 3> axes{"x", "y", "z"};
    for (const UlogSource& source : ulog_sources) {
      if (source.topic != name) continue;
      Values values{&source, {}};
      const UlogFormat::Field* whole = source.field.empty() ? nullptr : chosen_->format->find(source.field);
      bool is_known = true;
      for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        const UlogFormat::Field* field = source.field.empty() ? chosen_->format->find(axes[axis]) : whole;
        is_known =
            is_known && field != nullptr && field->is_real() && field->count == (whole != nullptr ? axes.size() : 1);
        if (is_known) values.axes[axis] = {field, whole != nullptr ? axis : 0};
      }
      if (is_known) chosen_->values.push_back(values);
    }
  }

  void decode(std::string_view body) {
    const auto in = message(*chosen_->format, body);
    if (!in) return;
    Measurement measurement;
    Sample& sample = measurement.sample;
    for (const Values& values : chosen_->values) {
      Vector3& out = sample.*values.source->value;
      for (std::size_t axis = 0; axis < values.axes.size(); ++axis)
        out[static_cast<Eigen::Index>(axis)] = in->real(*values.axes[axis].first, values.axes[axis].second);
      // A product that lacks an axis has NaN there.
      if (out.array().isNaN().all())
        out.setZero();
      else
        measurement.fields |= values.source->bit;
    }
    if (in->number<std::int32_t>("accelerometer_timestamp_relative") == std::numeric_limits<std::int32_t>::max())
      measurement.fields &= ~std::uint32_t{Measurement::specific_force};
    if (const UlogFormat::Field* field = chosen_->format->find("temperature");
        field != nullptr && field->is_real() && field->count == 1) {
      sample.temperature_c = in->real(*field);
      if (std::isfinite(sample.temperature_c)) measurement.fields |= Measurement::temperature;
    }
    if (chosen_->is_own) {
      measurement.fields = in->number<std::uint32_t>("fields").value_or(0);
      sample.time = DeviceTime{in->number<std::int64_t>("time_ns").value_or(0)};
      sample.counter = in->number<std::uint64_t>("counter").value_or(0);
      sample.status = in->number<std::uint32_t>("status").value_or(0);
    } else {
      const auto time_ns = in->time_ns();
      if (!time_ns) return count_malformed();
      sample.time = DeviceTime{*time_ns};
      measurement.fields |= Measurement::time;
    }
    sink_->on_measurement(measurement);
  }

  struct Values {
    const UlogSource* source;
    std::array<std::pair<const UlogFormat::Field*, std::size_t>, 3> axes;  // a field, and the index of its element
  };
  struct Chosen {
    std::uint16_t number;
    std::ptrdiff_t rank;
    bool is_own;
    const UlogFormat* format;
    std::vector<Values> values;
  };

  const std::string topic_;
  const std::uint8_t instance_;
  MeasurementSink* sink_ = nullptr;  // while feed() runs
  std::optional<Chosen> chosen_;
  bool has_data_ = false;
};

constexpr Setting ulog_settings[] = {
    {.key = "topic",
     .help = "message to read; auto: the first of these that is logged",
     .initial = ulog_topics[0],
     .choices = ulog_topics},
    {.key = "instance", .help = "number of the sensor (multi_id)", .initial = std::int64_t{0}, .min = 0, .max = 255},
};

}  // namespace

extern constexpr Protocol ulog_log_format = {
    .name = "ulog",
    .summary = "flight log of PX4: file:FLIGHT.ulg",
    .link = Link::bytes,
    .document = "docs.px4.io, ULog File Format, version 1",
    .settings = ulog_settings,
    .sends_some_samples = true,  // as the product that was logged may
    .make = nullptr,             // only decoded
    .make_decoder = make_as<Decoder, UlogDecoder>,
};

}  // namespace imud
