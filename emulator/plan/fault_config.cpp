#include "emulator/plan/fault_config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "emulator/plan/fault_units.hpp"

namespace imud {
namespace {

std::string number_text(const FaultNumber& number, double si) {
  switch (number.law) {
    case FaultNumber::Law::uniform:
      return fmt::format("{:.6g} to {:.6g}", number.a / si, number.b / si);
    case FaultNumber::Law::normal:
      return fmt::format("{:.6g} +- {:.6g}", number.a / si, number.b / si);
    case FaultNumber::Law::fixed:
    default:
      return fmt::format("{:.6g}", number.a / si);
  }
}

}  // namespace

double FaultNumber::draw(double uniform) const noexcept {
  switch (law) {
    case Law::uniform:
      return a + uniform * (b - a);
    case Law::normal:
      return a + b * inverse_normal_cdf(uniform);
    case Law::fixed:
    default:
      return a;
  }
}

bool FaultConfig::acts_on(std::string_view imu) const noexcept { return std::ranges::find(imus, imu) != imus.end(); }

const Settings* FaultConfig::settings_of(std::string_view imu) const noexcept {
  const auto found = std::ranges::find_if(settings, [&](const auto& of) { return of.first == imu; });
  return found == settings.end() ? nullptr : &found->second;
}

std::string FaultConfig::target_text() const {
  std::string text(kind->targets[target]);
  if (!kind->has_axes || axes == 7) return text;
  text += '.';
  for (std::size_t axis = 0; axis < FaultConfig::axis_letters.size(); ++axis)
    if (((axes >> axis) & 1U) != 0) text += FaultConfig::axis_letters[axis];
  return text;
}

std::string FaultConfig::text() const {
  std::string text = fmt::format(
      "{} {}: {}", fmt::join(kind->seam == FaultSeam::truth ? std::vector<std::string>{"all imus"} : imus, ", "),
      target_text(), kind->summary);
  const std::span<const KeyUnit> units = fault_units(kind->targets[target]);
  std::vector<std::string> numbers;
  for (std::size_t i = 0; i < kind->parameters.size(); ++i) {
    const FaultParameter& parameter = kind->parameters[i];
    if (std::isnan(parameters[i].a)) continue;  // as delivered
    const bool has_unit = parameter.has_targets_unit && !units.empty();
    numbers.push_back(fmt::format("{} {}",
                                  has_unit ? fmt::format("{}{}", parameter.key, units[0].suffix) : parameter.key,
                                  number_text(parameters[i], 1)));
  }
  if (kind->has_settings) numbers.push_back(settings_text.empty() ? "as delivered" : settings_text);
  if (!numbers.empty()) text += fmt::format(" ({})", fmt::join(numbers, ", "));
  if (condition.quantity != FaultCondition::Quantity::none)
    text += fmt::format(", when {} is above {:g}{}",
                        condition.quantity == FaultCondition::Quantity::rate ? "the rate" : "the specific force",
                        condition.above,
                        begin_s.a > 0 ? fmt::format(", not before {} s", number_text(begin_s, 1)) : std::string());
  else if (begin_sample)
    text += fmt::format(", {} sample {}", kind->is_event ? "at" : "from", *begin_sample);
  else
    text += fmt::format(", {} {} s", kind->is_event ? "at" : "from", number_text(begin_s, 1));
  if (after_host) text += fmt::format(" after the host has sent {}", text_of(*after_host));
  if (after_utc_ns) text += fmt::format(" after {}", after_utc_text);
  if (samples)
    text += fmt::format(", for {} samples", *samples);
  else if (has_duration)
    text += fmt::format(", for {} s", number_text(duration_s, 1));
  else if (!kind->is_event)
    text += ", to the end of the run";
  if (ramp_in_s > 0) text += fmt::format(", ramped in over {:g} s", ramp_in_s);
  if (ramp_out_s > 0) text += fmt::format(", ramped out over {:g} s", ramp_out_s);
  if (every_s > 0) text += fmt::format(", again every {:g} s", every_s);
  if (times > 1) text += fmt::format(", {} times", times);
  if (probability < 1) text += fmt::format(", each with probability {:g}", probability);
  if (is_optional) text += ", if it begins at all";
  if (!kind->stays.empty()) text += fmt::format("; afterwards {}", kind->stays);
  return text;
}

std::vector<Normals> fault_normals(std::string_view imu, std::uint64_t seed, std::size_t faults) {
  std::vector<Normals> all;
  all.reserve(faults);
  std::string name = fmt::format("{}/fault/", imu);
  const std::size_t size = name.size();
  for (std::size_t i = 0; i < faults; ++i) {
    const fmt::format_int number(i);
    name.resize(size);
    all.emplace_back(seed, stream_id(name.append(number.data(), number.size())));
  }
  return all;
}

}  // namespace imud
