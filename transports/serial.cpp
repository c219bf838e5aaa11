// A serial line on real hardware. termios(3), ioctl_tty(2). LibSerial opens and configures it; reading, writing,
// rates that termios has no constant for, and reopening are done here.
#include <fcntl.h>
#include <fmt/format.h>
#include <libserial/SerialPort.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "transports/byte_writer.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/uart/termios2.hpp"
#include "transports/uart/uart_options.hpp"

namespace imud {
namespace {

using LibSerial::BaudRate;

// The speeds that termios has constants for; set_line_speed() sets any other.
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

constexpr PortOption bits_option = {.key = "bits", .help = "data bits of a character (8)", .min = 7, .max = 8};
constexpr PortOption flow_option = {.key = "flow", .help = "flow control", .choices = "none rtscts"};
constexpr PortOption serial_options[] = {baud_option, parity_option, stop_option, bits_option, flow_option};

struct Settings {
  UartSettings uart;
  bool has_seven_bits;
  bool has_flow_control;

  Settings(const PortSpec& spec, const PortSettings& settings)
      : uart(uart_settings(spec, settings, 115'200)),
        has_seven_bits(spec.integer(bits_option) == 7),
        has_flow_control(spec.one_of(flow_option) == "rtscts") {}

  unsigned bits_per_character() const { return uart.bits_per_character() - (has_seven_bits ? 1 : 0); }
};

class SerialPort final : public Port {
 public:
  SerialPort(const PortSpec& spec, const PortSettings& settings) : path_(spec.address), settings_(spec, settings) {
    const FileDescriptor probe(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!probe) {
      const int error = errno;
      throw spec.error(fmt::format("cannot open it: {}{}", std::strerror(error),
                                   error == EACCES  ? "; sudo adduser $USER dialout, then log in again"
                                   : error == EBUSY ? "; another process has locked it"
                                                    : ""));
    }
    if (::isatty(probe.get()) == 0)
      throw spec.error("is not a serial line; right would be a tty, such as /dev/ttyUSB0");
    try {
      configure();
    } catch (const std::exception& error) {
      throw spec.error(fmt::format("cannot be configured: {}", error.what()));
    }
    const unsigned actual = line_speed(line_.get()).value_or(baud_);
    if (actual * 100.0 < baud_ * 97.0 || actual * 100.0 > baud_ * 103.0)
      throw spec.error(fmt::format("baud={}: the driver gives {} instead, more than 3 % off", baud_, actual));
  }

  ~SerialPort() override {
    ::ioctl(line_.get(), TIOCNXCL);
    // If the peer withholds CTS, close() would wait for half a minute.
    if (settings_.has_flow_control) ::tcflush(line_.get(), TCOFLUSH);
  }

  void send(std::span<const Frame> frames) noexcept override {
    if ((!line_ && !reopen()) || !apply_line()) {
      counters_.dropped += frames.size();
      return;
    }
    if (writer_.write(line_.get(), frames, counters_, is_reply_) != 0) lose();
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
  void discard_pending() noexcept override { writer_.discard(counters_); }
  bool wants_output() const noexcept override { return !writer_.is_idle(); }
  int descriptor() const noexcept override { return line_.get(); }

  bool set_break(bool on) noexcept override { return line_ && ::ioctl(line_.get(), on ? TIOCSBRK : TIOCCBRK) == 0; }

  void set_line(const UartSettings& line) noexcept override {
    wanted_ = line;
    apply_line();
  }

 private:
  // Applies a change of the line when the last byte has left. Returns false until then, and if the device is lost.
  bool apply_line() noexcept {
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
    if (set_speed(line_.get())) return true;
    lose();
    return false;
  }

  bool set_speed(int fd) const noexcept {
    termios line = configured_;
    const auto standard = standard_rate(baud_);
    if (standard) ::cfsetspeed(&line, static_cast<speed_t>(*standard));
    return ::tcsetattr(fd, TCSANOW, &line) == 0 && (standard || set_line_speed(fd, baud_));
  }

  // LibSerial configures the line once. Its settings are kept and set again whenever the device comes back, because
  // version 1.0 ends the process from its destructor if the device is gone by then.
  void configure() {
    auto libserial = std::make_unique<LibSerial::SerialPort>();
    try {
      libserial->Open(path_);
      const UartSettings& uart = settings_.uart;
      libserial->SetCharacterSize(settings_.has_seven_bits ? LibSerial::CharacterSize::CHAR_SIZE_7
                                                           : LibSerial::CharacterSize::CHAR_SIZE_8);
      libserial->SetParity(uart.parity == Parity::even  ? LibSerial::Parity::PARITY_EVEN
                           : uart.parity == Parity::odd ? LibSerial::Parity::PARITY_ODD
                                                        : LibSerial::Parity::PARITY_NONE);
      libserial->SetStopBits(uart.stop_bits == 2 ? LibSerial::StopBits::STOP_BITS_2
                                                 : LibSerial::StopBits::STOP_BITS_1);
      libserial->SetFlowControl(settings_.has_flow_control ? LibSerial::FlowControl::FLOW_CONTROL_HARDWARE
                                                           : LibSerial::FlowControl::FLOW_CONTROL_NONE);
      if (const auto rate = standard_rate(uart.baud)) libserial->SetBaudRate(*rate);
      if (::tcgetattr(libserial->GetFileDescriptor(), &configured_) != 0)
        throw std::runtime_error(std::strerror(errno));
      // A second descriptor keeps DTR up while LibSerial closes its own descriptor.
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

    // With this flag the driver of an FTDI chip does not let the chip buffer bytes for 16 ms. Other drivers ignore
    // the flag.
    serial_struct driver{};
    if (::ioctl(fd, TIOCGSERIAL, &driver) == 0) {
      driver.flags |= ASYNC_LOW_LATENCY;
      ::ioctl(fd, TIOCSSERIAL, &driver);
    }
    ::tcflush(fd, TCIOFLUSH);
    return true;
  }

  // Closes the descriptor at once, because otherwise the device would come back under another name.
  void lose() noexcept {
    line_.reset();
    writer_.discard(counters_);
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
  const Settings settings_;  // at the time of opening
  termios configured_{};     // applied again when the device is back
  unsigned baud_ = settings_.uart.baud;
  std::optional<UartSettings> wanted_;  // settings to apply when all bytes sent have left
  FileDescriptor line_;                 // closed while the device is lost
  BackOff back_off_;
  ByteWriter writer_;
  std::array<std::byte, 256> buffer_;
};

void check(const PortSpec& spec, const PortSettings& settings) { static_cast<void>(Settings(spec, settings)); }

WireTime wire_time(const PortSpec& spec, const PortSettings& settings, const Frame& frame) {
  const Settings line(spec, settings);
  return uart_wire_time(frame, line.uart.baud, line.bits_per_character());
}

}  // namespace

extern constexpr Transport serial_transport = {
    .name = "serial",
    .summary = "a serial line; reopened automatically after it was unplugged",
    .syntax = "serial:/dev/ttyUSB0?baud=921600&parity=none|even|odd&stop=1|2&bits=8|7&flow=none|rtscts",
    .example = "serial:/dev/ttyUSB0?baud=921600",
    .document = "termios(3)",
    .options = serial_options,
    .brings_truth = true,
    .has_path = true,
    .uart = Uart::real,
    .check = check,
    .open = open_as<SerialPort>,
    .wire_time = wire_time,
};

}  // namespace imud
