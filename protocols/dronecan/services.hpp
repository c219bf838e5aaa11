// The services of the node. The node answers each service that it has. It refuses other services that it knows, each
// by the error in the response of this service. DroneCAN has no refusal of an unknown service.
#pragma once

#include <span>

#include "protocols/dronecan/node.hpp"

namespace imud::dronecan {

// Return the service with this id, or the message with this id that the node sends; nullptr if there is none.
const DataType* find_service(unsigned id) noexcept;
const DataType* find_message(unsigned id) noexcept;

// FrameSeal::reseal() and FrameSeal::transfer(), for transfers of several frames that the node sends.
std::span<std::byte> reseal(std::span<std::byte> data, const CanHeader& can) noexcept;
std::size_t transfer_frames(std::span<const Frame> frames) noexcept;

enum class Served : std::uint8_t {
  answered,
  restart,    // answered; the node restarts
  malformed,  // the request is too short, or impossible: there is no answer
};

// Executes a request, and writes the response. `service`: from find_service().
Served serve(const DataType& service, std::span<const std::byte> request, DeviceTime now, Node& node,
             Payload& response) noexcept;

}  // namespace imud::dronecan
