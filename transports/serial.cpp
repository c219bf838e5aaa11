// A serial line on real hardware, opened and configured by LibSerial. termios(3), ioctl_tty(2).
#include <fcntl.h>
#include <fmt/format.h>
#include <libserial/SerialPort.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "transports/byte_writer.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/termios2.hpp"

namespace imud {
namespace {

using LibSerial::BaudRate;

// The speeds that termios has constants for; any other goes by set_line_speed().
std::optional<BaudRate> standard_rate(unsigned baud) {
  static constexpr std::pair<unsigned, speed_t> rates[] = {
      {50, B50},           {75, B75},           {110, B110},         {134, B134},         {150, B150},
      {200, B200},         {300, B300},         {600, B600},         {1200, B1200},       {1800, B1800},
      {2400, B2400},       {4800, B4800},       {9600, B9600},       {19200, B19200},     {38400, B38400},
      {57600, B57600},     {115200, B115200},   {230400, B230400},   {460800, B460800},   {500000, B500000},
      {576000, B576000},   {921600, B921600},   {1000000, B1000000}, {1152000, B1152000}, {1500000, B1500000},
      {2000000, B2000000}, {2500000, B2500000}, {3000000, B3000000}, {3500000, B3500000}, {4000000, B4000000},
  };
  for (const auto& [rate, constant] : rates)
    if (rate == baud) return BaudRate{constant};
  return std::nullopt;
}

struct Settings {
  unsigned baud;
  LibSerial::CharacterSize bits;
  LibSerial::Parity parity;
  LibSerial::StopBits stop;
  LibSerial::FlowControl flow;

  explicit Settings(const PortSpec& spec)
      : baud(static_cast<unsigned>(spec.integer("baud", 50, 4'000'000).value_or(115200))),
        bits(spec.integer("bits", 7, 8).value_or(8) == 8 ? LibSerial::CharacterSize::CHAR_SIZE_8
                                                         : LibSerial::CharacterSize::CHAR_SIZE_7),
        stop(spec.integer("stop", 1, 2).value_or(1) == 1 ? LibSerial::StopBits::STOP_BITS_1
                                                         : LibSerial::StopBits::STOP_BITS_2) {
    const std::string parity_word = spec.one_of("parity", "none even odd");
    parity = parity_word == "even"  ? LibSerial::Parity::PARITY_EVEN
             : parity_word == "odd" ? LibSerial::Parity::PARITY_ODD
                                    : LibSerial::Parity::PARITY_NONE;
    flow = spec.one_of("flow", "none rtscts") == "none" ? LibSerial::FlowControl::FLOW_CONTROL_NONE
                                                        : LibSerial::FlowControl::FLOW_CONTROL_HARDWARE;
  }
};

class SerialPort final : public Port {
 public:
  explicit SerialPort(const PortSpec& spec) : path_(spec.address), settings_(spec) {
    const FileDescriptor probe(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!probe) {
      const int error = errno;
      throw spec.error(fmt::format("cannot open it: {}{}", std::strerror(error),
                                   error == EACCES  ? "; sudo adduser $USER dialout, then log in again"
                                   : error == EBUSY ? "; another process has it for itself"
                                                    : ""));
    }
    if (::isatty(probe.get()) == 0) throw spec.error("is no serial line; right would be a tty, such as /dev/ttyUSB0");
    try {
      configure();
    } catch (const std::exception& error) {
      throw spec.error(fmt::format("cannot be configured: {}", error.what()));
    }
    const unsigned actual = line_speed(line_.get()).value_or(settings_.baud);
    if (actual * 100.0 < settings_.baud * 97.0 || actual * 100.0 > settings_.baud * 103.0)
      throw spec.error(
          fmt::format("baud={}: the driver gives {} instead, more than 3 % off", settings_.baud, actual));
  }

  ~SerialPort() override {
    ::ioctl(line_.get(), TIOCNXCL);
    // A peer that holds CTS back would let close() wait for half a minute.
    if (settings_.flow != LibSerial::FlowControl::FLOW_CONTROL_NONE) ::tcflush(line_.get(), TCOFLUSH);
  }

  void send(std::span<const Frame> frames) noexcept override {
    if ((!line_ && !reopen()) || !settle()) {
      counters_.dropped += frames.size();
      return;
    }
    if (writer_.write(line_.get(), frames, counters_) != 0) lose();
  }

  std::optional<Received> receive() noexcept override {
    if (!line_ && !reopen()) return std::nullopt;
    const ssize_t size = ::read(line_.get(), buffer_.data(), buffer_.size());
    if (size > 0) {
      ++counters_.received;
      return Received{{{buffer_.data(), static_cast<std::size_t>(size)}}, host_now()};
    }
    if (size == 0 || (errno != EAGAIN && errno != EINTR)) lose();
    return std::nullopt;
  }

  void flush() noexcept override {
    if (line_) send({});
  }
  bool wants_output() const noexcept override { return !writer_.is_idle(); }
  int descriptor() const noexcept override { return line_.get(); }

  void set_line(const UartSettings& line) noexcept override {
    wanted_ = line;
    settle();
  }

 private:
  // Takes up a change of the line when the last byte is out. False until then.
  bool settle() noexcept {
    if (!wanted_) return true;
    if (!line_) return false;
    int unsent = 0;
    if (!writer_.is_idle() || ::ioctl(line_.get(), TIOCOUTQ, &unsent) != 0 || unsent > 0) return false;
    configured_.c_cflag &= ~static_cast<tcflag_t>(PARENB | PARODD | CSTOPB);
    if (wanted_->parity != Parity::none) configured_.c_cflag |= PARENB;
    if (wanted_->parity == Parity::odd) configured_.c_cflag |= PARODD;
    if (wanted_->stop_bits == 2) configured_.c_cflag |= CSTOPB;
    baud_ = wanted_->baud;
    wanted_.reset();
    if (!set_speed(line_.get())) lose();
    return true;
  }

  bool set_speed(int fd) const noexcept {
    termios line = configured_;
    const auto standard = standard_rate(baud_);
    if (standard) ::cfsetspeed(&line, static_cast<speed_t>(*standard));
    return ::tcsetattr(fd, TCSANOW, &line) == 0 && (standard || set_line_speed(fd, baud_));
  }

  // LibSerial sets the line up once; what it made is kept and set again whenever the device comes back, because
  // LibSerial cannot let go of a device that is gone: version 1.0 then ends the process from its destructor.
  void configure() {
    auto libserial = std::make_unique<LibSerial::SerialPort>();
    try {
      libserial->Open(path_);
      libserial->SetCharacterSize(settings_.bits);
      libserial->SetParity(settings_.parity);
      libserial->SetStopBits(settings_.stop);
      libserial->SetFlowControl(settings_.flow);
      if (const auto rate = standard_rate(settings_.baud)) libserial->SetBaudRate(*rate);
      if (::tcgetattr(libserial->GetFileDescriptor(), &configured_) != 0)
        throw std::runtime_error(std::strerror(errno));
      // A second descriptor keeps DTR up while LibSerial closes its own.
      line_.reset(::fcntl(libserial->GetFileDescriptor(), F_DUPFD_CLOEXEC, 0));
      libserial->Close();
    } catch (...) {
      static_cast<void>(libserial.release());
      throw;
    }
    if (!set_up(line_.get())) throw std::runtime_error(std::strerror(errno));
  }

  bool set_up(int fd) const noexcept {
    if (::ioctl(fd, TIOCEXCL) != 0 || !set_speed(fd)) return false;
    const int flags = ::fcntl(fd, F_GETFL);
    if (flags < 0 || ::fcntl(fd, F_SETFL, flags | O_NONBLOCK) != 0) return false;

    // Where the driver has it: no 16 ms in which an FTDI chip gathers bytes.
    serial_struct driver{};
    if (::ioctl(fd, TIOCGSERIAL, &driver) == 0) {
      driver.flags |= ASYNC_LOW_LATENCY;
      ::ioctl(fd, TIOCSSERIAL, &driver);
    }
    ::tcflush(fd, TCIOFLUSH);
    return true;
  }

  // The descriptor is closed at once, or the device would come back under another name.
  void lose() noexcept {
    line_.reset();
    writer_.forget(counters_);
    state_ = PortState::lost;
    ++counters_.lost_count;
    back_off_.start();
  }

  bool reopen() noexcept {
    if (!back_off_.due()) return false;
    line_.reset(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (line_ && !set_up(line_.get())) line_.reset();
    if (!line_) return false;
    state_ = PortState::ready;
    return true;
  }

  const std::string path_;
  const Settings settings_;  // as opened
  termios configured_{};     // as it is to be
  unsigned baud_ = settings_.baud;
  std::optional<UartSettings> wanted_;  // as soon as what was sent is out
  FileDescriptor line_;                 // closed while the device is lost
  BackOff back_off_;
  ByteWriter writer_;
  std::array<std::byte, 256> buffer_;
};

void check(const PortSpec& spec, Role) {
  spec.allow_only("baud parity stop bits flow");
  static_cast<void>(Settings(spec));
}

std::unique_ptr<Port> open(const PortSpec& spec, Role) { return std::make_unique<SerialPort>(spec); }

}  // namespace

extern const Transport serial_transport;
constexpr Transport serial_transport = {
    .name = "serial",
    .summary = "a serial line; reopened by itself when it was unplugged",
    .syntax = "serial:/dev/ttyUSB0?baud=921600&parity=none|even|odd&stop=1|2&bits=8|7&flow=none|rtscts",
    .document = "termios(3)",
    .carries_can = false,
    .check = check,
    .open = open,
};

}  // namespace imud
