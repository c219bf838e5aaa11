// The services of the node. It answers each service that it has. It refuses, in the service's own way, a service that
// it only knows. DroneCAN has no refusal of an unknown service.
#pragma once

#include <span>

#include "protocols/dronecan/node.hpp"

namespace imud::dronecan {

// Return the service, or the message that the node sends, with that id, or nullptr.
const DataType* find_service(unsigned id) noexcept;
const DataType* find_message(unsigned id) noexcept;

// FrameSeal::reseal(), of a transfer of several frames that the node sends, and FrameSeal::transfer().
std::span<std::byte> reseal(std::span<std::byte> data, const CanHeader& can) noexcept;
std::size_t transfer_frames(std::span<const Frame> frames) noexcept;

enum class Served : std::uint8_t {
  answered,
  restart,    // answered; the node restarts
  malformed,  // the request is too short, or impossible: there is no answer
};

// Executes a request of a service that find_service() returns, and writes the response.
Served serve(const DataType& service, std::span<const std::byte> request, DeviceTime now, Node& node,
             Payload& response) noexcept;

}  // namespace imud::dronecan
