// Hosts that change the modes of a product at random. Each host knows which frames the product may send on its own in
// the mode that the product's last answer has confirmed. This knowledge is from the product's document, not from
// imud's code.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"

namespace imud {

class ModeClient {
 public:
  virtual ~ModeClient() = default;
  // Returns the keys of [[imu]].
  virtual std::string configuration() const = 0;
  // Returns the next bytes that the host writes.
  virtual std::string write(HostTime now) = 0;
  // Is called when the device has executed the written bytes. `answer`: its answer, which may be empty.
  virtual void on_executed(std::string_view answer, HostTime now) = 0;
  // Is called after the supply was switched off and on.
  virtual void on_power(HostTime now) = 0;
  // Returns true if the mode allows a frame that the device sends on its own.
  virtual bool allows(std::string_view frame, HostTime now) = 0;

  // The frames that were allowed, and the modes that were entered, by name.
  std::map<std::string, std::size_t> frames, modes;
  // The names that `frames` and `modes` must have at the end, each with a large count.
  std::vector<std::string> expected_frames, expected_modes;

 protected:
  std::size_t below(std::size_t n) { return random_() % n; }
  template <class... Choice>
  std::string one_of(const Choice&... choice) {
    return std::array{std::string(choice)...}[below(sizeof...(choice))];
  }

 private:
  std::mt19937 random_{12};
};

// TS1524 rev. 31: Init Mode sends part number, serial number and configuration (section 7.5.1). Service Mode (section
// 9) and Utility Mode (section 10) send nothing but answers; "x n" and "x i" leave Service Mode after 3 s (Table
// 9-54).
class Stim300Client final : public ModeClient {
 public:
  Stim300Client() {
    expected_frames = {"measurement", "special", "init"};
    expected_modes = {"service", "utility", "init", "leaving", "normal"};
  }
  std::string configuration() const override { return "protocol = \"stim300\"\n"; }

  std::string write(HostTime now) override {
    if (now < leaves_at_)
      written_ = "i";  // ignored
    else if (mode_ == Mode::normal)
      written_ =
          one_of("SERVICEMODE", "UTILITYMODE", "SERVICEMODE", "UTILITYMODE", "R", "N", "I", "C", "T", "E", "x");
    else if (mode_ == Mode::service && is_asked_)
      written_ = one_of("Y", "N");
    else if (mode_ == Mode::service)
      written_ = below(20) == 0 ? one_of("x n", "x i") : one_of("x N", "x I", "i", "m 3", "m 1", "a", "", "nonsense");
    else
      written_ = one_of("$xn,150", "$isn,28", "$xn,150", "$nonsense");
    return written_ + "\r";
  }

  void on_executed(std::string_view answer, HostTime now) override {
    if (now < leaves_at_) return;
    if (mode_ == Mode::normal) {
      if (written_ == "R") restart();
      if (written_ == "SERVICEMODE" && answer.starts_with("SERIAL NUMBER")) enter(Mode::service, "service");
      if (written_ == "UTILITYMODE" && answer == "#UTILITYMODE,234\r") enter(Mode::utility, "utility");
    } else if (mode_ == Mode::service) {
      is_asked_ = answer.find("CONFIRM") != std::string_view::npos;
      if (answer.find("SYSTEM RETURNING TO ") == std::string_view::npos) return;
      const bool at_once = written_ == "x N" || written_ == "x I";
      if (!at_once) {
        leaves_at_ = now + std::chrono::seconds(3);
        ++modes["leaving"];
      }
      enter(Mode::normal, "normal");
      if (answer.find(" INIT MODE") != std::string_view::npos) restart();
    } else if (answer.starts_with("#xn,0")) {
      enter(Mode::normal, "normal");
    }
  }

  void on_power(HostTime) override {
    enter(Mode::normal, "normal");
    leaves_at_ = {};
    is_asked_ = false;
    restart();
  }

  bool allows(std::string_view frame, HostTime now) override {
    // The device's clock resolves half a millisecond.
    if (mode_ != Mode::normal || now + std::chrono::milliseconds(1) < leaves_at_) return false;
    const auto is = [&](unsigned char begin, std::size_t size) {
      return static_cast<unsigned char>(frame[0]) == begin && frame.size() == size;
    };
    constexpr std::array<std::pair<unsigned char, std::size_t>, 3> start = {{{0xB1, 20}, {0xB5, 20}, {0xBC, 26}}};
    if (started_ < start.size()) {
      if (!is(start[started_].first, start[started_].second)) return false;
      ++started_;
      ++frames["init"];
      return true;
    }
    const bool is_measurement = is(0xA7, 59);
    ++frames[is_measurement ? "measurement" : "special"];
    return is_measurement || is(0xB1, 20) || is(0xB5, 20) || is(0xBC, 26) || frame[0] == '\xD1' || frame[0] == '\xBE';
  }

 private:
  enum class Mode { normal, service, utility } mode_ = Mode::normal;
  void enter(Mode mode, const char* name) {
    mode_ = mode;
    ++modes[name];
  }
  void restart() {
    started_ = 0;
    ++modes["init"];
  }
  std::string written_;
  std::size_t started_ = 0;  // datagrams of Init Mode that were sent
  bool is_asked_ = false;    // Service Mode waits for "Y" or "N"
  HostTime leaves_at_;       // end of the 3 s
};

// VN-100 user manual: register 6 selects the text, registers 75 to 77 the binary outputs (bit 0 of the first
// parameter stands for this port); VNASY,0 pauses all outputs; VNWNV stores the registers, and a reset loads them.
class VectorNavClient final : public ModeClient {
 public:
  VectorNavClient() {
    expected_frames = {"$VNYMR", "$VNQTN", "$VNIMU", "binary 1", "binary 2", "binary 3"};
    expected_modes = {"text", "output", "pause", "resume", "reset", "factory", "stored", "power"};
  }
  std::string configuration() const override { return "protocol = \"vectornav\"\ndevice.baud = 921600\n"; }

  std::string write(HostTime) override {
    switch (below(12)) {
      case 0:
      case 1:
        body_ = "VNWRG,06," + one_of("0", "0", "14", "2", "19");
        break;
      case 2:
        body_ = "VNWRG,07," + one_of("1", "40", "200");
        break;
      case 3:
      case 4:
      case 5: {
        const std::size_t output = below(outputs.size());
        body_ = std::string("VNWRG,7") + "567"[output] + ',' + one_of("0", "1", "3") + ',' + one_of("1", "2", "40") +
                ',' + std::string(outputs[output].written);
        break;
      }
      case 6:
      case 7:
        body_ = one_of("VNASY,0", "VNASY,1");
        break;
      case 8:
        body_ = one_of("VNRST", "VNRST", "VNRFS");
        break;
      case 9:
        body_ = "VNWNV";
        break;
      case 10:
        body_ = one_of("VNRRG,01", "VNRRG,27", "VNBOM,1");
        break;
      default:
        body_ = "VNWRG,06,14,nonsense";
    }
    unsigned sum = 0;
    for (const char c : body_) sum ^= static_cast<unsigned char>(c);
    std::array<char, 8> end;
    std::snprintf(end.data(), end.size(), "*%02X\r\n", sum);
    return '$' + body_ + end.data();
  }

  void on_executed(std::string_view answer, HostTime) override {
    if (!answer.starts_with("$" + body_ + "*")) return;  // an error, or a value that was read
    if (body_.starts_with("VNWRG,06,")) {
      active_.text = std::stoi(body_.substr(9));
      ++modes["text"];
    }
    if (body_.starts_with("VNWRG,7")) {
      active_.streams[static_cast<std::size_t>(body_[7] - '5')] = body_[9] == '1' || body_[9] == '3';
      ++modes["output"];
    }
    if (body_.starts_with("VNASY")) {
      is_paused_ = body_ == "VNASY,0";
      ++modes[is_paused_ ? "pause" : "resume"];
    }
    if (body_ == "VNWNV") stored_ = active_, ++modes["stored"];
    if (body_ == "VNRFS") stored_ = {}, restart("factory");
    if (body_ == "VNRST") restart("reset");
  }

  void on_power(HostTime) override { restart("power"); }

  bool allows(std::string_view frame, HostTime) override {
    if (is_paused_) return false;
    constexpr std::array<std::pair<int, std::string_view>, 3> texts = {
        {{14, "$VNYMR"}, {2, "$VNQTN"}, {19, "$VNIMU"}}};
    for (const auto& [type, header] : texts)
      if (type == active_.text && frame.starts_with(std::string(header) + ",")) {
        ++frames[std::string(header)];
        return true;
      }
    for (std::size_t i = 0; i < outputs.size(); ++i)
      if (active_.streams[i] && frame.starts_with(outputs[i].sent)) {
        ++frames["binary " + std::to_string(i + 1)];
        return true;
      }
    return false;
  }

 private:
  struct Output {
    std::string_view written, sent;  // groups and masks, in the register and in the frame's header
  };
  static constexpr std::array<Output, 3> outputs = {{{"01,0029", {"\xFA\x01\x29\x00", 4}},
                                                     {"04,0006", {"\xFA\x04\x06\x00", 4}},
                                                     {"05,0001,0200", {"\xFA\x05\x01\x00\x00\x02", 6}}}};
  struct Registers {
    int text = 14;
    std::array<bool, 3> streams = {};
  };
  void restart(const char* why) {
    active_ = stored_;
    is_paused_ = false;
    ++modes[why];
  }
  std::string body_;
  Registers active_, stored_;
  bool is_paused_ = false;
};

// mip_sdk, src/c/mip/definitions: idle (01:02) stops all streams until resume (01:06); 0C:11 switches a stream; 0C:08
// and 0C:0A choose the fields of a stream; 0C:30 stores and loads all settings. 0C:39 is answered after the capture
// of 1 s.
class MipClient final : public ModeClient {
 public:
  MipClient() {
    expected_frames = {"sensor", "filter", "capture"};
    expected_modes = {"idle", "resume", "reset", "switched", "format", "stored", "loaded", "power", "capture"};
  }
  std::string configuration() const override {
    return "protocol = \"mip\"\ndevice.baud = 921600\ndevice.sensor_rate_hz = 500\ndevice.filter_rate_hz = 500\n"
           "device.sensor_fields = [\"acceleration\", \"rate\"]\ndevice.filter_fields = [\"filter_quaternion\"]\n";
  }

  std::string write(HostTime) override {
    const auto number = [](std::size_t n) { return std::string(1, static_cast<char>(n)); };
    switch (below(10)) {
      case 0:
      case 1:
        body_ = "\x01\x02" + one_of("\x02", "\x06");
        break;
      case 2:
        body_ = one_of("\x01\x02\x7E", "\x01\x02\x01", "\x01\x02\x03");
        break;
      case 3:
      case 4:
        body_ = "\x0C\x05\x11\x01" + one_of("\x01", "\x03") + number(below(2));
        break;
      case 5:
      case 6:
        body_ = std::string("\x0C\x07\x08\x01\x01", 5) + one_of("\x04", "\x05", "\x06") + std::string("\x00\x01", 2);
        break;
      case 7:
        body_ = std::string("\x0C\x07\x0A\x01\x01", 5) + one_of("\x03", "\x05") + std::string("\x00\x02", 2);
        break;
      case 8:
        body_ = "\x0C\x03\x30" + one_of("\x03", "\x04", "\x05");
        break;
      default:
        body_ = "\x0C\x04\x39\x03\xE8";
    }
    std::string packet = "ue" + body_.substr(0, 1) + number(body_.size() - 1) + body_.substr(1);
    unsigned first = 0, second = 0;
    for (const char c : packet) second += first += static_cast<unsigned char>(c);
    return packet + number(first & 255U) + number(second & 255U);
  }

  void on_executed(std::string_view answer, HostTime) override {
    const unsigned set = byte(body_, 0), command = byte(body_, 2);
    if (set == 0x0C && command == 0x39 && answer.empty()) {
      ++captures_;
      ++modes["capture"];
    }
    // A header of 4 bytes, then the field F1 with the command and the code 0.
    if (answer.size() < 8 || byte(answer, 5) != 0xF1 || byte(answer, 6) != command || byte(answer, 7) != 0) return;
    if (set == 1 && command == 0x02) is_idle_ = true, ++modes["idle"];
    if (set == 1 && command == 0x06) is_idle_ = false, ++modes["resume"];
    if (set == 1 && command == 0x7E) restart("reset");
    if (set == 1) return;
    if (command == 0x11) active_[byte(body_, 4) == 1 ? 0 : 1].is_on = byte(body_, 5) != 0, ++modes["switched"];
    if (command == 0x08 || command == 0x0A)
      active_[command == 0x08 ? 0 : 1].fields = body_.substr(5, 1), ++modes["format"];
    if (command != 0x30) return;
    if (byte(body_, 3) == 3) stored_ = active_, ++modes["stored"];
    if (byte(body_, 3) == 4) active_ = stored_, ++modes["loaded"];
    if (byte(body_, 3) == 5) active_ = delivered();
  }

  void on_power(HostTime) override { restart("power"); }

  bool allows(std::string_view frame, HostTime) override {
    const unsigned set = byte(frame, 2);
    if (set == 0x0C && captures_ > 0) {
      --captures_;
      ++frames["capture"];
      return byte(frame, 6) == 0x39;
    }
    if (set != 0x80 && set != 0x82) return false;
    const Stream& stream = active_[set == 0x80 ? 0 : 1];
    std::string fields;
    for (std::size_t at = 4; at + 2 < frame.size(); at += byte(frame, at)) fields += frame[at + 1];
    ++frames[set == 0x80 ? "sensor" : "filter"];
    return !is_idle_ && stream.is_on && fields == stream.fields;
  }

 private:
  struct Stream {
    bool is_on = true;
    std::string fields;
  };
  using Streams = std::array<Stream, 2>;  // sensor, filter
  static Streams delivered() { return {{{true, "\x04\x05"}, {true, "\x03"}}}; }
  static unsigned byte(std::string_view text, std::size_t at) { return static_cast<unsigned char>(text[at]); }
  void restart(const char* why) {
    active_ = stored_;
    is_idle_ = false;
    captures_ = 0;
    ++modes[why];
  }
  std::string body_;
  Streams active_ = delivered(), stored_ = delivered();
  bool is_idle_ = false;
  int captures_ = 0;
};

}  // namespace imud
