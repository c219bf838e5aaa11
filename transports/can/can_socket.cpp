#include "transports/can/can_socket.hpp"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <string_view>

#include "transports/host_clock.hpp"

namespace imud {
namespace {

can_filter kernel_filter(const CanFilter& filter) noexcept {
  can_filter out{};
  out.can_id = filter.id | (filter.extended ? CAN_EFF_FLAG : 0) | (filter.data ? 0 : CAN_RTR_FLAG) |
               (filter.inverted ? CAN_INV_FILTER : 0);
  out.can_mask = (filter.mask & (filter.extended ? CAN_EFF_MASK : CAN_SFF_MASK)) | CAN_EFF_FLAG |
                 (filter.data && filter.remote ? 0 : CAN_RTR_FLAG);
  return out;
}

// Converts a kernel's time stamp of CLOCK_REALTIME to the time of arrival. If the stamp is in the future or older
// than a second, CLOCK_REALTIME was stepped, and the present time is returned.
HostTime arrival(const timespec& stamp) noexcept {
  constexpr Nanoseconds oldest = std::chrono::seconds(1);
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const Nanoseconds age{std::int64_t{now.tv_sec - stamp.tv_sec} * 1'000'000'000 + now.tv_nsec - stamp.tv_nsec};
  return host_now() - (age > Nanoseconds{0} && age < oldest ? age : Nanoseconds{0});
}

}  // namespace

int CanSocket::bind() noexcept {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface_.c_str()));
  if (address.can_ifindex == 0) return ENODEV;  // 0 would bind all interfaces
  FileDescriptor fresh(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  const int on = 1;
  const int own = confirm_ ? 1 : 0;
  const can_err_mask_t all_errors = CAN_ERR_MASK;
  if (!fresh || ::setsockopt(fresh.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
      ::setsockopt(fresh.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors) != 0 ||
      ::setsockopt(fresh.get(), SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &own, sizeof own) != 0 ||
      ::setsockopt(fresh.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 || apply_filters(fresh.get()) != 0)
    return errno;
  // Room for a second of a full bus at 1 Mbit/s while the receiver is held up; beyond rmem_max only with
  // CAP_NET_ADMIN.
  const int room = 4 << 20;
  if (::setsockopt(fresh.get(), SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room) != 0)
    ::setsockopt(fresh.get(), SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  if (::bind(fresh.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return errno;
  index_ = address.can_ifindex;
  socket_ = std::move(fresh);
  return 0;
}

void CanSocket::set_filters(std::span<const CanFilter> filters) noexcept {
  filtered_ = filters.size() <= max_filters;
  filter_count_ = filtered_ ? filters.size() : 0;
  std::transform(filters.begin(), filters.begin() + static_cast<std::ptrdiff_t>(filter_count_), filters_.begin(),
                 kernel_filter);
  if (socket_) apply_filters(socket_.get());
}

int CanSocket::apply_filters(int descriptor) const noexcept {
  const can_filter everything{};
  return filtered_ ? ::setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FILTER, filters_.data(),
                                  static_cast<socklen_t>(filter_count_ * sizeof(can_filter)))
                   : ::setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FILTER, &everything, sizeof everything);
}

int CanSocket::send(std::span<const Message> frames) noexcept {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    pieces_[i] = {const_cast<canfd_frame*>(frames[i].frame), frames[i].fd ? CANFD_MTU : CAN_MTU};
    messages_[i] = {};
    messages_[i].msg_hdr.msg_iov = &pieces_[i];
    messages_[i].msg_hdr.msg_iovlen = 1;
  }
  return ::sendmmsg(socket_.get(), messages_.data(), static_cast<unsigned>(frames.size()), 0);
}

int CanSocket::receive(canfd_frame& frame, Received& received) noexcept {
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(timespec))> control;
  iovec piece{&frame, sizeof frame};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(socket_.get(), &message, 0);
  if (size < 0) return errno == EAGAIN || errno == EINTR ? 0 : -1;
  received = {size == static_cast<ssize_t>(CANFD_MTU), (message.msg_flags & MSG_CONFIRM) != 0, {}};
  const cmsghdr* header = CMSG_FIRSTHDR(&message);
  if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_TIMESTAMPNS) {
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
    received.time = arrival(stamp);
  } else {
    received.time = host_now();
  }
  return size == static_cast<ssize_t>(CAN_MTU) || received.fd ? 1 : 0;
}

int CanSocket::pending_error() const noexcept {
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

bool CanSocket::query(unsigned long request, ifreq& answer) const noexcept {
  ifreq name{};
  name.ifr_ifindex = index_;
  if (::ioctl(socket_.get(), SIOCGIFNAME, &name) != 0) return false;
  std::copy(std::begin(name.ifr_name), std::end(name.ifr_name), answer.ifr_name);
  return ::ioctl(socket_.get(), request, &answer) == 0;
}

int CanSocket::mtu() const noexcept {
  ifreq answer{};
  return query(SIOCGIFMTU, answer) ? answer.ifr_mtu : 0;
}

bool CanSocket::is_up() const noexcept {
  ifreq answer{};
  return query(SIOCGIFFLAGS, answer) && (answer.ifr_flags & IFF_UP) != 0;
}

bool CanSocket::is_virtual() const noexcept {
  ethtool_drvinfo driver{};
  driver.cmd = ETHTOOL_GDRVINFO;
  ifreq answer{};
  answer.ifr_data = reinterpret_cast<char*>(&driver);
  if (!query(SIOCETHTOOL, answer)) return true;
  const std::string_view name(driver.driver, ::strnlen(driver.driver, sizeof driver.driver));
  return name.empty() || name == "vcan" || name == "vxcan";
}

}  // namespace imud
