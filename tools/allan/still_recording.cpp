#include "tools/allan/still_recording.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace imud {
namespace {

void require_length(const StillRecording& recording) {
  if (recording.samples() >= shortest_recording) return;
  throw std::runtime_error(
      fmt::format("{} samples are too few; right would be at least {}", recording.samples(), shortest_recording));
}

}  // namespace

StillRecorder::StillRecorder(const Protocol& protocol, const RecordingOptions& options, std::uint64_t wanted)
    : options_(options), wanted_(wanted), statistics_(protocol) {}

void StillRecorder::choose_channels(const Measurement& first) {
  const auto choose = [&](std::uint32_t plain, std::uint32_t increment) {
    const bool has_increment = (first.fields & increment) != 0;
    return has_increment && (options_.increments || (first.fields & plain) == 0) ? increment : first.fields & plain;
  };
  const std::uint32_t rate = choose(Measurement::rate, Measurement::delta_angle);
  const std::uint32_t force = choose(Measurement::specific_force, Measurement::delta_velocity);
  fields_ = rate | force;
  const auto add = [&](std::size_t begin, const Vector3& values, bool is_increment) {
    for (std::size_t axis = 0; axis < channels_per_sensor; ++axis)
      if (!std::isnan(values[static_cast<Eigen::Index>(axis)]))
        recording_.channels.push_back({begin + axis, {}, is_increment});
  };
  if (rate != 0) add(0, rates_of(first.sample), rate == Measurement::delta_angle);
  if (force != 0) add(channels_per_sensor, forces_of(first.sample), force == Measurement::delta_velocity);
}

const Vector3& StillRecorder::rates_of(const Sample& sample) const noexcept {
  return (fields_ & Measurement::delta_angle) != 0 ? sample.delta_angle : sample.rate;
}

const Vector3& StillRecorder::forces_of(const Sample& sample) const noexcept {
  return (fields_ & Measurement::delta_velocity) != 0 ? sample.delta_velocity : sample.specific_force;
}

bool StillRecorder::has_the_channels(const Sample& sample) const noexcept {
  std::size_t numbers = 0;
  if ((fields_ & (Measurement::rate | Measurement::delta_angle)) != 0)
    numbers += static_cast<std::size_t>(rates_of(sample).array().isFinite().count());
  if ((fields_ & (Measurement::specific_force | Measurement::delta_velocity)) != 0)
    numbers += static_cast<std::size_t>(forces_of(sample).array().isFinite().count());
  return numbers == recording_.channels.size() &&
         std::ranges::all_of(recording_.channels, [&](const StillRecording::Channel& channel) {
           return std::isfinite(value_of(channel, sample));
         });
}

double StillRecorder::value_of(const StillRecording::Channel& channel, const Sample& sample) const noexcept {
  const auto axis = static_cast<Eigen::Index>(channel.number % channels_per_sensor);
  return channel.is_rate() ? rates_of(sample)[axis] : forces_of(sample)[axis];
}

void StillRecorder::on_measurement(const Measurement& measurement) {
  if (is_full()) return;
  const Sample& sample = measurement.sample;
  const bool is_valid = (measurement.fields & Measurement::status) == 0 || (sample.status & status::not_valid) == 0;
  if (fields_ == 0) {
    if (!is_valid) return;
    choose_channels(measurement);
    // The increments of the first sample of a run have no step.
    if ((fields_ & (Measurement::delta_angle | Measurement::delta_velocity)) != 0 && sample.delta_angle.isZero(0) &&
        sample.delta_velocity.isZero(0))
      return;
  }
  statistics_.add(measurement, arrival_);
  if (!is_valid || (measurement.fields & fields_) != fields_ || !has_the_channels(sample)) {
    ++recording_.invalid;
    return;
  }
  ++taken_;
  for (auto& channel : recording_.channels) channel.values.push_back(value_of(channel, sample));
}

StillRecording StillRecorder::finish() {
  statistics_.finish();
  StillRecording& r = recording_;
  r.gaps = statistics_.gaps();
  r.missing = statistics_.missing();
  r.repeated = statistics_.repeated();
  r.time_jumps = statistics_.time_jumps();
  r.can_detect_gaps = statistics_.can_detect_gaps();
  require_length(r);
  for (auto& channel : r.channels) channel.values.finish();
  if (statistics_.back() > 0)
    throw std::runtime_error(
        "the device's time or counter goes back: it was restarted, or samples are out of order; right would be a "
        "recording without a restart");
  const std::uint64_t lacking = r.missing + r.repeated + r.invalid + r.time_jumps;
  if (static_cast<double>(lacking) > options_.largest_missing / 100 * static_cast<double>(r.samples()))
    throw std::runtime_error(
        fmt::format("of {} samples {} are missing, {} repeated, {} no measurement, and the clock jumps {} times, "
                    "which is more than "
                    "--max-missing {} %",
                    r.samples(), r.missing, r.repeated, r.invalid, r.time_jumps, options_.largest_missing));

  const auto hz = [&](const StreamStatistics::Rate& rate) {
    return static_cast<double>(rate.steps + r.missing) / seconds(rate.time);
  };
  if (options_.rate_hz) {
    r.rate_hz = *options_.rate_hz;
    r.rate_source = "as given";
  } else if (statistics_.device().hz()) {
    r.rate_hz = hz(statistics_.device());
    r.rate_source = "device clock";
  } else if (statistics_.arrival().hz()) {
    r.rate_hz = hz(statistics_.arrival());
    r.rate_source = "arrival";
  } else {
    throw std::runtime_error("the rate is unknown, as the samples have no time; right would be --rate-hz HZ");
  }
  for (auto& channel : r.channels)
    if (channel.is_increment) channel.values.scale(r.rate_hz);
  return std::move(recording_);
}

StillRecording recording_of(NpyRows& array, const std::vector<std::optional<std::size_t>>& columns, double rate_hz) {
  StillRecording recording;
  recording.rate_hz = rate_hz;
  recording.rate_source = "as given";
  recording.can_detect_gaps = false;
  std::vector<std::size_t> taken;
  for (std::size_t column = 0; column < columns.size(); ++column) {
    if (!columns[column]) continue;
    taken.push_back(column);
    recording.channels.push_back({*columns[column], {}, false});
  }
  std::size_t number = 0;
  for (auto row = array.next(); !row.empty(); row = array.next(), ++number)
    for (std::size_t i = 0; i < taken.size(); ++i) {
      const double value = row[taken[i]];
      if (!std::isfinite(value))
        throw std::runtime_error(
            fmt::format("row {}, column {} is {}; right would be a finite number", number, taken[i], value));
      recording.channels[i].values.push_back(value);
    }
  for (auto& channel : recording.channels) channel.values.finish();
  require_length(recording);
  return recording;
}

std::vector<std::optional<std::size_t>> parse_columns(std::string_view text, std::size_t columns) {
  const auto refuse = [&](std::string_view fault) {
    throw std::invalid_argument(
        fmt::format("--columns: {}; right would be names of {}, or - for a column to leave out", fault,
                    fmt::join(channel_names, ",")));
  };
  std::vector<std::optional<std::size_t>> result;
  if (text.empty()) {
    if (columns != 1 && columns != channels_per_sensor && columns != channel_names.size())
      refuse(fmt::format("the array has {} columns, and no names", columns));
    for (std::size_t i = 0; i < columns; ++i) result.emplace_back(i);
    return result;
  }
  std::array<bool, channel_names.size()> taken{};
  bool any = false;
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view name = text.substr(0, comma);
    std::optional<std::size_t> number;
    for (std::size_t i = 0; i < channel_names.size(); ++i)
      if (channel_names[i] == name) number = i;
    if (!number && name != "-") refuse(fmt::format("there is no channel '{}'", name));
    if (number && taken[*number]) refuse(fmt::format("{} is given twice", name));
    if (number) any = taken[*number] = true;
    result.push_back(number);
    if (comma == std::string_view::npos) break;
    text.remove_prefix(comma + 1);
  }
  if (!any) refuse("all columns are left out");
  if (result.size() != columns)
    refuse(fmt::format("{} names are given, and the array has {} columns", result.size(), columns));
  return result;
}

}  // namespace imud
