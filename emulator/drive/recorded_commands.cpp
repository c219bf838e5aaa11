// The commands of a record: the clients' commands, and the faults and reloads that they began.
#include <string>
#include <utility>
#include <vector>

#include "emulator/config/scenario.hpp"
#include "emulator/drive/recorded_run.hpp"

namespace imud {

void RecordedRun::repeat_command(const RecordEvent& event) noexcept {
  if (static_cast<Command::Kind>(event.flags) == Command::Kind::reload) {
    poll(event.b);
    ++reloads_missing_;
    reload_ = event;
    return reload_text_.clear();
  }
  if (static_cast<Command::Kind>(event.flags) != Command::Kind::fault_begin) return propose(event);
  ++faults_missing_;
  begin_fault_ = event;
}

// The record has a fault of several imus once for each imu.
void RecordedRun::begin_fault(const RecordEvent& event, std::span<const std::byte> text) {
  FaultBook& faults = engine_->faults();
  const auto number = static_cast<std::uint64_t>(event.c);
  if (number == faults.all().size() && !faults.is_full()) {
    std::string keys(reinterpret_cast<const char*>(text.data()), text.size());
    std::vector<std::string> wrong;
    FaultConfig fault = read_begun_fault(keys, number, imus_, wrong);
    if (wrong.empty() && !has_frame_faults_ && fault.kind->acts_on_frames) fault.imus.clear();
    if (wrong.empty()) faults.add(std::move(fault), std::move(keys));
  }
  if (number < faults.configured().size() || number >= faults.all().size()) return;
  --faults_missing_;
  propose(event);
}

}  // namespace imud
