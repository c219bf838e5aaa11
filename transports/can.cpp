// SocketCAN, raw. https://docs.kernel.org/networking/can.html, linux/can/raw.h, linux/can/error.h.
#include <fmt/format.h>
#include <net/if.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <string>

#include "transports/can/can_port.hpp"
#include "transports/can/can_socket.hpp"

namespace imud {
namespace {

constexpr PortOption mtu_option = {
    .key = "mtu", .help = "16: classic frames only; 72: CAN FD is required", .choices = "any 16 72"};
constexpr PortOption confirm_option = {
    .key = "confirm", .help = "the interface confirms each frame that it has sent", .choices = "no yes"};
constexpr PortOption wait_option = {
    .key = "wait", .help = "waits for an interface that does not exist yet", .choices = "no yes"};
constexpr PortOption can_options[] = {bitrate_option, data_bitrate_option, mtu_option, frames_per_s_option,
                                      max_age_option, confirm_option,      wait_option};

void check(const PortSpec& spec, const PortSettings& settings) {
  if (settings.sends_fd && spec.one_of(mtu_option) == "16")
    throw spec.error("mtu=16: the device sends frames of CAN FD, which need 72; omit mtu");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  if (spec.address.size() >= IFNAMSIZ)
    throw spec.error("the name is too long for an interface; right would be a name such as can0");
  const std::string mtu = spec.one_of(mtu_option);
  auto port = std::make_unique<CanPort>(
      spec, settings, std::make_unique<CanSocket>(spec.address, spec.one_of(confirm_option) == "yes"), mtu != "16");
  if (::if_nametoindex(spec.address.c_str()) == 0) {
    if (spec.one_of(wait_option) != "yes")
      throw spec.error("there is no such interface; 'ip link' lists the interfaces, and wait=yes waits for it");
    port->await();
    return port;
  }
  if (const int error = port->bind(); error == EAFNOSUPPORT || error == EPROTONOSUPPORT)
    throw spec.error("this kernel has no CAN; sudo modprobe can_raw");
  else if (error != 0)
    throw spec.error(fmt::format("cannot be bound: {}; is it a CAN interface?", std::strerror(error)));
  if (mtu == "72" && !port->carries_fd())
    throw spec.error(fmt::format("mtu=72: it carries no FD frames; ip link set {} mtu 72", spec.address));
  return port;
}

}  // namespace

extern constexpr Transport can_transport = {
    .name = "can",
    .summary = "a CAN or CAN FD interface of SocketCAN",
    .syntax = "can:can0?bitrate=500000&data_bitrate=2000000&mtu=72",
    .example = "can:can0?bitrate=500000",
    .document = "https://docs.kernel.org/networking/can.html",
    .options = can_options,
    .carries_can = true,
    .keeps_datagrams = true,
    .is_shared = true,
    .check = check,
    .open = open,
    .wire_time = can_wire_time,
};

}  // namespace imud
