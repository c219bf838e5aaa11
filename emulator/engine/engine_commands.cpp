// The commands that an Engine executes.
#include <algorithm>
#include <string_view>

#include "emulator/engine/engine.hpp"
#include "emulator/imu/reload.hpp"

namespace imud {

// A mark's text, a begun fault and a reload's text, which is long, follow the event as packets.
void Engine::offer_command(const Step& step) noexcept {
  RecordEvent event = step.event;
  const Step::Content content = step.content != nullptr ? *step.content : Step::Content{};
  if (content.reload != nullptr) event.c = static_cast<std::int64_t>(content.reload->text.size());
  keep(event, step.imu);
  const auto add = [&](std::string_view text) {
    sink_.packet(0, PacketDirection::unknown, HostTime{step.event.a}, {std::as_bytes(std::span(text))});
  };
  if (step.event.type == Step::Type::mark)
    return sink_.packet(0, PacketDirection::unknown, HostTime{step.event.a}, content.frame);
  if (step.command_kind() == Command::Kind::fault_begin && step.command_number() >= faults_.configured().size())
    add(faults_.text(static_cast<std::uint32_t>(step.command_number())));
  if (content.reload == nullptr) return;
  constexpr std::size_t piece = std::size_t{64} * 1024;
  for (std::string_view rest = content.reload->text; !rest.empty(); rest.remove_prefix(std::min(piece, rest.size())))
    add(rest.substr(0, piece));
}

void Engine::execute(const Step& step) noexcept {
  const HostTime now{step.event.a};
  const bool is_reload = step.event.type == Step::Type::command && step.command_kind() == Command::Kind::reload;
  if (is_reload) return reload(*step.content->reload, now);
  const Command command{
      .kind = step.command_kind(), .imu = step.imu, .value = step.command_value(), .number = step.command_number()};
  if (step.imu < channels_.size()) return channels_[step.imu]->execute(command, faults_, now);
  change(command);
  for (const auto& channel : channels_) channel->execute(command, faults_, now);
}

// Executes the commands that change the handling of truth.
void Engine::change(const Command& command) noexcept {
  const auto fault = static_cast<std::uint32_t>(command.number);
  switch (command.kind) {
    case Command::Kind::extrapolate:
      timeline_.set_extrapolate(nanoseconds(command.value));
      break;
    case Command::Kind::servo:
      intake_.set_servo(command.number, static_cast<std::uint16_t>(command.value));
      break;
    case Command::Kind::when_stopped:
      when_stopped_ = static_cast<WhenStopped>(command.number);
      break;
    case Command::Kind::fault_begin:
      if (truth_faults_ != nullptr && faults_[fault].acts_on(fault_of_truth))
        truth_faults_->schedule().add(faults_[fault], fault);
      break;
    case Command::Kind::fault_end:
      if (truth_faults_ != nullptr) truth_faults_->schedule().end(fault);
      break;
    case Command::Kind::fault_clear:
      if (truth_faults_ != nullptr) truth_faults_->schedule().end_all();
      break;
    case Command::Kind::mark:
    case Command::Kind::power_off:
    case Command::Kind::power_on:
    case Command::Kind::power_cycle:
    case Command::Kind::pause:
    case Command::Kind::resume:
    case Command::Kind::seed:
    case Command::Kind::gyro_bias:
    case Command::Kind::accelerometer_bias:
    case Command::Kind::delay:
    case Command::Kind::automatic_delay:
    case Command::Kind::log_level:
    case Command::Kind::reload:
      break;  // not a change of the truth
  }
}

void Engine::reload(Reload& reload, HostTime now) noexcept {
  for (const Command& command : reload.commands) change(command);
  for (Reload::Line& line : reload.lines) channels_[line.channel]->exchange(line);
  for (Reload::Sensor& sensor : reload.sensors) channels_[sensor.channel]->exchange(sensor, now);
}

}  // namespace imud
