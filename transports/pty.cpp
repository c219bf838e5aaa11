// A pseudo-terminal behind a link: the sensor's serial line without hardware. pty(7), ioctl_tty(2).
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <tuple>

#include "transports/byte_writer.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/termios2.hpp"

namespace imud {
namespace {

constexpr std::string_view slaves = "/dev/pts/";

bool make_raw(int fd) noexcept {
  termios line{};
  if (::tcgetattr(fd, &line) != 0) return false;
  ::cfmakeraw(&line);
  return ::tcsetattr(fd, TCSANOW, &line) == 0;
}

// Whether the pty that `link` points to still belongs to the process that made the link. A number is given to the
// next pty as soon as it is free: one that is younger than the link is somebody else's. I/O does not touch st_ctim.
bool is_served(const std::string& link) noexcept {
  struct stat made {
  }, pty{};
  if (::lstat(link.c_str(), &made) != 0 || ::stat(link.c_str(), &pty) != 0) return false;
  return std::tie(pty.st_ctim.tv_sec, pty.st_ctim.tv_nsec) <= std::tie(made.st_mtim.tv_sec, made.st_mtim.tv_nsec);
}

// The other end of the pair is a client that comes and goes.
class PtyDevice final : public Port {
 public:
  explicit PtyDevice(const PortSpec& spec) : link_(spec.address) {
    const auto failed = [&](std::string_view what) {
      return spec.error(fmt::format("{}: {}", what, std::strerror(errno)));
    };
    master_.reset(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!master_ || ::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0) throw failed("no pty to be had");
    int number = 0;
    if (::ioctl(master_.get(), TIOCGPTN, &number) != 0) throw failed("no pty to be had");
    slave_ = fmt::format("{}{}", slaves, number);

    // Opened once and closed: from now on poll() tells whether somebody has it open.
    const FileDescriptor slave(::open(slave_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!slave || !make_raw(slave.get())) throw failed(slave_);
    if (const auto baud = spec.integer("baud", 50, 4'000'000))
      if (!set_line_speed(slave.get(), static_cast<unsigned>(*baud))) throw failed("baud");

    make_link(spec);
    state_ = PortState::no_reader;
  }

  ~PtyDevice() override {
    std::error_code error;
    if (std::filesystem::read_symlink(link_, error) == slave_) std::filesystem::remove(link_, error);
  }

  void send(std::span<const Frame> frames) noexcept override {
    // A reader that has left is noticed a little later, and what it did not read taken back then.
    constexpr Nanoseconds often_enough = std::chrono::milliseconds(5);
    const HostTime now = host_now();
    if ((state_ == PortState::ready && now - looked_ < often_enough) || look_for_reader())
      writer_.write(master_.get(), frames, counters_);
    else
      counters_.dropped += frames.size();
  }

  std::optional<Received> receive() noexcept override {
    const ssize_t size = ::read(master_.get(), buffer_.data(), buffer_.size());
    if (size > 0) {
      ++counters_.received;
      return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
    }
    look_for_reader();
    return std::nullopt;
  }

  void flush() noexcept override { send({}); }

  bool is_read() noexcept override {
    if (!look_for_reader()) return true;
    flush();
    const FileDescriptor slave(::open(slave_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    // poll(), unlike FIONREAD, also sees what is still on its way from the master.
    pollfd unread{slave.get(), POLLIN, 0};
    return !slave || ::poll(&unread, 1, 0) <= 0;
  }

  // Without a reader poll() would return at once for ever.
  int descriptor() const noexcept override { return state_ == PortState::ready ? master_.get() : -1; }

 private:
  void make_link(const PortSpec& spec) const {
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::file_status old = fs::symlink_status(link_, error);
    if (fs::is_symlink(old)) {
      const std::string target = fs::read_symlink(link_, error).string();
      if (!target.starts_with(slaves))
        throw spec.error(fmt::format("is a link to {}, not to a pty; it is left alone, choose another name", target));
      if (target != slave_ && is_served(link_))
        throw spec.error(
            fmt::format("another process serves it ({}); stop that one, choose another name, or remove the "
                        "link",
                        target));
    } else if (fs::exists(old)) {
      throw spec.error("exists and is no link; it is left alone, choose another name");
    }

    // The new link takes the old one's place in one step.
    const std::string fresh = fmt::format("{}.{}.{}", link_, ::getpid(), slave_.substr(slaves.size()));
    fs::create_symlink(slave_, fresh, error);
    if (!error) fs::rename(fresh, link_, error);
    if (error) {
      std::error_code ignored;
      fs::remove(fresh, ignored);
      throw spec.error(fmt::format("cannot make the link: {}", error.message()));
    }
  }

  bool look_for_reader() noexcept {
    pollfd master{master_.get(), 0, 0};
    ::poll(&master, 1, 0);
    const bool present = (master.revents & POLLHUP) == 0;
    if (!present && state_ == PortState::ready) discard_unread();
    state_ = present ? PortState::ready : PortState::no_reader;
    looked_ = host_now();
    return present;
  }

  // What the last reader left unread would wait for the next one; only the slave can flush all of it. What the reader
  // sent to us stays.
  void discard_unread() noexcept {
    writer_.forget(counters_);
    const FileDescriptor slave(::open(slave_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (slave) ::tcflush(slave.get(), TCIFLUSH);
  }

  const std::string link_;
  std::string slave_;
  FileDescriptor master_;
  HostTime looked_;  // for a reader
  ByteWriter writer_;
  std::array<std::byte, 4096> buffer_;
};

// The client's end.
class PtyListener final : public Port {
 public:
  explicit PtyListener(const PortSpec& spec) {
    tty_.reset(::open(spec.address.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!tty_)
      throw spec.error(fmt::format("cannot open it: {}{}", std::strerror(errno),
                                   errno == ENOENT || errno == EIO ? "; is the one running that serves it?" : ""));
    if (!make_raw(tty_.get())) throw spec.error("is no terminal");
    if (const auto baud = spec.integer("baud", 50, 4'000'000))
      set_line_speed(tty_.get(), static_cast<unsigned>(*baud));
  }

  void send(std::span<const Frame> frames) noexcept override { writer_.write(tty_.get(), frames, counters_); }

  std::optional<Received> receive() noexcept override {
    const ssize_t size = ::read(tty_.get(), buffer_.data(), buffer_.size());
    if (size > 0) {
      ++counters_.received;
      return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
    }
    if (size == 0 || (errno != EAGAIN && errno != EINTR)) at_end_ = true;
    return std::nullopt;
  }

  void flush() noexcept override { send({}); }
  bool at_end() const noexcept override { return at_end_; }
  int descriptor() const noexcept override { return tty_.get(); }

 private:
  FileDescriptor tty_;
  bool at_end_ = false;
  ByteWriter writer_;
  std::array<std::byte, 4096> buffer_;
};

void check(const PortSpec& spec, Role) {
  spec.allow_only("baud");
  spec.integer("baud", 50, 4'000'000);
}

std::unique_ptr<Port> open(const PortSpec& spec, Role role) {
  if (role == Role::device) return std::make_unique<PtyDevice>(spec);
  return std::make_unique<PtyListener>(spec);
}

}  // namespace

extern const Transport pty_transport;
constexpr Transport pty_transport = {
    .name = "pty",
    .summary = "a serial line without hardware: a pseudo-terminal behind the link of that name",
    .syntax = "pty:LINK?baud=115200",
    .document = "pty(7)",
    .carries_can = false,
    .check = check,
    .open = open,
};

}  // namespace imud
