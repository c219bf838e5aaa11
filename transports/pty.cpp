// A pseudo-terminal behind a link: the sensor's serial line without hardware. pty(7), ioctl_tty(2).
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>

#include "transports/byte_writer.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"
#include "transports/uart/paced_writer.hpp"
#include "transports/uart/pty_access.hpp"
#include "transports/uart/pty_keeper.hpp"
#include "transports/uart/pty_pair.hpp"
#include "transports/uart/termios2.hpp"
#include "transports/uart/uart_options.hpp"
#include "transports/uart/uart_wire.hpp"

namespace imud {
namespace {

constexpr PortOption speed_option = {
    .key = "speed",
    .help = "line: a client at another speed than the line's gets garbage; any: it gets valid data",
    .choices = "line any",
    .device_only = true};

// imud's end of the pty, as the sensor. A client opens and closes the other end at will. If the link has a keeper,
// the keeper owns the pty, and speed and settings stay as the client has left them.
class PtyDevice final : public Port {
 public:
  PtyDevice(const PortSpec& spec, const PortSettings& settings)
      : access_(spec),
        kept_(take_kept_pty(spec)),
        pty_(kept_ ? PtyPair(spec, std::move(kept_->master)) : PtyPair(spec)),
        line_(uart_settings(spec, settings, 0)),
        any_speed_(spec.one_of(speed_option) == "any") {
    if (settings.paced) paced_.emplace();
    if (!set_first_speed()) throw spec.error(fmt::format("baud: {}", std::strerror(errno)));
    if (const int error = access_.apply(pty_.open_slave().get()); error != 0) throw PtyAccess::refusal(spec, error);
    if (kept_)
      next_keeper_.emplace(spec);
    else
      pty_.make_link(spec);
    state_ = PortState::no_reader;
    if (kept_) resume();
  }

  // A paced port drops frames that would have to wait too long for the line.
  void send(std::span<const Frame> frames) noexcept override {
    constexpr Nanoseconds sample_wait = std::chrono::milliseconds(100), reply_wait = std::chrono::milliseconds(500);
    if (!has_reader()) {
      counters_.dropped += frames.size();
    } else if (paced_) {
      write_received();
      paced_->queue(frames, line_, host_now(), is_reply_ ? reply_wait : sample_wait, counters_, is_reply_);
    } else if (state_ == PortState::wrong_speed) {
      write_garbage(frames);
    } else {
      writer_.write(pty_.master(), frames, counters_, is_reply_);
    }
  }

  void discard_pending() noexcept override {
    writer_.discard(counters_);
    if (paced_) paced_->discard(counters_);
  }

  std::optional<Received> receive() noexcept override {
    // Garbage is computed bit by bit: only a little is read at a time, so that a flood does not delay samples.
    constexpr std::size_t little = 64;
    const ssize_t size =
        ::read(pty_.master(), buffer_.data(), state_ == PortState::wrong_speed ? little : buffer_.size());
    if (size <= 0) {
      if (size < 0 && errno == EAGAIN)
        has_reader();
      else
        check_reader();
      return std::nullopt;
    }
    const auto bytes = as_device_receives(std::span(buffer_).first(static_cast<std::size_t>(size)));
    if (bytes.empty()) return std::nullopt;
    ++counters_.received;
    return Received{{bytes}, host_now()};
  }

  void set_line(const UartSettings& line) noexcept override {
    if (line.baud != 0) line_ = line;
  }

  // The keeper has a copy of the master, so that its client is not hung up.
  void set_connected(bool connected) noexcept override {
    if (kept_ || connected == is_connected_) return;
    is_connected_ = connected;
    if (connected) {
      reconnect();
      return;
    }
    lose_client();
    pty_.hang_up();
    speeds_ = {};
    state_ = PortState::lost;
  }

  void flush() noexcept override {
    if (!paced_ || next_flush() <= host_now()) send({});
  }
  std::optional<HostTime> next_flush() const noexcept override {
    return paced_ ? paced_->next_flush() : std::nullopt;
  }

  bool wants_output() const noexcept override { return !writer_.is_idle(); }

  bool is_drained() noexcept override {
    if (!check_reader()) return true;
    flush();
    const HostTime now = host_now();
    if (paced_ && !paced_->is_idle()) {
      empty_since_ = now;
      return false;
    }
    if (counters_.sent == 0) return true;
    const FileDescriptor slave = pty_.open_slave();
    // poll(), unlike FIONREAD, also finds bytes that are still on their way from the master. It does not find
    // bytes for which there was no room until the client's read() that makes room has ended; this may take a
    // while, because the client may have to wait for a processor.
    constexpr auto read_takes = std::chrono::milliseconds(40);
    pollfd unread{slave.get(), POLLIN, 0};
    if (!empty_since_ || ::poll(&unread, 1, 0) > 0) empty_since_ = now;
    return !slave || now - *empty_since_ >= read_takes;
  }

  // -1 without a reader, because poll() would always return at once.
  int descriptor() const noexcept override { return is_open() ? pty_.master() : -1; }

 private:
  // Returns true if a client has the pty open, as last seen.
  bool is_open() const noexcept { return state_ != PortState::no_reader && state_ != PortState::lost; }

  // Sets the line's speed, unless a client of a kept pty has set a speed. A client has set the speed if it differs
  // from the speed of the earlier device, or if it was set by a constant of termios, which set_line_speed() does
  // not use. Returns false, with errno, on failure.
  bool set_first_speed() noexcept {
    constexpr unsigned of_new_pty = 38400;  // tty_std_termios in Linux' tty_io.c
    const auto speed = line_speed(pty_.master());
    const bool is_earlier_devices = kept_ && speed == kept_->speed && !has_speed_constant(pty_.master());
    if (line_.baud == 0 || (speed != of_new_pty && !is_earlier_devices)) return true;
    const FileDescriptor slave = pty_.open_slave();
    if (!set_line_speed(slave.get(), line_.baud)) return false;
    if (kept_) kept_->keep_speed(line_.baud);
    return true;
  }

  // Called after the keeper has ended. Serves the client of the old pty until there is another keeper; then the
  // link leads to the pty of that keeper.
  void follow_keeper() noexcept {
    std::optional<KeptPty> next = next_keeper_->take();
    if (!next || !pty_.replace(std::move(next->master))) return;
    kept_ = std::move(next);
    lose_client();
    set_first_speed();
    access_.apply(pty_.open_slave().get());
    state_ = PortState::no_reader;
  }

  // Discards the bytes on their way between imud and a client that no longer has the pty.
  void lose_client() noexcept {
    ++counters_.lost_count;
    writer_.discard(counters_);
    if (paced_) paced_->discard(counters_);
    to_client_.idle();
    from_client_.idle();
  }

  // Makes another pty in place of one that was hung up. If that fails, check_reader() tries again.
  bool reconnect() noexcept {
    if (pty_.renew() && set_first_speed() && access_.apply(pty_.open_slave().get()) == 0 && pty_.renew_link()) {
      state_ = PortState::no_reader;
      return true;
    }
    pty_.hang_up();
    back_off_.start();
    return false;
  }

  // Discards bytes that the client sent while no device was there, and bytes that a former client did not read.
  void resume() noexcept {
    while (::read(pty_.master(), buffer_.data(), buffer_.size()) > 0) {
    }
    state_ = PortState::ready;
    check_reader();
  }

  // Checks for a reader at most every 5 ms. When it finds that the reader has left, it discards what that reader had
  // not read.
  bool has_reader() noexcept {
    constexpr Nanoseconds between_checks = std::chrono::milliseconds(5);
    if (!is_open() || host_now() - checked_ >= between_checks) return check_reader();
    if (has_wrong_speeds()) state_ = state_with_reader();
    return true;
  }

  bool check_reader() noexcept {
    if (pty_.master() < 0 && !(is_connected_ && back_off_.due() && reconnect())) return false;
    if (kept_ && !kept_->connection) follow_keeper();
    std::array<pollfd, 2> ends{{{pty_.master(), 0, 0}, {kept_ ? kept_->connection.get() : -1, 0, 0}}};
    ::poll(ends.data(), ends.size(), 0);
    if (ends[1].revents != 0) {
      kept_->connection.reset();
      next_keeper_->start();
    }
    const bool present = (ends[0].revents & POLLHUP) == 0;
    if (!present && state_ != PortState::no_reader) discard_unread();
    state_ = present ? state_with_reader() : PortState::no_reader;
    checked_ = host_now();
    return present;
  }

  // Compares the client's speed with the line's; 0 means no speed. The master reports the slave's settings.
  PortState state_with_reader() noexcept {
    speeds_ = {line_now().baud, line_speed(pty_.master()).value_or(0)};
    return has_wrong_speeds() && speeds_.client != 0 && !speeds_match(speeds_.line, speeds_.client, line_now())
               ? PortState::wrong_speed
               : PortState::ready;
  }

  // Returns true if the client's speed can be wrong; then the speed is checked for each frame.
  bool has_wrong_speeds() const noexcept { return !any_speed_ && line_now().baud != 0; }

  // Queued characters are sent with the settings that applied when they were queued.
  const UartSettings& line_now() const noexcept { return paced_ && !paced_->is_idle() ? paced_->line() : line_; }

  void write_received() noexcept {
    const HostTime now = host_now();
    for (auto bytes = paced_->ready(now); !bytes.empty(); bytes = paced_->ready(now)) {
      state_ = state_with_reader();
      std::size_t count = bytes.size();
      if (state_ == PortState::wrong_speed) {
        const auto garbage = as_client_receives(bytes, count == paced_->queued());
        [[maybe_unused]] const ssize_t taken = ::write(pty_.master(), garbage.data(), garbage.size());
      } else {
        count = static_cast<std::size_t>(std::max<ssize_t>(::write(pty_.master(), bytes.data(), count), 0));
      }
      paced_->written(count, now, counters_);
      if (count < bytes.size()) break;
    }
  }

  // Garbage that the kernel does not take is dropped.
  void write_garbage(std::span<const Frame> frames) noexcept {
    writer_.write(pty_.master(), {}, counters_);
    for (const Frame& frame : frames) {
      const auto garbage = as_client_receives(frame.bytes, &frame == &frames.back());
      const bool taken = writer_.is_idle() && ::write(pty_.master(), garbage.data(), garbage.size()) >= 0;
      if (taken)
        counters_.count_sent(is_reply_);
      else
        ++counters_.dropped;
    }
  }

  // Returns the bytes that the client receives at its own speed. `last`: the line is idle afterwards.
  std::span<const std::byte> as_client_receives(std::span<const std::byte> bytes, bool last) noexcept {
    to_client_.set(line_now(), speeds_.client);
    return through(to_client_, bytes, last, garbage_);
  }

  // Returns the bytes that the device receives at the line's speed.
  std::span<const std::byte> as_device_receives(std::span<const std::byte> bytes) noexcept {
    if (state_with_reader() != PortState::wrong_speed) return bytes;
    UartSettings client = line_now();
    client.baud = speeds_.client;
    from_client_.set(client, speeds_.line);
    return through(from_client_, bytes, true, incoming_);
  }

  static std::span<const std::byte> through(UartWire& wire, std::span<const std::byte> bytes, bool last,
                                            std::span<std::byte> received) noexcept {
    std::size_t count = wire.carry(bytes, received.first(received.size() - 1));
    if (last)
      if (const auto rest = wire.idle()) received[count++] = *rest;
    return received.first(count);
  }

  // Discards the bytes that the last reader left unread, before the next reader. Only the slave can flush all of
  // them. Bytes that the reader sent to imud stay.
  void discard_unread() noexcept {
    writer_.discard(counters_);
    if (paced_) paced_->discard(counters_);
    to_client_.idle();
    const FileDescriptor slave = pty_.open_slave();
    if (slave) ::tcflush(slave.get(), TCIFLUSH);
  }

  static constexpr std::size_t most_read = 256;

  const PtyAccess access_;
  std::optional<KeptPty> kept_;  // without its connection while the keeper is gone
  std::optional<NextKeeper> next_keeper_;
  PtyPair pty_;
  UartSettings line_;  // of the device; baud 0: not known
  const bool any_speed_;
  bool is_connected_ = true;
  BackOff back_off_;                     // of reconnect()
  std::optional<HostTime> empty_since_;  // is_drained() has found nothing that the client has not read
  HostTime checked_;                     // when has_reader() last checked for a reader
  ByteWriter writer_;
  std::optional<PacedWriter> paced_;
  UartWire to_client_, from_client_;
  std::array<std::byte, most_read> buffer_;
  std::array<std::byte, UartWire::max_received * most_read + 1> incoming_;
  std::array<std::byte, UartWire::max_received * ByteWriter::max_frame + 1> garbage_;
};

// Returns the path from the root of the file system.
std::string whole_path(const std::string& path) {
  std::error_code unknown;
  return std::filesystem::absolute(path, unknown).lexically_normal().string();
}

// The client's end of a terminal that another process serves.
class PtyListener final : public Port {
 public:
  explicit PtyListener(const PortSpec& spec) {
    tty_.reset(::open(spec.address.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!tty_)
      throw spec.error(fmt::format(
          "cannot open it: {}{}", std::strerror(errno),
          errno == ENOENT || errno == EIO
              ? fmt::format(
                    "; is the process running that serves it? It was looked for at {}{}", whole_path(spec.address),
                    spec.address.starts_with('/') ? "" : "; give an absolute path, or start in the folder of the run")
              : ""));
    if (!make_raw(tty_.get())) throw spec.error("is not a terminal");
    if (const auto baud = spec.integer(baud_option)) set_line_speed(tty_.get(), static_cast<unsigned>(*baud));
  }

  void send(std::span<const Frame> frames) noexcept override {
    writer_.write(tty_.get(), frames, counters_, is_reply_);
  }

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
  bool wants_output() const noexcept override { return !writer_.is_idle(); }
  bool at_end() const noexcept override { return at_end_; }
  int descriptor() const noexcept override { return tty_.get(); }

 private:
  FileDescriptor tty_;
  bool at_end_ = false;
  ByteWriter writer_;
  std::array<std::byte, 4096> buffer_;
};

void check(const PortSpec& spec, const PortSettings& settings) {
  const UartSettings line = uart_settings(spec, settings, 0);
  static_cast<void>(PtyAccess(spec));
  if (settings.paced && line.baud == 0)
    throw spec.error("a line without speed has no pace; give baud, such as baud=115200");
}

std::unique_ptr<Port> open(const PortSpec& spec, const PortSettings& settings) {
  if (settings.role == Role::device) return std::make_unique<PtyDevice>(spec, settings);
  return std::make_unique<PtyListener>(spec);
}

WireTime wire_time(const PortSpec& spec, const PortSettings& settings, const Frame& frame) {
  const UartSettings line = uart_settings(spec, settings, 0);
  return uart_wire_time(frame, line.baud, line.bits_per_character());
}

constexpr PortOption device_only(PortOption option) {
  option.device_only = true;
  return option;
}

constexpr PortOption pty_options[] = {baud_option,          device_only(parity_option), device_only(stop_option),
                                      speed_option,         PtyAccess::options[0],      PtyAccess::options[1],
                                      PtyAccess::options[2]};

}  // namespace

extern constexpr Transport pty_transport = {
    .name = "pty",
    .summary = "a serial line without hardware: a pseudo-terminal behind the link of that name",
    .syntax = "pty:LINK?baud=115200&parity=none|even|odd&stop=1|2&speed=line|any&mode=0660&owner=NAME&group=NAME",
    .example = "pty:imu1",
    .document = "pty(7)",
    .options = pty_options,
    .has_path = true,
    .makes_link = true,
    .has_private_copy = true,
    .has_readers = true,
    .uart = Uart::emulated,
    .check = check,
    .open = open,
    .wire_time = wire_time,
};

}  // namespace imud
