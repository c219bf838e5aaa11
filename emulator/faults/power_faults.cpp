#include "emulator/faults/power_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "emulator/faults/fault_numbers.hpp"

namespace imud {
namespace {

enum Kind : std::uint8_t { off, brown_out, slow_start, settings_lost, boot_loader, kind_count };

constexpr std::string_view power[] = {"power"};
constexpr FaultParameter of_brown_out[] = {
    {.key = "per_s", .meaning = "resets in a second, on average", .min = 0, .max = 1e4}};
constexpr FaultParameter of_slow_start[] = {
    {.key = "value_s", .meaning = "by which the device starts later", .min = 0, .max = 1e6}};

constexpr std::string_view started_anew =
    "the device starts up, with its saved settings and new turn-on errors; what the host has sent meanwhile is lost";

constexpr FaultKind power_kind(Kind code, std::string_view name, std::string_view summary,
                               std::span<const FaultParameter> parameters, std::string_view stays) {
  return {.code = code,
          .name = name,
          .summary = summary,
          .seam = FaultSeam::power,
          .targets = power,
          .parameters = parameters,
          .is_ramped = code == brown_out,
          .is_event = code == settings_lost,
          .stays = stays};
}

constexpr std::array power_table = {
    power_kind(off, "off", "the supply is off, and on again at the end", {}, started_anew),
    power_kind(brown_out, "brown_out", "the supply drops at random instants, at each of which the device is reset",
               of_brown_out, started_anew),
    power_kind(slow_start, "slow_start", "each start of the device takes longer", of_slow_start,
               "a start that has begun takes as long as it would"),
    power_kind(settings_lost, "settings_lost", "the device is reset, and starts with the settings as delivered", {},
               "the settings are those as delivered until the host changes them"),
    power_kind(boot_loader, "boot_loader",
               "the device is reset, and stays in its boot loader, which neither sends nor answers", {},
               started_anew),
};
static_assert(has_every_code(power_table, kind_count),
              "the rows stand in the order of the enumeration, one for each value");
static_assert(has_own_names(power_table), "a target has two kinds of one name");

}  // namespace

std::span<const FaultKind> power_fault_kinds() noexcept { return power_table; }

PowerFaults::PowerFaults(std::string_view imu, std::uint64_t seed, double rate_hz)
    : seed_(seed), stream_(stream_id(fmt::format("{}/power", imu))), rate_hz_(rate_hz) {}

// The delay of a start in samples.
std::uint64_t PowerFaults::delay() const noexcept {
  return static_cast<std::uint64_t>(std::ceil(std::max(0.0, slow_s_ * rate_hz_ - 1e-6)));
}

bool PowerFaults::cycle() noexcept {
  if (!is_supplied_) return false;
  const std::uint64_t samples = delay();
  waiting_ = samples > 0 ? samples + 1 : 0;  // the next step counts the part of a period that is left
  is_on_ = waiting_ == 0;
  return is_on_;
}

PowerStep PowerFaults::step(std::span<const ActiveFault> faults) noexcept {
  bool is_supplied = true, is_reset = false;
  slow_s_ = 0;
  for (const ActiveFault& fault : faults) {
    switch (fault.kind->code.as<Kind>()) {
      case off:
      case boot_loader:
        is_supplied = false;
        break;
      case brown_out: {
        FaultNumbers numbers(seed_, stream_, fault.number, fault.occurrence, fault.since);
        is_reset = numbers.happens(fault.parameters[0] * fault.weight / rate_hz_) || is_reset;
        break;
      }
      case slow_start:
        slow_s_ = std::max(slow_s_, fault.parameters[0]);
        break;
      case settings_lost:
        if (fault.since == 0) is_reset = as_delivered_ = true;
        break;
      case kind_count:
        break;
    }
  }
  const bool is_switched_on = is_supplied && (!is_supplied_ || is_reset);
  is_supplied_ = is_supplied;
  if (is_switched_on)
    waiting_ = delay();
  else if (is_supplied && waiting_ > 0)
    --waiting_;
  const bool was_on = is_on_;
  is_on_ = is_supplied && waiting_ == 0;
  return {.is_on = is_on_, .starts = is_on_ && (is_switched_on || !was_on), .as_delivered = as_delivered_};
}

}  // namespace imud
