// Ports: the ports of a run, by their use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#include "transports/port.hpp"

namespace imud {

// One port of a run: its use, and the text and settings that the configuration gives it.
struct PortUse {
  enum class Of : std::uint8_t {
    truth,
    line,     // of an imu's UART, or its bus
    copy,     // of the first line's bytes (`also` in [[imu]])
    trigger,  // an input pin
    pps,      // an input pin
    pulse,    // the output pin
  };
  Of of = Of::truth;
  std::size_t imu = 0;     // its number in Config::imus
  std::size_t number = 0;  // of the UART, or of the copy
  std::string_view text = {};
  PortSettings settings = Role::device;
};

// Opens a port of the run. Real ports, the ports that a record, an array or a test has in their place, and ports that
// are not opened at all are functions of this kind. Throws PortError.
using Ports = std::function<std::unique_ptr<Port>(const PortUse&)>;

// Opens the port that the text names.
inline std::unique_ptr<Port> real_ports(const PortUse& use) { return open_port(use.text, use.settings); }

// Stands for a port that is not opened: it takes every frame, and has nothing to receive.
class NoPort : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override { counters_.count_sent(is_reply_, frames.size()); }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
  bool can_receive() const noexcept override { return false; }
  bool has_room() const noexcept override { return true; }
};
inline std::unique_ptr<Port> no_ports(const PortUse&) { return std::make_unique<NoPort>(); }

}  // namespace imud
