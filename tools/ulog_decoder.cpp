// Reads ULog, PX4's format of flight logs (docs.px4.io, "ULog File Format", version 1).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tools/log_formats.hpp"

namespace imud {

extern const Protocol ulog_format;

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

template <typename T>
T little_at(const char* bytes) {
  return boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(
      reinterpret_cast<const unsigned char*>(bytes));
}

struct UlogField {
  std::string type, name;
  std::size_t count = 1, offset = 0, size = 0;  // `size` of one element
  bool is_real() const noexcept { return type == "float" || type == "double"; }
};

std::size_t size_of_ulog_type(std::string_view type) {
  if (type == "char" || type == "bool") return 1;
  if (type == "float") return 4;
  if (type == "double") return 8;
  for (const auto& [name, size] : {std::pair{"int8_t", 1}, {"int16_t", 2}, {"int32_t", 4}, {"int64_t", 8}})
    if (type == name || (type.starts_with('u') && type.substr(1) == name)) return static_cast<std::size_t>(size);
  return 0;
}

// The fields of a topic, and where they are in its messages.
class UlogFormat {
 public:
  const UlogField* find(std::string_view name) const {
    const auto found = std::ranges::find(fields, name, &UlogField::name);
    return found == fields.end() ? nullptr : &*found;
  }
  std::vector<UlogField> fields;
  std::size_t size = 0;
};

class UlogDecoder final : public Decoder {
 public:
  explicit UlogDecoder(const Settings& settings)
      : topic_(settings.text("topic")), instance_(static_cast<std::uint8_t>(settings.integer("instance"))) {}

  void feed(const Frame& frame, MeasurementSink& sink) override {
    held_.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    std::size_t at = 0;
    if (position_ == 0) {
      if (held_.size() < header_size) return;
      if (!held_.starts_with("ULog\x01\x12\x35")) refuse("this is no ULog; right would be a file .ulg of PX4");
      at = header_size;
    }
    while (held_.size() - at >= 3 && position_ + at < appended_) {
      const std::size_t size = little_at<std::uint16_t>(held_.data() + at);
      if (held_.size() - at < 3 + size) break;
      read_message(held_[at + 2], std::string_view(held_).substr(at + 3, size), sink);
      at += 3 + size;
    }
    if (position_ + at >= appended_) at = held_.size();  // what PX4 appends after a crash has no samples
    position_ += at;
    held_.erase(0, at);
  }

  void finish(MeasurementSink&) override {
    if (position_ == 0) refuse("the file ends within its header");
    if (!chosen_ && has_data_) refuse(fmt::format("it has no topic {}; --set topic=... chooses another", wanted()));
    if (!held_.empty()) ++errors_.malformed;
    errors_.skipped_bytes += held_.size();
  }

 private:
  static constexpr std::size_t header_size = 16;

  [[noreturn]] static void refuse(const std::string& fault) { throw std::runtime_error("ulog: " + fault); }

  std::string wanted() const {
    return topic_ == "auto" ? fmt::format("{}", fmt::join(std::span(ulog_topics).subspan(1), ", "))
                            : fmt::format("{} with instance {}", topic_, instance_);
  }

  void read_message(char type, std::string_view body, MeasurementSink& sink) {
    if (type == 'B' && body.size() >= 40) {
      constexpr std::uint64_t known = 1;  // data are appended
      if ((little_at<std::uint64_t>(body.data() + 8) & ~known) != 0)
        refuse("it has an incompatible flag that is unknown");
      if (const auto offset = little_at<std::uint64_t>(body.data() + 16); offset > 0) appended_ = offset;
    } else if (type == 'F') {
      define(body);
    } else if (type == 'A' && body.size() > 3) {
      subscribe(static_cast<std::uint8_t>(body[0]), little_at<std::uint16_t>(body.data() + 1), body.substr(3));
    } else if (type == 'D' && body.size() >= 2) {
      has_data_ = true;
      if (chosen_ && chosen_->number == little_at<std::uint16_t>(body.data())) decode(body.substr(2), sink);
    }
  }

  // Reads "name:type[3] field;type field;". A type may be another format's, defined before or after it.
  void define(std::string_view text) {
    const std::size_t colon = text.find(':');
    if (colon == std::string_view::npos) return void(++errors_.malformed);
    const auto [place, is_new] = formats_.try_emplace(std::string(text.substr(0, colon)));
    if (!is_new) return;  // those of a subscription stay
    UlogFormat& format = place->second;
    for (text.remove_prefix(colon + 1); !text.empty();) {
      const std::string_view one = text.substr(0, text.find(';'));
      text.remove_prefix(std::min(one.size() + 1, text.size()));
      const std::size_t blank = one.find(' '), bracket = one.find('[');
      if (blank == std::string_view::npos) return void(++errors_.malformed);
      UlogField field{std::string(one.substr(0, std::min(blank, bracket))), std::string(one.substr(blank + 1))};
      if (bracket < blank) std::from_chars(one.data() + bracket + 1, one.data() + blank, field.count);
      format.fields.push_back(std::move(field));
    }
  }

  // Computes where the fields are. Returns the format's size; 0 if it, or one in it, is unknown.
  std::size_t lay_out(const std::string& name, int depth = 0) {
    const auto found = formats_.find(name);
    if (found == formats_.end() || depth > 8) return 0;
    UlogFormat& format = found->second;
    format.size = 0;
    for (UlogField& field : format.fields) {
      field.size = size_of_ulog_type(field.type);
      if (field.size == 0) field.size = lay_out(field.type, depth + 1);
      if (field.size == 0 || field.count > 65536) return 0;
      field.offset = format.size;
      format.size += field.size * field.count;
      if (format.size > std::numeric_limits<std::uint16_t>::max()) return 0;
    }
    return format.size;
  }

  void subscribe(std::uint8_t instance, std::uint16_t number, std::string_view name) {
    const auto preference = std::ranges::find(ulog_topics, name);
    if (preference == std::end(ulog_topics) || instance != instance_ || (topic_ != "auto" && topic_ != name)) return;
    const auto rank = preference - std::begin(ulog_topics);
    if (chosen_ && (chosen_->rank <= rank || has_data_)) return;
    if (lay_out(std::string(name)) == 0) return void(++errors_.malformed);
    chosen_ = {number, rank, name == ulog_topics[1], &formats_[std::string(name)], {}};
    const std::array<std::string_view, 3> axes{"x", "y", "z"};
    for (const UlogSource& source : ulog_sources) {
      if (source.topic != name) continue;
      Values values{&source, {}};
      const UlogField* whole = source.field.empty() ? nullptr : chosen_->format->find(source.field);
      bool is_known = true;
      for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        const UlogField* field = source.field.empty() ? chosen_->format->find(axes[axis]) : whole;
        is_known =
            is_known && field != nullptr && field->is_real() && field->count == (whole != nullptr ? axes.size() : 1);
        if (is_known) values.axes[axis] = {field->offset + (whole != nullptr ? axis * field->size : 0), field->size};
      }
      if (is_known) chosen_->values.push_back(values);
    }
  }

  static double real_at(std::string_view body, std::size_t offset, std::size_t size) {
    return size == sizeof(float) ? double{little_at<float>(body.data() + offset)}
                                 : little_at<double>(body.data() + offset);
  }

  // Returns a field of that size, from the message.
  template <typename T>
  std::optional<T> member(std::string_view body, std::string_view name) const {
    const UlogField* field = chosen_->format->find(name);
    if (field == nullptr || field->size != sizeof(T) || field->count != 1) return {};
    return little_at<T>(body.data() + field->offset);
  }

  void decode(std::string_view body, MeasurementSink& sink) {
    // A message may lack the padding at its end.
    std::string whole;
    if (body.size() < chosen_->format->size) {
      const auto& last = chosen_->format->fields.back();
      if (!last.name.starts_with("_padding") || body.size() < last.offset) return void(++errors_.malformed);
      body = whole.assign(body).append(last.size * last.count, '\0');
    }
    Measurement measurement;
    Sample& sample = measurement.sample;
    for (const Values& values : chosen_->values) {
      Vector3& out = sample.*values.source->value;
      for (std::size_t axis = 0; axis < values.axes.size(); ++axis)
        out[static_cast<Eigen::Index>(axis)] = real_at(body, values.axes[axis].first, values.axes[axis].second);
      // A product that lacks an axis has NaN there.
      const bool is_carried = !out.array().isNaN().all();
      out = out.array().isNaN().select(0.0, out);
      if (is_carried) measurement.fields |= values.source->bit;
    }
    if (member<std::int32_t>(body, "accelerometer_timestamp_relative") == std::numeric_limits<std::int32_t>::max())
      measurement.fields &= ~std::uint32_t{Measurement::specific_force};
    if (const UlogField* field = chosen_->format->find("temperature");
        field != nullptr && field->is_real() && field->count == 1) {
      sample.temperature_c = real_at(body, field->offset, field->size);
      if (std::isfinite(sample.temperature_c)) measurement.fields |= Measurement::temperature;
    }
    if (chosen_->is_own) {
      measurement.fields = member<std::uint32_t>(body, "fields").value_or(0);
      sample.time = DeviceTime{member<std::int64_t>(body, "time_ns").value_or(0)};
      sample.counter = member<std::uint64_t>(body, "counter").value_or(0);
      sample.status = member<std::uint32_t>(body, "status").value_or(0);
    } else {
      const auto sampled = member<std::uint64_t>(body, "timestamp_sample");
      const std::uint64_t time_us = sampled ? *sampled : member<std::uint64_t>(body, "timestamp").value_or(0);
      if (time_us > std::uint64_t{std::numeric_limits<std::int64_t>::max()} / 1000) return void(++errors_.malformed);
      sample.time = DeviceTime{static_cast<std::int64_t>(time_us) * 1000};
      measurement.fields |= Measurement::time;
    }
    sink.on_measurement(measurement);
  }

  struct Values {
    const UlogSource* source;
    std::array<std::pair<std::size_t, std::size_t>, 3> axes;  // offset and size
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
  std::string held_;
  std::uint64_t position_ = 0, appended_ = std::numeric_limits<std::uint64_t>::max();
  std::map<std::string, UlogFormat> formats_;
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

constexpr Protocol ulog_format = {
    .name = "ulog",
    .summary = "flight log of PX4: file:FLIGHT.ulg",
    .link = Link::bytes,
    .document = "docs.px4.io, ULog File Format, version 1",
    .settings = ulog_settings,
    .make_decoder = [](const Settings& settings) -> std::unique_ptr<Decoder> {
      return std::make_unique<UlogDecoder>(settings);
    },
};

}  // namespace imud
