// The serial devices and CAN interfaces of this machine.
#pragma once

#include <string>
#include <vector>

namespace imud {

struct FoundPort {
  std::string address;  // a path of a device, or the name of an interface
  std::string words;    // its device, its driver
};

// Returns the serial devices: those with a name in /dev/serial/by-id by that, then other USB adapters, then UARTs of
// the board that exist, which are the ones that have a driver and a type.
std::vector<FoundPort> found_serial_ports();

// Returns the interfaces of SocketCAN.
std::vector<FoundPort> found_can_interfaces();

}  // namespace imud
