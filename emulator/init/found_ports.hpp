// The serial devices and CAN interfaces of this machine.
#pragma once

#include <string>
#include <vector>

namespace imud {

struct FoundPort {
  std::string address;  // a path of a device, or the name of an interface
  std::string words;    // words for people: the device and the driver
};

// Returns the serial devices: first the devices that have a name in /dev/serial/by-id, under this name, then other
// USB adapters, then the UARTs of the board. A UART exists if it has a driver and a type; others are not returned.
std::vector<FoundPort> found_serial_ports();

// Returns the interfaces of SocketCAN.
std::vector<FoundPort> found_can_interfaces();

}  // namespace imud
