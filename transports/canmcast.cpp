// A CAN bus of UDP datagrams to a multicast group, as ArduPilot's SITL has it by default (SIM_CAN_TYPE1 1) and
// pydronecan's driver `mcast:`. No kernel module, no privileges; every process that has joined the group is on the
// bus. ArduPilot, libraries/AP_HAL_SITL/CAN_Multicast.cpp and AP_HAL/CANIface.h; pydronecan,
// dronecan/driver/mcast.py.
//
// Group 239.65.82.BUS, port 57732. A datagram is a frame, little-endian:
//
// | offset | type | field                                                                                |
// |--------|------|--------------------------------------------------------------------------------------|
// | 0      | u16  | 0x2934                                                                               |
// | 2      | u16  | CRC-16-CCITT-FALSE of all that follows                                               |
// | 4      | u16  | flags: 1 CAN FD                                                                      |
// | 6      | u32  | identifier; bit 31 extended, bit 30 remote, bit 29 error frame, as in linux/can.h    |
// | 10     | ...  | data, up to 64 bytes                                                                 |
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "transports/can/can_dlc.hpp"
#include "transports/can/can_filters.hpp"
#include "transports/can/can_port.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/socket/socket_address.hpp"

namespace imud {
namespace {

constexpr std::uint16_t udp_port = 57732, magic = 0x2934, fd_flag = 1;
constexpr std::size_t header_size = 10, longest = header_size + CANFD_MAX_DLEN;
using Datagram = std::array<std::uint8_t, longest>;

std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept {
  std::uint32_t crc = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    crc ^= std::uint32_t{byte} << 8U;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1U) ^ ((crc & 0x8000U) != 0 ? 0x1021U : 0U);
  }
  return static_cast<std::uint16_t>(crc);
}

void put(std::uint8_t* at, std::uint32_t value, int bytes) noexcept {
  for (int i = 0; i < bytes; ++i) at[i] = static_cast<std::uint8_t>(value >> 8 * i);
}
std::uint32_t get(const std::uint8_t* at, int bytes) noexcept {
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= std::uint32_t{at[i]} << 8 * i;
  return value;
}

// Returns the size of the datagram.
std::size_t encode(const canfd_frame& frame, bool fd, Datagram& out) noexcept {
  const std::size_t size = header_size + frame.len;
  put(&out[0], magic, 2);
  put(&out[4], fd ? fd_flag : 0, 2);
  put(&out[6], frame.can_id, 4);
  std::copy_n(frame.data, frame.len, &out[header_size]);
  put(&out[2], crc16(std::span(out).subspan(4, size - 4)), 2);
  return size;
}

// Returns false if the datagram contains no valid frame.
bool decode(std::span<const std::uint8_t> datagram, canfd_frame& frame, bool& fd) noexcept {
  if (datagram.size() < header_size || datagram.size() > longest || get(&datagram[0], 2) != magic ||
      get(&datagram[2], 2) != crc16(datagram.subspan(4)))
    return false;
  const std::span<const std::uint8_t> data = datagram.subspan(header_size);
  fd = (get(&datagram[4], 2) & fd_flag) != 0;
  frame = {};
  frame.can_id = get(&datagram[6], 4);
  frame.len = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data);
  return fd ? fd_length(data.size()) == data.size() : data.size() <= CAN_MAX_DLEN;
}

SocketAddress group_of(int bus) {
  constexpr in_addr_t base = 0xEF41'5200;  // 239.65.82.0
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(udp_port);
  address.sin_addr.s_addr = htonl(base + static_cast<in_addr_t>(bus));
  SocketAddress group;
  group.size = sizeof address;
  std::memcpy(&group.storage, &address, sizeof address);
  return group;
}

// Sends from a separate socket. The address of this socket identifies the link's own frames when they are
// received. ArduPilot does the same.
class MulticastLink final : public CanLink {
 public:
  // `interface`: the network interface; empty: the interface to which the routes lead.
  MulticastLink(int bus, std::string interface) : group_(group_of(bus)), interface_(std::move(interface)) {}

  int bind() noexcept override {
    ip_mreqn request{};
    request.imr_multiaddr = reinterpret_cast<const sockaddr_in&>(group_.storage).sin_addr;
    if (!interface_.empty()) {
      request.imr_ifindex = static_cast<int>(::if_nametoindex(interface_.c_str()));
      if (request.imr_ifindex == 0) return ENODEV;
    }
    FileDescriptor in(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    FileDescriptor out(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!in || !out) return errno;
    const int on = 1, off = 0;
    // Room for a second of a full bus while the receiver is held up; beyond rmem_max only with CAP_NET_ADMIN.
    const int room = 8 << 20;
    if (::setsockopt(in.get(), SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room) != 0)
      ::setsockopt(in.get(), SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    if (::setsockopt(in.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        ::bind(in.get(), group_.get(), group_.size) != 0 ||
        ::setsockopt(in.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request) != 0 ||
        ::setsockopt(in.get(), IPPROTO_IP, IP_MULTICAST_ALL, &off, sizeof off) != 0)
      return errno;
    if (!interface_.empty() && ::setsockopt(out.get(), IPPROTO_IP, IP_MULTICAST_IF, &request, sizeof request) != 0)
      return errno;
    if (::connect(out.get(), group_.get(), group_.size) != 0) return errno;
    own_ = SocketAddress::bound(out.get()).endpoint();
    in_ = std::move(in);
    out_ = std::move(out);
    return 0;
  }
  void unbind() noexcept override {
    in_.reset();
    out_.reset();
  }
  bool is_bound() const noexcept override { return static_cast<bool>(in_); }
  int descriptor() const noexcept override { return in_.get(); }
  void set_filters(std::span<const CanFilter> filters) noexcept override { filters_.set(filters); }

  int send(std::span<const Message> frames) noexcept override {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      pieces_[i] = {datagrams_[i].data(), encode(*frames[i].frame, frames[i].fd, datagrams_[i])};
      messages_[i] = {};
      messages_[i].msg_hdr.msg_iov = &pieces_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
    }
    return ::sendmmsg(out_.get(), messages_.data(), static_cast<unsigned>(frames.size()), MSG_NOSIGNAL);
  }

  int receive(canfd_frame& frame, Received& received) noexcept override {
    constexpr int most = 256;  // frames that are passed over in one call, so that the caller can do other work
    for (int i = 0; i < most; ++i) {
      std::array<std::uint8_t, longest + 1> datagram;
      SocketAddress from;
      from.size = sizeof from.storage;
      const ssize_t size = ::recvfrom(in_.get(), datagram.data(), datagram.size(), 0, from.room(), &from.size);
      if (size < 0) return errno == EAGAIN || errno == EINTR ? 0 : -1;
      if (from.endpoint() == own_) continue;
      received = {false, false, host_now(), false};
      received.malformed = !decode(std::span(datagram).first(static_cast<std::size_t>(size)), frame, received.fd);
      if (received.malformed || passes(frame)) return 1;
    }
    return 0;
  }

 private:
  bool passes(const canfd_frame& frame) const noexcept {
    CanHeader header;
    header.error = (frame.can_id & CAN_ERR_FLAG) != 0;
    header.extended = (frame.can_id & CAN_EFF_FLAG) != 0;
    header.remote = (frame.can_id & CAN_RTR_FLAG) != 0;
    header.id = frame.can_id & (header.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    return filters_.pass(header);
  }

  const SocketAddress group_;
  const std::string interface_;
  FileDescriptor in_, out_;
  Endpoint own_;  // of out_
  CanFilters filters_;
  std::array<Datagram, max_batch> datagrams_;
  std::array<iovec, max_batch> pieces_;
  std::array<mmsghdr, max_batch> messages_;
};

constexpr PortOption interface_option = {
    .key = "interface", .help = "network interface of the group; without it the one to which the routes lead"};
constexpr PortOption canmcast_options[] = {bitrate_option, data_bitrate_option, interface_option, frames_per_s_option,
                                           max_age_option};

void check(const PortSpec& spec, const PortSettings&) {
  if (spec.address.size() != 1 || spec.address[0] < '0' || spec.address[0] > '9')
    throw spec.error("the address is the number of the bus, from 0 to 9; ArduPilot's first one is canmcast:0");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  const std::string interface = spec.text(interface_option.key).value_or("");
  auto port = std::make_unique<CanPort>(spec, settings,
                                        std::make_unique<MulticastLink>(spec.address[0] - '0', interface), true);
  if (!interface.empty() && ::if_nametoindex(interface.c_str()) == 0)
    throw spec.error(fmt::format("interface={}: there is no such network interface", interface));
  if (const int error = port->bind(); error == ENETUNREACH || error == ENODEV)
    throw spec.error(
        "no route leads to its group, 239.65.82.0/24; without a network, sudo ip route add 239.65.82.0/24 dev lo, or "
        "interface=lo on both sides");
  else if (error != 0)
    throw spec.error(fmt::format("cannot join the multicast group: {}", std::strerror(error)));
  return port;
}

}  // namespace

extern constexpr Transport canmcast_transport = {
    .name = "canmcast",
    .summary = "a CAN bus of UDP multicast datagrams: ArduPilot's SITL, pydronecan's mcast",
    .syntax = "canmcast:0?bitrate=1000000&interface=eth0",
    .example = "canmcast:0?bitrate=1000000",
    .document = "ArduPilot, libraries/AP_HAL_SITL/CAN_Multicast.cpp",
    .options = canmcast_options,
    .carries_can = true,
    .keeps_datagrams = true,
    .is_shared = true,
    .check = check,
    .open = open,
    .wire_time = can_wire_time,
};

}  // namespace imud
