// SocketCAN, raw. https://docs.kernel.org/networking/can.html, linux/can/raw.h, linux/can/error.h.
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "transports/can_bits.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

// The kernel accepts FD lengths that no DLC stands for.
constexpr std::size_t fd_length(std::size_t size) {
  for (const std::size_t legal : {8UL, 12UL, 16UL, 20UL, 24UL, 32UL, 48UL})
    if (size <= legal) return size < 8 ? size : legal;
  return CANFD_MAX_DLEN;
}

class CanPort final : public Port {
 public:
  explicit CanPort(const PortSpec& spec) : name_(spec.address), wanted_mtu_(spec.one_of("mtu", "any 16 72")) {
    if (name_.size() >= IFNAMSIZ) throw spec.error("no interface has so long a name; right would be such as can0");
    if (::if_nametoindex(name_.c_str()) == 0)
      throw spec.error("there is no such interface; 'ip link' shows those there are");
    if (const int error = bind_by_name(); error == EAFNOSUPPORT || error == EPROTONOSUPPORT)
      throw spec.error("this kernel has no CAN; sudo modprobe can_raw");
    else if (error != 0)
      throw spec.error(fmt::format("cannot be bound: {}; is it a CAN interface?", std::strerror(error)));
    if (wanted_mtu_ == "72" && !carries_fd_)
      throw spec.error(fmt::format("mtu=72: it carries no FD frames; ip link set {} mtu 72", name_));
  }

  void send(std::span<const Frame> frames) noexcept override {
    if (!bound_ && !rebind()) {
      counters_.dropped += frames.size();
      return;
    }
    // In bus-off the kernel takes frames and throws them away. It ends by a restart, which receive() hears of, or
    // with the interface taken down and up, which the socket reports.
    if (bus_off_ && pending_error() == 0) {
      counters_.dropped += frames.size();
      return;
    }
    bus_off_ = false;
    if (state_ == PortState::lost) look_at_mtu();
    bool all_taken = true;
    while (all_taken && !frames.empty()) {
      const auto batch = frames.first(std::min(frames.size(), messages_.size()));
      all_taken = send_batch(batch);
      frames = frames.subspan(batch.size());
    }
    counters_.dropped += frames.size();
  }

  std::optional<Received> receive() noexcept override {
    if (!bound_ && !rebind()) return std::nullopt;
    // One attempt more: the first may only report that the interface went down.
    for (int attempt = 0; attempt < 2; ++attempt) {
      iovec piece{&incoming_, sizeof incoming_};
      msghdr message{};
      message.msg_iov = &piece;
      message.msg_iovlen = 1;
      const ssize_t size = ::recvmsg(socket_.get(), &message, 0);
      if (size == CAN_MTU || size == CANFD_MTU) return taken_in(size == CANFD_MTU);
      if (size < 0 && errno != EAGAIN && errno != EINTR) {
        bus_off_ = false;
        lose(errno);
      }
    }
    return std::nullopt;
  }

  int descriptor() const noexcept override { return bound_ ? socket_.get() : -1; }

 private:
  // Returns 0 or an errno. Takes a new socket each time: one whose interface went has lost its filters.
  int bind_by_name() noexcept {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(name_.c_str()));
    if (address.can_ifindex == 0) return ENODEV;  // 0 would be all interfaces
    FileDescriptor fresh(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    const int on = 1;
    const can_err_mask_t all_errors = CAN_ERR_MASK;
    if (!fresh || ::setsockopt(fresh.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        ::setsockopt(fresh.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors) != 0 ||
        ::bind(fresh.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      return errno;
    socket_ = std::move(fresh);
    bound_ = true;
    bus_off_ = false;
    look_at_mtu();
    if (const int down = pending_error(); down != 0)
      lose(down);
    else
      state_ = PortState::ready;
    return 0;
  }

  // What the socket would report at its next use; asking clears it.
  int pending_error() const noexcept {
    int error = 0;
    socklen_t size = sizeof error;
    ::getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    return error;
  }

  bool rebind() noexcept { return back_off_.due() && bind_by_name() == 0; }

  // What the kernel knows of the interface; zero if it is gone.
  ifreq ask(unsigned long what) const noexcept {
    ifreq request{};
    name_.copy(request.ifr_name, IFNAMSIZ - 1);
    return ::ioctl(socket_.get(), what, &request) == 0 ? request : ifreq{};
  }
  void look_at_mtu() noexcept {
    carries_fd_ = ask(SIOCGIFMTU).ifr_mtu >= static_cast<int>(CANFD_MTU) && wanted_mtu_ != "16";
  }

  void lose(int error) noexcept {
    if (error == EAGAIN || error == ENOBUFS) return;  // full; not lost
    if (state_ != PortState::lost) ++counters_.lost_count;
    state_ = PortState::lost;
    if (error != ENODEV && error != ENXIO) return;  // down: bound still
    if (bound_) back_off_.start();
    bound_ = false;
  }

  // False if the kernel did not take all that the interface can carry.
  bool send_batch(std::span<const Frame> batch) noexcept {
    unsigned count = 0;
    for (const Frame& frame : batch)
      if (pack(frame, outgoing_[count], pieces_[count])) ++count;
    for (unsigned i = 0; i < count; ++i) {
      messages_[i] = {};
      messages_[i].msg_hdr.msg_iov = &pieces_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
    }

    int taken = count == 0 ? 0 : ::sendmmsg(socket_.get(), messages_.data(), count, 0);
    // A socket reports an interface that went down, perhaps long ago, by failing once: try again.
    if (taken < 0 && errno == ENETDOWN) taken = ::sendmmsg(socket_.get(), messages_.data(), count, 0);
    if (taken < 0) lose(errno);
    if (taken > 0) state_ = PortState::ready;
    const auto sent = static_cast<unsigned>(std::max(taken, 0));
    counters_.sent += sent;
    counters_.dropped += batch.size() - sent;
    return sent == count;
  }

  // False if the interface cannot carry the frame.
  bool pack(const Frame& frame, canfd_frame& out, iovec& piece) const noexcept {
    const CanHeader& header = frame.can;
    const std::size_t limit = header.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
    if (frame.bytes.size() > limit || header.error || (header.fd && (header.remote || !carries_fd_))) return false;
    if (header.id > (header.extended ? CAN_EFF_MASK : CAN_SFF_MASK)) return false;

    out = {};
    out.can_id = header.id | (header.extended ? CAN_EFF_FLAG : 0) | (header.remote ? CAN_RTR_FLAG : 0);
    out.len = static_cast<std::uint8_t>(header.fd ? fd_length(frame.bytes.size()) : frame.bytes.size());
    if (header.fd) out.flags = static_cast<std::uint8_t>(CANFD_FDF | (header.bit_rate_switch ? CANFD_BRS : 0));
    std::memcpy(out.data, frame.bytes.data(), frame.bytes.size());
    piece = {&out, header.fd ? CANFD_MTU : CAN_MTU};
    return true;
  }

  Received taken_in(bool fd) noexcept {
    const canid_t id = incoming_.can_id;
    CanHeader header;
    header.error = (id & CAN_ERR_FLAG) != 0;
    header.extended = (id & CAN_EFF_FLAG) != 0 && !header.error;
    header.remote = (id & CAN_RTR_FLAG) != 0;
    header.id = id & (header.error ? CAN_ERR_MASK : header.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    header.fd = fd;
    header.bit_rate_switch = fd && (incoming_.flags & CANFD_BRS) != 0;
    ++counters_.received;

    bus_off_ =
        header.error && (bus_off_ || (header.id & CAN_ERR_BUSOFF) != 0) && (header.id & CAN_ERR_RESTARTED) == 0;
    if (bus_off_)
      lose(ENETDOWN);
    else if (state_ == PortState::lost && (ask(SIOCGIFFLAGS).ifr_flags & IFF_UP) != 0)
      state_ = PortState::ready;
    const std::size_t size = std::min<std::size_t>(incoming_.len, CANFD_MAX_DLEN);
    return {{std::as_bytes(std::span(incoming_.data, size)), header}, host_now()};
  }

  const std::string name_;
  const std::string wanted_mtu_;
  FileDescriptor socket_;
  bool bound_ = false;
  bool carries_fd_ = false;
  bool bus_off_ = false;
  BackOff back_off_;
  canfd_frame incoming_{};
  std::array<canfd_frame, FrameBuffer::max_frames> outgoing_;
  std::array<iovec, FrameBuffer::max_frames> pieces_;
  std::array<mmsghdr, FrameBuffer::max_frames> messages_;
};

void check(const PortSpec& spec, const PortSettings&) {
  spec.allow_only("bitrate data_bitrate mtu");
  spec.integer("bitrate", 5'000, 1'000'000);
  spec.integer("data_bitrate", 5'000, 20'000'000);
}

WireTime wire_time(const PortSpec& spec, const PortSettings&, const Frame& frame) {
  const CanBits bits = can_bits(frame.can, frame.bytes.size());
  WireTime time;
  time.bits = bits.nominal + bits.data;
  time.bit_rate = static_cast<double>(spec.integer("bitrate", 5'000, 1'000'000).value_or(0));
  if (time.bit_rate == 0) return time;
  const auto data_bit_rate = spec.integer("data_bitrate", 5'000, 20'000'000);
  time.seconds = bits.nominal / time.bit_rate +
                 bits.data / (data_bit_rate ? static_cast<double>(*data_bit_rate) : time.bit_rate);
  return time;
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings&) { return std::make_unique<CanPort>(spec); }

}  // namespace

extern const Transport can_transport;
constexpr Transport can_transport = {
    .name = "can",
    .summary = "a CAN or CAN FD interface of SocketCAN",
    .syntax = "can:can0?bitrate=500000&data_bitrate=2000000&mtu=72",
    .document = "https://docs.kernel.org/networking/can.html",
    .carries_can = true,
    .keeps_datagrams = true,
    .is_shared = true,
    .check = check,
    .open = open,
    .wire_time = wire_time,
};

}  // namespace imud
