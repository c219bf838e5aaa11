// The commands of a record: the clients' commands, and the faults and reloads that they began.
#include <algorithm>
#include <bit>
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/scenario.hpp"
#include "emulator/drive/execute.hpp"
#include "emulator/drive/recorded_run.hpp"

namespace imud {

void RecordedRun::repeat_command(const RecordEvent& event) noexcept {
  if (static_cast<Command::Kind>(event.flags) == Command::Kind::reload) {
    poll(event.b);
    ++reloads_missing_;
    reload_ = event;
    return reload_text_.clear();
  }
  if (static_cast<Command::Kind>(event.flags) != Command::Kind::fault_begin) return execute_for_imus(event);
  ++faults_missing_;
  begin_fault_ = event;
}

// A fault of several imus is in the record with each.
void RecordedRun::begin_fault(const RecordEvent& event, std::span<const std::byte> text) {
  FaultBook& faults = engine_->faults();
  const auto number = static_cast<std::uint64_t>(event.c);
  if (number == faults.all().size() && !faults.is_full()) {
    std::string keys(reinterpret_cast<const char*>(text.data()), text.size());
    std::vector<std::string> wrong;
    FaultConfig fault = read_begun_fault(keys, number, imus_, wrong);
    if (wrong.empty()) faults.add(std::move(fault), std::move(keys));
  }
  if (number < faults.configured().size() || number >= faults.all().size()) return;
  --faults_missing_;
  execute_for_imus(event);
}

void RecordedRun::execute_for_imus(const RecordEvent& event) noexcept {
  Command command = {.kind = static_cast<Command::Kind>(event.flags),
                     .value = std::bit_cast<double>(event.b),
                     .number = static_cast<std::uint64_t>(event.c)};
  if (!has_value(command.kind)) poll(event.b);
  if (event.interface == RecordEvent::all_imus) return imud::execute(*engine_, command, HostTime{event.a});
  const auto all = engine_->channels();
  for_imus(event, [&](const Channel& channel) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& c) { return c.get() == &channel; });
    command.imu = static_cast<std::uint16_t>(found - all.begin());
    imud::execute(*engine_, command, HostTime{event.a});
  });
}

}  // namespace imud
