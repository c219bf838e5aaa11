// The rest of a CAN bus: its interfaces, other nodes, and a controller simulated by a pseudo-terminal.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

inline bool run_command(const std::string& command) {
  return std::system(("PATH=$PATH:/usr/sbin:/sbin; " + command + " 2>/dev/null").c_str()) == 0;
}
inline bool ip(const std::string& arguments) { return run_command("ip " + arguments); }

// Another node on the bus.
class Node {
 public:
  enum class Buffer { large, by_default };  // the receive buffer of its socket
  explicit Node(const std::string& interface, Buffer buffer = Buffer::large) {
    socket_.reset(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
    const int on = 1, room = 4 << 20;
    ::setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    if (buffer == Buffer::large) ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    EXPECT_NE(address.can_ifindex, 0) << interface;
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0) << interface;
  }
  struct Received {
    canfd_frame frame;
    bool fd;
  };
  // Returns the next frame; nullopt if none arrives within `timeout_ms`.
  std::optional<Received> receive(int timeout_ms = 200) const {
    pollfd ready{socket_.get(), POLLIN, 0};
    Received got{};
    if (::poll(&ready, 1, timeout_ms) != 1) return std::nullopt;
    const ssize_t size = ::read(socket_.get(), &got.frame, sizeof got.frame);
    if (size < 0) return std::nullopt;
    got.fd = size == CANFD_MTU;
    return got;
  }
  // Returns when the kernel received the last frame that receive() returned. The first call, before any frame, only
  // switches this on.
  std::chrono::microseconds last_time() const {
    timeval time{};
    ::ioctl(socket_.get(), SIOCGSTAMP, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::microseconds(time.tv_usec);
  }
  // Discards frames up to the first frame with this identifier (flags as in can_id), and returns that frame; nullopt
  // if there is none within a minute.
  std::optional<canfd_frame> receive_id(canid_t id) const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (std::chrono::steady_clock::now() < end)
      if (const auto got = receive(); got && got->frame.can_id == id) return got->frame;
    return std::nullopt;
  }
  std::vector<Received> receive_all() const {
    std::vector<Received> all;
    while (const auto got = receive()) all.push_back(*got);
    return all;
  }
  void send(const canfd_frame& frame, bool fd) const {
    const auto size = static_cast<ssize_t>(fd ? CANFD_MTU : CAN_MTU);
    EXPECT_EQ(::write(socket_.get(), &frame, static_cast<std::size_t>(size)), size);
  }
  void send(canid_t id, std::initializer_list<std::uint8_t> data) const {
    canfd_frame frame{};
    frame.can_id = id;
    frame.len = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), frame.data);
    send(frame, false);
  }

 private:
  FileDescriptor socket_;
};

// A controller on a serial line for the driver slcan; the other end of the line is a thread of the test.
class LineController {
 public:
  LineController() {
    master_.reset(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    EXPECT_TRUE(master_ && ::grantpt(master_.get()) == 0 && ::unlockpt(master_.get()) == 0);
    char slave[64];
    ::ptsname_r(master_.get(), slave, sizeof slave);
    line_.reset(::open(slave, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    termios raw{};
    ::tcgetattr(line_.get(), &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(line_.get(), TCSANOW, &raw);
    const int slcan = 17;
    EXPECT_EQ(::ioctl(line_.get(), TIOCSETD, &slcan), 0);
    ifreq request{};
    EXPECT_EQ(::ioctl(line_.get(), SIOCGIFNAME, request.ifr_name), 0);
    name = request.ifr_name;
    answering_ = std::thread([this] { answer(); });
  }
  ~LineController() {
    ending_ = true;
    answering_.join();
  }
  void send(std::string_view command) const {
    EXPECT_EQ(::write(master_.get(), command.data(), command.size()), static_cast<ssize_t>(command.size()));
  }
  // Returns the number of frames received over the line. Waits until there are `expected` frames, but at most a
  // minute (the guest may be held up for long), and then 200 ms more for surplus frames.
  std::uint64_t frames(std::uint64_t expected) const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (frames_ < expected && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    return frames_;
  }

  // Returns the frames received so far, without the carriage return.
  std::vector<std::string> lines() {
    const std::lock_guard lock(mutex_);
    return lines_;
  }

  std::string name;
  std::atomic<bool> reading = true;

 private:
  void answer() {
    std::string line;
    char bytes[64];
    while (!ending_) {
      pollfd ready{master_.get(), POLLIN, 0};
      const ssize_t size =
          reading && ::poll(&ready, 1, 10) == 1 ? ::read(master_.get(), bytes, sizeof bytes) : ssize_t{0};
      if (size <= 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      for (ssize_t i = 0; i < size; ++i) {
        if (bytes[i] != '\r') {
          line += bytes[i];
          continue;
        }
        send("\r");
        if (line.starts_with('t')) {
          const std::lock_guard lock(mutex_);
          lines_.push_back(line);
          ++frames_;
        }
        line.clear();
      }
    }
  }

  FileDescriptor master_, line_;
  std::atomic<bool> ending_ = false;
  std::atomic<std::uint64_t> frames_ = 0;
  std::mutex mutex_;
  std::vector<std::string> lines_;
  std::thread answering_;
};

}  // namespace imud
