#include "emulator/drive/execute.hpp"

#include <algorithm>
#include <bit>
#include <string_view>

#include "emulator/drive/pacer.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/engine/reload.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/engine/schedule.hpp"
#include "emulator/ground/host.hpp"

namespace imud {

namespace {

void change_channel(Channel& channel, const FaultBook& faults, const Command& command, HostTime now) noexcept {
  const auto axis = static_cast<std::size_t>(command.number % 3);
  switch (command.kind) {
    case Command::Kind::power_off:
    case Command::Kind::power_on:
      channel.set_supply(command.kind == Command::Kind::power_on, now);
      break;
    case Command::Kind::power_cycle:
      channel.set_supply(false, now);
      channel.set_supply(true, now);
      break;
    case Command::Kind::pause:
    case Command::Kind::resume:
      channel.pause(command.kind == Command::Kind::pause);
      break;
    case Command::Kind::fault_begin:
      channel.begin_fault(faults[static_cast<std::uint32_t>(command.number)],
                          static_cast<std::uint32_t>(command.number));
      break;
    case Command::Kind::fault_end:
      channel.end_fault(static_cast<std::uint32_t>(command.number));
      break;
    case Command::Kind::fault_clear:
      channel.end_faults();
      break;
    case Command::Kind::seed:
      channel.set_seed(command.number);
      break;
    case Command::Kind::gyro_bias:
      channel.set_bias(Quantity::rate, axis, command.value);
      break;
    case Command::Kind::accelerometer_bias:
      channel.set_bias(Quantity::specific_force, axis, command.value);
      break;
    default:
      break;
  }
}

void change_session(Engine& engine, const Command& command) noexcept {
  switch (command.kind) {
    case Command::Kind::delay:
    case Command::Kind::automatic_delay: {
      const bool is_automatic = command.kind == Command::Kind::automatic_delay;
      if (engine.pacer() == nullptr) break;
      engine.pacer()->set_delay({.delay = is_automatic ? Nanoseconds{0} : nanoseconds(command.value),
                                 .automatic_percent = is_automatic ? command.value : 0});
      break;
    }
    case Command::Kind::extrapolate:
      engine.timeline().set_extrapolate(nanoseconds(command.value));
      if (engine.pacer() != nullptr) engine.pacer()->set_extrapolate(nanoseconds(command.value));
      break;
    case Command::Kind::servo:
      engine.intake().set_servo(command.number, static_cast<std::uint16_t>(command.value));
      break;
    case Command::Kind::when_stopped:
      engine.set_when_stopped(static_cast<WhenStopped>(command.number));
      break;
    case Command::Kind::fault_begin:
      engine.begin_truth_fault(static_cast<std::uint32_t>(command.number));
      break;
    case Command::Kind::fault_end:
      engine.end_truth_fault(static_cast<std::uint32_t>(command.number));
      break;
    case Command::Kind::fault_clear:
      engine.end_truth_faults();
      break;
    default:
      break;
  }
}

void reload(Engine& engine, Reload& reload, HostTime now) noexcept {
  for (const Command& command : reload.commands) change_session(engine, command);
  const auto channels = engine.channels();
  for (Reload::Line& line : reload.lines) channels[line.channel]->exchange_port(line);
  for (Reload::Sensor& sensor : reload.sensors) {
    if (sensor.grid && engine.schedule() != nullptr) engine.schedule()->change(sensor.channel, *sensor.grid);
    channels[sensor.channel]->exchange_sensor(sensor, now);
  }
}

// The text of a reload is long, and in pieces.
void record_reload(const Engine& engine, const Reload& reload, HostTime now) noexcept {
  constexpr std::size_t piece = std::size_t{64} * 1024;
  engine.sink().event({.type = RecordEvent::Type::command,
                       .flags = static_cast<std::uint8_t>(Command::Kind::reload),
                       .interface = RecordEvent::all_imus,
                       .a = now.ns,
                       .b = engine.polled().ns,
                       .c = static_cast<std::int64_t>(reload.text.size())});
  for (std::string_view rest = reload.text; !rest.empty(); rest.remove_prefix(std::min(piece, rest.size())))
    engine.sink().packet(0, PacketDirection::unknown, now, {std::as_bytes(std::span(rest.substr(0, piece)))});
}

void record(Engine& engine, const Command& command, HostTime now) noexcept {
  StepSink& sink = engine.sink();
  if (!sink.keeps()) return;
  if (command.kind == Command::Kind::reload) return record_reload(engine, *engine.next_reload(), now);
  const auto channels = engine.channels();
  const bool is_mark = command.kind == Command::Kind::mark;
  const auto value = has_value(command.kind) ? std::bit_cast<std::int64_t>(command.value) : engine.polled().ns;
  sink.event(
      {.type = is_mark ? RecordEvent::Type::mark : RecordEvent::Type::command,
       .flags = static_cast<std::uint8_t>(command.kind),
       .interface = command.imu < channels.size() ? channels[command.imu]->record_interface() : RecordEvent::all_imus,
       .a = now.ns,
       .b = value,
       .c = is_mark ? 0 : static_cast<std::int64_t>(command.number)});
  if (is_mark)
    sink.packet(0, PacketDirection::unknown, now, {std::as_bytes(std::span(command.text.data(), command.text_size))});
  if (command.kind == Command::Kind::fault_begin)
    sink.packet(0, PacketDirection::unknown, now,
                {std::as_bytes(std::span(engine.faults().text(static_cast<std::uint32_t>(command.number))))});
}

}  // namespace

void execute(Engine& engine, const Command& command, HostTime now) noexcept {
  if (command.kind == Command::Kind::reload && engine.next_reload() == nullptr) return;
  record(engine, command, now);
  if (command.kind == Command::Kind::reload) return reload(engine, *engine.next_reload(), now);
  const auto channels = engine.channels();
  if (command.imu < channels.size()) return change_channel(*channels[command.imu], engine.faults(), command, now);
  change_session(engine, command);
  for (const auto& channel : channels) change_channel(*channel, engine.faults(), command, now);
}

void execute_commands(Engine& engine, Host& host) noexcept {
  if (engine.control() == nullptr || !engine.control()->commands.has_batch()) return;
  RunControl& control = *engine.control();
  const HostTime now = host.now();
  constexpr int most = 4;  // batches at once, so that a flood of them does not delay samples
  const auto channels = engine.channels();
  for (int i = 0; i < most && control.applied.write_available() >= channels.size(); ++i) {
    const std::uint64_t batch = control.commands.pop([&](const Command& command) { execute(engine, command, now); });
    if (batch == 0) return;
    for (std::size_t imu = 0; imu < channels.size(); ++imu) {
      const std::optional<DeviceTime> time = channels[imu]->next_time();
      control.applied.push({.batch = batch,
                            .imu = static_cast<std::uint16_t>(imu),
                            .is_last = imu + 1 == channels.size(),
                            .has_time = time.has_value(),
                            .sample = channels[imu]->next_sample(),
                            .time_ns = time.value_or(DeviceTime{}).ns});
    }
  }
}

}  // namespace imud
