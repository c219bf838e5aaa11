#include "emulator/report/clock_watch.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/timex.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "emulator/report/log.hpp"

namespace imud {

ClockState read_clock_state() noexcept {
  timex clock{};  // with modes = 0 nothing is changed
  ClockState state;
  const int status = ::adjtimex(&clock);
  if (status < 0) {
    state.error = errno;
    return state;
  }
  state.is_synchronised = status != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
  state.error_us = clock.esterror;
  state.max_error_us = clock.maxerror;
  state.tai_offset_s = clock.tai;
  return state;
}

std::string epoch_fault(const RealtimeConfig& config, const ClockState& state) {
  if (config.epoch == Epoch::none || config.epoch == Epoch::monotonic || config.allow_unsynchronised) return {};
  const std::string key = fmt::format("realtime.epoch = \"{}\"", word_of(epoch_words, config.epoch));
  constexpr std::string_view allow = "or set realtime.allow_unsynchronised = true";
  if (state.error != 0)
    return fmt::format(
        "{}: the kernel does not give the state of its clock (adjtimex: {}), so it may differ from other hosts'; "
        "permit the call (a unit of systemd: ProtectClock=no), {}",
        key, std::strerror(state.error), allow);
  if (!state.is_synchronised)
    return fmt::format(
        "{}: this host's clock is not synchronised, so its grid would differ from other hosts'; start an NTP or "
        "PTP service and wait until `timedatectl` reports it as synchronised, {}",
        key, allow);
  if (config.epoch == Epoch::tai && state.tai_offset_s == 0)
    return fmt::format(
        "{}: the kernel's offset of TAI from UTC is 0, so its TAI is UTC; have chrony (leapsectz right/UTC) or a PTP "
        "service set it, {}",
        key, allow);
  return {};
}

std::string clock_error_text(const ClockFigures& clock) {
  if (!clock.state) return {};
  if (clock.state->error != 0) return "clock error not known";
  if (!clock.state->is_synchronised) return "clock not synchronised";
  return fmt::format("clock error {} us", clock.state->error_us);
}

std::string text(const ClockFigures& clock) {
  std::string out(word_of(epoch_words, clock.epoch));
  if (clock.state) out += ", " + clock_error_text(clock);
  if (clock.state && clock.state->is_synchronised) out += fmt::format(" (at most {} us)", clock.state->max_error_us);
  return out + fmt::format(", {} steps", clock.counters[&ClockCounters::steps]);
}

nlohmann::ordered_json json(const ClockFigures& clock) {
  nlohmann::ordered_json all = {{"epoch", word_of(epoch_words, clock.epoch)},
                                {"steps", clock.counters[&ClockCounters::steps]},
                                {"last_step_us", 1e6 * clock.counters[&ClockCounters::last_step]}};
  const auto& state = clock.state;
  if (!state) return all;
  all.update({{"synchronised", state->is_synchronised}, {"unsynchronised_s", clock.unsynchronised_s}});
  if (state->error == 0)
    all.update({{"error_us", state->error_us},
                {"largest_error_us", clock.largest_error_us},
                {"max_error_us", state->max_error_us},
                {"tai_offset_s", state->tai_offset_s}});
  return all;
}

std::optional<std::uint64_t> find_count(const ClockFigures& clock, std::string_view name) {
  if (name == clock_count_names[0]) return clock.counters[&ClockCounters::steps];
  if (!clock.state) return std::nullopt;
  if (name == clock_count_names[1] && clock.state->error == 0) return clock.largest_error_us;
  if (name == clock_count_names[2]) return clock.unsynchronised_s;
  return std::nullopt;
}

ClockWatch::ClockWatch(const RealtimeConfig& config, const ClockCounters* counters, std::function<ClockState()> read)
    : counters_(counters), read_(std::move(read)) {
  figures_.epoch = config.epoch;
  if (counters_ == nullptr || config.epoch == Epoch::monotonic) return;
  figures_.state = read_();
}

void ClockWatch::update(HostTime now) {
  if (counters_ == nullptr) return;
  const LogFields fields({}, "clock.steps");
  if (const std::uint64_t steps = counters_->steps; std::exchange(steps_, steps) != steps)
    spdlog::warn(
        "the clock of realtime.epoch was set, the last time by {:+.6f} s: the samples go on at the nearest "
        "instants of their grids",
        counters_->last_step.load());
  if (!figures_.state) return;
  // Until the next reading the state is taken to be the last one read.
  if (last_ && !figures_.state->is_synchronised) unsynchronised_ += now - *last_;
  last_ = now;
  count_unsynchronised();
  if (now < next_) return;
  next_ = now + std::chrono::seconds(1);
  const bool was_synchronised = figures_.state->is_synchronised;
  figures_.state = read_();
  if (was_synchronised != figures_.state->is_synchronised)
    spdlog::log(was_synchronised ? spdlog::level::warn : spdlog::level::info,
                "the clock of realtime.epoch is {} synchronised", was_synchronised ? "no longer" : "now");
  count_unsynchronised();
  figures_.largest_error_us = std::max(
      figures_.largest_error_us, static_cast<std::uint64_t>(std::max(std::int64_t{0}, figures_.state->error_us)));
}

void ClockWatch::count_unsynchronised() noexcept {
  const auto whole = static_cast<std::uint64_t>(std::chrono::ceil<std::chrono::seconds>(unsynchronised_).count());
  const std::uint64_t least = figures_.state->is_synchronised ? 0 : 1;
  figures_.unsynchronised_s = std::max({figures_.unsynchronised_s, whole, least});
}

std::optional<ClockFigures> ClockWatch::figures() const {
  if (counters_ == nullptr) return std::nullopt;
  ClockFigures now = figures_;
  now.counters = Snapshot(*counters_);
  return now;
}

}  // namespace imud
