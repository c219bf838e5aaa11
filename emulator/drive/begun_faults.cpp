#include "emulator/drive/begun_faults.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "emulator/config/scenario.hpp"
#include "emulator/imu/command.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"

namespace imud {

std::vector<FaultConfig> begun_faults(const Config& config) {
  std::vector<FaultConfig> begun;
  if (!config.control.faults) return begun;
  PcapngReader reader(PortSpec::parse(config.truth.port));
  std::optional<std::size_t> number;  // of the fault whose keys are the next packet of the events
  while (!reader.at_end()) {
    const auto packet = reader.next();
    if (!packet || reader.interfaces()[packet->interface].link_type != link_type::event) continue;
    if (const auto event = decode_record_event(packet->bytes)) {
      const bool begins = event->type == RecordEvent::Type::command &&
                          static_cast<Command::Kind>(event->flags) == Command::Kind::fault_begin;
      number = begins ? std::optional(static_cast<std::size_t>(event->c)) : std::nullopt;
    } else if (std::exchange(number, std::nullopt) == config.faults.size() + begun.size()) {
      const std::string_view keys(reinterpret_cast<const char*>(packet->bytes.data()), packet->bytes.size());
      std::vector<std::string> wrong;
      FaultConfig fault = read_begun_fault(keys, config.faults.size() + begun.size(), config.imus, wrong);
      if (wrong.empty()) begun.push_back(std::move(fault));
    }
  }
  return begun;
}

}  // namespace imud
