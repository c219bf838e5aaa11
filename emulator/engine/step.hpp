// Step: one event of a run, with its bytes. Drivers propose steps, and Engine::apply() alone executes them.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "emulator/imu/command.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {

struct Reload;

// A step has the kinds and numbers of the record (RecordEvent), so that a recorded event is a step when the
// number of its imu is known.
struct Step {
  // The rest of a step beside its event. Must outlive the step.
  struct Content {
    Frame frame = {};          // of `receive`: what the host has sent; of `mark`: its text
    HostTime arrival = {};     // of `receive`: when the host's bytes arrived
    Reload* reload = nullptr;  // of a reload
  };
  using Type = RecordEvent::Type;
  static constexpr std::uint16_t all_imus = RecordEvent::all_imus;

  // `interface` is not used.
  RecordEvent event;
  std::uint16_t imu = all_imus;  // the number of the imu in the engine
  bool at_once = false;          // of `sample`: its frames leave now, apart from the prepared samples
  const Content* content = nullptr;

  // The sensor's power goes on, and its clock runs from `origin` on.
  static Step power_on(std::size_t imu, HostTime origin) noexcept {
    return of(imu, {.type = Type::power_on, .a = origin.ns});
  }
  // The supply of all devices goes off and on.
  static Step power_cycle(HostTime now) noexcept { return {{.type = Type::power_cycle, .a = now.ns}}; }
  // One record is taken from the truth port, with the watermark at which it is admitted (TruthIntake::take()).
  static Step truth(TruthTime watermark) noexcept { return {{.type = Type::truth, .b = watermark.ns}}; }
  // The timeline discards the truth before the newest, because the simulator's time has leapt.
  static Step forget_past() noexcept { return {{.type = Type::forget_past}}; }
  // A run of the truth begins with the timeline's newest truth, or after a leap goes on with it.
  static Step run(bool goes_on) noexcept {
    return {{.type = Type::run, .flags = goes_on ? RecordEvent::goes_on : std::uint8_t{0}}};
  }
  // Sets the device's clock (DeviceClock::set()).
  static Step set_clock(std::size_t imu, DeviceTime zero, std::optional<HostTime> origin) noexcept {
    return of(imu, {.type = Type::set_clock,
                    .flags = origin ? RecordEvent::has_host_time : std::uint8_t{0},
                    .a = zero.ns,
                    .b = origin.value_or(HostTime{}).ns});
  }
  // The next sample of the imu is at instant 0 of its grid.
  static Step start_samples(std::size_t imu) noexcept { return of(imu, {.type = Type::start_samples}); }
  // Slow imus integrate the truth up to `until`. No later sample may precede it.
  static Step advance(TruthTime until) noexcept { return {{.type = Type::advance, .a = until.ns}}; }
  // The imu takes sample `k` of its grid. sample() reads the truth at `time`, rest_sample() assumes a vehicle at
  // rest. The device receives the sample with the next `transmit`.
  static Step sample(std::size_t imu, std::uint64_t k, TruthTime time) noexcept {
    return of(imu, {.type = Type::sample, .a = time.ns, .c = static_cast<std::int64_t>(k)});
  }
  static Step rest_sample(std::size_t imu, std::uint64_t k, Nanoseconds since_power_on) noexcept {
    return of(imu, {.type = Type::sample,
                    .flags = RecordEvent::at_rest,
                    .a = since_power_on.count(),
                    .c = static_cast<std::int64_t>(k)});
  }
  // The devices receive the prepared samples, which are of this instant. With `skipped` their frames are discarded.
  static Step transmit(HostTime instant, bool skipped) noexcept {
    return {{.type = Type::transmit, .flags = skipped ? RecordEvent::skipped : std::uint8_t{0}, .a = instant.ns}};
  }
  // The device executes what its host has sent to the UART: Content::frame and Content::arrival.
  static Step receive(std::size_t imu, std::size_t uart, HostTime now, const Content& content) noexcept {
    Step step = of(imu, {.type = Type::receive, .flags = static_cast<std::uint8_t>(uart), .a = now.ns});
    step.content = &content;
    return step;
  }
  // The deadlines of the devices and of the truth format are polled up to `now`.
  static Step deadlines(HostTime now) noexcept { return {{.type = Type::deadlines, .a = now.ns}}; }
  // A command is executed. `content`: the text of a mark, or the changes of a reload.
  static Step command(const Command& command, HostTime now, const Content* content = nullptr) noexcept {
    const bool is_mark = command.kind == Command::Kind::mark;
    return {.event = {.type = is_mark ? Type::mark : Type::command,
                      .flags = static_cast<std::uint8_t>(command.kind),
                      .a = now.ns,
                      .b = records_value(command.kind) ? std::bit_cast<std::int64_t>(command.value) : 0,
                      .c = is_mark ? 0 : static_cast<std::int64_t>(command.number)},
            .imu = command.imu,
            .content = content};
  }
  // The run ends.
  static Step end() noexcept { return {{.type = Type::end}}; }

  Command::Kind command_kind() const noexcept { return static_cast<Command::Kind>(event.flags); }
  std::uint64_t command_number() const noexcept { return static_cast<std::uint64_t>(event.c); }
  double command_value() const noexcept { return std::bit_cast<double>(event.b); }

 private:
  static Step of(std::size_t imu, const RecordEvent& event) noexcept {
    return {.event = event, .imu = static_cast<std::uint16_t>(imu)};
  }
};

// Properties of a kind of step.
struct StepTraits {
  bool is_of_imu = false;        // the kind always has one imu; a command may have one
  bool has_polled_time = false;  // `b` of the recorded event is the time up to which deadlines had been polled
};
constexpr StepTraits traits_of(const RecordEvent& event) noexcept {
  using Type = RecordEvent::Type;
  switch (event.type) {
    case Type::power_on:
    case Type::set_clock:
    case Type::start_samples:
    case Type::sample:
    case Type::receive:
      return {.is_of_imu = true};
    case Type::power_cycle:
    case Type::run:
    case Type::transmit:
    case Type::end:
    case Type::mark:
      return {.has_polled_time = true};
    case Type::command:
      return {.has_polled_time = !records_value(static_cast<Command::Kind>(event.flags))};
    case Type::deadlines:
    case Type::begin:
    case Type::truth:
    case Type::disconnected:
    case Type::forget_past:
    case Type::advance:
    case Type::lost:
      return {};
  }
  return {};  // of a damaged record
}

}  // namespace imud
