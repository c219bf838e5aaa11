// The commands of clients, and the parts of them that change the pacing of a Loop.
#include "emulator/drive/loop.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/imu/reload.hpp"

namespace imud {

// Must not be called between the reception of a sample by its device and the transmission of the sample's frames.
[[gnu::noinline]] void Loop::cycle_power(HostTime now) noexcept {
  engine_.apply(Step::power_cycle(now));
  hosts_.touch_all();
}

// Executes the waiting batches, but not more than a few. Must be called when each sample that was taken has been
// transmitted. A batch keeps waiting while there is no room for its results.
void Loop::execute_commands() noexcept {
  RunControl& control = *engine_.control();
  const HostTime now = host_.now();
  constexpr int most = 4;  // batches at once, so that a flood of them does not delay samples
  const auto channels = engine_.channels();
  for (int i = 0; i < most && control.applied.write_available() >= channels.size(); ++i) {
    const std::uint64_t batch = control.commands.pop([&](const Command& command) { execute(command, now); });
    if (batch == 0) return;
    for (std::size_t imu = 0; imu < channels.size(); ++imu) {
      const std::optional<DeviceTime> time = channels[imu]->sensor.clock().next_sample();
      control.applied.push({.batch = batch,
                            .imu = static_cast<std::uint16_t>(imu),
                            .is_last = imu + 1 == channels.size(),
                            .has_time = time.has_value(),
                            .sample = channels[imu]->sensor.imu().next(),
                            .time_ns = time.value_or(DeviceTime{}).ns});
    }
  }
}

void Loop::execute(const Command& command, HostTime now) noexcept {
  Reload* const reload = command.kind == Command::Kind::reload ? engine_.control()->reload : nullptr;
  const std::span text(command.text.data(), command.text_size);
  const Step::Content content{.frame = {std::as_bytes(text)}, .reload = reload};
  engine_.apply(Step::command(command, now, &content));
  hosts_.touch_all();
  change_pacing(command);
  if (reload == nullptr) return;
  for (const Command& change : reload->commands) change_pacing(change);
  for (const Reload::Sensor& sensor : reload->sensors)
    if (sensor.grid) {
      schedule_.change(sensor.channel, *sensor.grid);
      epoch_.change(sensor.channel);
    }
}

void Loop::change_pacing(const Command& command) noexcept {
  switch (command.kind) {
    case Command::Kind::delay:
      pacer_.set_delay({.delay = nanoseconds(command.value), .automatic_percent = 0});
      break;
    case Command::Kind::automatic_delay:
      pacer_.set_delay({.delay = Nanoseconds{0}, .automatic_percent = command.value});
      break;
    case Command::Kind::extrapolate:
    case Command::Kind::mark:
    case Command::Kind::power_off:
    case Command::Kind::power_on:
    case Command::Kind::power_cycle:
    case Command::Kind::pause:
    case Command::Kind::resume:
    case Command::Kind::seed:
    case Command::Kind::gyro_bias:
    case Command::Kind::accelerometer_bias:
    case Command::Kind::when_stopped:
    case Command::Kind::log_level:
    case Command::Kind::fault_begin:
    case Command::Kind::fault_end:
    case Command::Kind::fault_clear:
    case Command::Kind::servo:
    case Command::Kind::reload:
      break;  // these pace nothing
  }
}

}  // namespace imud
