// Requests of a host to described units: their effects and answers.
#include "protocols/frames/host/frame_requests.hpp"

#include <chrono>

#include "protocols/wire/byte_text.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view head = R"(
frame_version = 1
name = "test"
byte_order = "big"
[setting]
HZ = [10, 100, 0]
FORM = {values = ["A", "B"], codes = [3, 4], kept = true}
UNIT = {values = ["x", "y"], delivered = "y"}
[[message]]
name = "a"
when = {FORM = "A"}
rate_hz = "HZ"
layout = ["A1", "alive_counter:u8", "delta_angle_x_rad:f32"]
[[message]]
name = "b"
when = {FORM = "B", UNIT = ["x", "y"]}
layout = ["B1", "alive_counter:u8"]
[[message]]
name = "c"
polled = true
layout = ["C1", "alive_counter:u8", "sample_counter:u8"]
)";

// A unit at 100 Hz, and the bytes that it sends.
class FrameUnit {
 public:
  explicit FrameUnit(std::string_view requests) : line_(frame_line(std::string(head) + std::string(requests))) {}

  // Takes so many samples. Returns the first byte and the counter of each message, and a point for a sample without.
  std::string samples(int count) {
    std::string text;
    for (int i = 0; i < count; ++i) {
      while (line_.device->deadline() && *line_.device->deadline() <= now()) poll();
      sample_.delta_angle.x() = 1;
      const auto frames = line_.encode(sample_);
      for (const Frame& frame : frames) text += name_of(frame);
      if (frames.empty()) text += '.';
      if (!frames.empty()) newest_.assign(frames.back().bytes.begin(), frames.back().bytes.end());
      ++sample_.counter;
      sample_.time = sample_.time + 10ms;
    }
    return text;
  }
  // Sends text to the unit and returns its answers.
  std::string send(std::string_view text) { return receive(std::as_bytes(std::span(text))); }
  std::string send_hex(std::string_view bytes) { return hex_text(receive(from_hex(bytes))); }
  std::string poll() {
    buffer_->clear();
    line_.device->poll(now(), *buffer_);
    return taken();
  }
  void pass(Nanoseconds time) { sample_.time = sample_.time + time; }
  DeviceTime now() const { return sample_.time; }
  Device& device() { return *line_.device; }
  // The last message of the newest sample that had one.
  std::span<const std::byte> newest() const { return newest_; }

  static std::string hex_text(std::string_view bytes) {
    std::string text;
    constexpr char digits[] = "0123456789ABCDEF";
    for (const char c : bytes) {
      const auto byte = static_cast<unsigned char>(c);
      text += (text.empty() ? "" : " ") + std::string{digits[byte >> 4], digits[byte & 15]};
    }
    return text;
  }

 private:
  static std::vector<std::byte> from_hex(std::string_view text) { return *hex_bytes_in(text); }
  static std::string name_of(const Frame& frame) {
    const int kind = std::to_integer<int>(frame.bytes[0]) >> 4;
    return std::string(1, static_cast<char>('a' + kind - 10)) + std::to_string(std::to_integer<int>(frame.bytes[1]));
  }
  std::string receive(std::span<const std::byte> bytes) {
    buffer_->clear();
    line_.device->receive({bytes}, now(), *buffer_);
    return taken();
  }
  std::string taken() const {
    std::string text;
    for (const Frame& frame : buffer_->frames())
      text.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
    return text;
  }

  Line line_;
  Sample sample_;
  std::vector<std::byte> newest_;
  std::unique_ptr<FrameBuffer> buffer_ = std::make_unique<FrameBuffer>();
};

constexpr std::string_view lines = R"(
[[request]]
line = "={setting},{value}"
ignore_case = true
set = true
answer = "{setting}:{value}:{FORM}\n"
otherwise = "BAD {value} of {setting}\n"
[[request]]
line = "?{setting}"
answer = "{setting} is {value}\n"
[[request]]
line = "stop"
stream = false
[[request]]
line = "go"
stream = true
[[request]]
line = "save"
save = true
[[request]]
line = "factory"
restore = true
[[request]]
line = "restart"
answer = "bye\n"
reset = true
[[request]]
line = "say {any}!"
answer = "{any} in {line}"
[[request]]
line = "to b"
set = {FORM = "B", UNIT = "x"}
[unknown]
answer = "? {line}\n"
)";

TEST(FrameRequests, SettingsChooseMessagesAndRates) {
  FrameUnit unit(lines);
  EXPECT_EQ(unit.samples(12), "a0.........a1.");
  EXPECT_EQ(unit.send("=HZ,100\n"), "HZ:100:A\n");
  EXPECT_EQ(unit.samples(3), "a2a3a4");
  EXPECT_EQ(unit.send("=hz,010\r\n"), "HZ:10:A\n");  // a number is one by any of its texts
  EXPECT_EQ(unit.samples(7), ".....a5.");
  EXPECT_EQ(unit.send("=HZ,0\r"), "HZ:0:A\n");
  EXPECT_EQ(unit.samples(20), "....................");
  EXPECT_EQ(unit.send("=form,b\n"), "FORM:B:B\n");
  EXPECT_EQ(unit.samples(3), "b0b1b2");
  EXPECT_EQ(unit.send("to b\n?UNIT\n"), "UNIT is x\n");
}

TEST(FrameRequests, WrongAndUnknownLines) {
  FrameUnit unit(lines);
  EXPECT_EQ(unit.send("=HZ,11\n"), "BAD 11 of HZ\n");
  EXPECT_EQ(unit.send("?HZ\n"), "HZ is 10\n");
  EXPECT_EQ(unit.send("?hz\n"), "? ?hz\n");
  EXPECT_EQ(unit.send("=NO,1\n"), "? =NO,1\n");
  EXPECT_EQ(unit.device().counts()[1], 8U);  // ?hz, =NO,1
  EXPECT_EQ(unit.send("\r\n\n"), "");        // empty lines
  EXPECT_EQ(unit.send("say hello!\n"), "hello in say hello!");
  EXPECT_EQ(unit.send("say !\n"), " in say !");
  EXPECT_EQ(unit.send("say hello! you\n"), "? say hello! you\n");
  // Pieces are put together, unless more than a second passes between them.
  EXPECT_EQ(unit.send("?H"), "");
  unit.pass(900ms);
  EXPECT_EQ(unit.send("Z\n"), "HZ is 10\n");
  EXPECT_EQ(unit.send("?H"), "");
  unit.pass(1100ms);
  EXPECT_EQ(unit.send("?HZ\n"), "HZ is 10\n");
  // A line that is too long, and bytes that no line has.
  EXPECT_EQ(unit.send(std::string(1000, 'x') + "\n?HZ\n").substr(0, 3), "? x");
  EXPECT_EQ(unit.send("\x01\xFF?HZ\n"), "HZ is 10\n");
}

TEST(FrameRequests, TheStreamIsSwitched) {
  FrameUnit unit(lines);
  unit.send("=HZ,100\n");
  EXPECT_EQ(unit.samples(3), "a0a1a2");
  unit.send("stop\n");
  EXPECT_EQ(unit.samples(50), std::string(50, '.'));
  unit.send("go\n");
  EXPECT_EQ(unit.samples(2), "a3a4");  // what was not sent was not counted
  unit.send("stop\n");
  unit.samples(50);
  unit.send("go\n");
  unit.samples(1);
  // No message has the increments of the pause, which are 1 rad a sample.
  EXPECT_EQ(FrameUnit::hex_text({reinterpret_cast<const char*>(unit.newest().data()), 6}), "A1 05 3F 80 00 00");
  unit.send("stop\n");
  unit.device().power_on(unit.now());
  EXPECT_EQ(unit.send("?HZ\n"), "HZ is 10\n");
  EXPECT_EQ(unit.samples(2), "a0.");
}

TEST(FrameRequests, SettingsSurviveIfTheyAreKeptOrSaved) {
  FrameUnit unit(lines);
  unit.send("=HZ,100\n=FORM,B\n=UNIT,x\n");
  unit.device().power_on(unit.now());
  EXPECT_EQ(unit.send("?HZ\n?FORM\n?UNIT\n"), "HZ is 10\nFORM is B\nUNIT is y\n");
  unit.send("=HZ,100\n=UNIT,x\nsave\n=HZ,10\n");
  EXPECT_EQ(unit.send("restart\n?HZ\n?UNIT\n"), "bye\nHZ is 100\nUNIT is x\n");
  EXPECT_EQ(unit.samples(2), "b0b1");
  unit.send("restart\n");
  EXPECT_EQ(unit.samples(2), "b0b1");
  unit.send("factory\n");
  EXPECT_EQ(unit.send("?HZ\n?FORM\n"), "HZ is 10\nFORM is A\n");
  unit.device().power_on(unit.now());
  EXPECT_EQ(unit.send("?HZ\n?FORM\n"), "HZ is 100\nFORM is A\n");  // only what is kept was stored
}

constexpr std::string_view binary = R"(
[[request]]
bytes = "9A 01 ?? 93"
answer = ["@a", "55", "{2}", "{0-1}", "length:u8:@a..@", "check:sum8:@a.."]
[[request]]
layout = ["@a", "F0", "{FORM}:u16", "bits:u8:0-1={HZ},7=1", "check:crc16/xmodem:@a.."]
set = true
answer = ["{FORM}:u16 le", "F0"]
otherwise = "EE"
[[request]]
bytes = "C1"
poll = "c"
[[request]]
bytes = "DD"
delay_ms = 30
answer = "D1"
[[request]]
bytes = "D0 ??"
delay_ms = 10
answer = ["D2", "{1}"]
poll = "c"
)";

// HZ has no codes but its values, of which 100 needs 7 bits.
std::string binary_requests() {
  std::string text(binary);
  text.replace(text.find("bits:u8:0-1={HZ},7=1"), 20, "bits:u8:0-6={HZ},7=1");
  return text;
}

TEST(FrameRequests, BytesAreMatchedAndRepeated) {
  FrameUnit unit(binary_requests());
  EXPECT_EQ(unit.send_hex("9A 01 77 93"), "55 77 9A 01 06 6D");
  EXPECT_EQ(unit.send_hex("9A 9A 01 01 93 9A 01 02"), "55 01 9A 01 06 F7");
  EXPECT_EQ(unit.send_hex("93"), "55 02 9A 01 06 F8");
  EXPECT_EQ(unit.device().counts()[1], 1U);
  EXPECT_EQ(unit.send_hex("9A 01 77 92"), "");
  EXPECT_EQ(unit.device().counts()[1], 5U);
}

TEST(FrameRequests, BinarySettingsHaveCodes) {
  FrameUnit unit(binary_requests());
  unit.samples(1);
  EXPECT_EQ(unit.send_hex("F0 00 04 E4 EE 23"), "04 00 F0") << "CRC-16/XMODEM of F0 00 04 E4";
  EXPECT_EQ(unit.samples(2), "b0b1");
  EXPECT_EQ(unit.send_hex("F0 00 04 E4 EE 24"), "");    // a wrong check
  EXPECT_EQ(unit.send_hex("F0 00 05 E4 DD 12"), "EE");  // a code of no value
  EXPECT_EQ(unit.samples(2), "b2b3");
}

TEST(FrameRequests, MessagesArePolled) {
  FrameUnit unit(binary_requests());
  EXPECT_EQ(unit.send_hex("C1"), "");  // there is no sample yet
  EXPECT_EQ(unit.samples(3), "a0c0..");
  EXPECT_EQ(unit.send_hex("C1"), "C1 01 02");  // the newest sample, at once
  EXPECT_EQ(unit.send_hex("C1 C1"), "C1 02 02 C1 03 02");
  EXPECT_EQ(unit.samples(8), ".......a1");
}

TEST(FrameRequests, AnswersAreDelayed) {
  FrameUnit unit(binary_requests());
  unit.samples(1);
  EXPECT_EQ(unit.send_hex("DD"), "");
  EXPECT_EQ(unit.send_hex("D0 07"), "");
  ASSERT_TRUE(unit.device().deadline());
  EXPECT_EQ(*unit.device().deadline() - unit.now(), 30ms);
  unit.device().step_clock(5ms);
  unit.pass(5ms);
  EXPECT_EQ(*unit.device().deadline() - unit.now(), 30ms);
  unit.pass(30ms);
  EXPECT_EQ(FrameUnit::hex_text(unit.poll()), "D1 D2 07 C1 00 00");  // one after another
  EXPECT_FALSE(unit.device().deadline());
  for (int i = 0; i < 10; ++i) unit.send_hex("DD");
  EXPECT_EQ(unit.device().counts()[2], 2U);  // eight wait at most
  unit.device().power_on(unit.now());
  EXPECT_FALSE(unit.device().deadline());
}

TEST(FrameRequests, TheBitRateChangesAfterTheAnswer) {
  const std::string text = R"(
frame_version = 1
name = "test"
[line]
baud = "BAUD"
[setting]
BAUD = [9600, 115200]
[[message]]
name = "a"
layout = ["A1", "alive_counter:u8"]
[[request]]
line = "baud {BAUD}"
set = true
delay_ms = 20
answer = "now {BAUD}\n"
otherwise = "no\n"
)";
  Line line = frame_line(text);
  FrameBuffer replies;
  EXPECT_EQ(line.device->uart().baud, 9600U);
  line.device->receive({std::as_bytes(std::span(std::string_view("baud 115200\n")))}, {}, replies);
  EXPECT_EQ(line.device->uart().baud, 9600U);
  line.device->poll(DeviceTime{} + 20ms, replies);
  EXPECT_EQ(replies.frames().size(), 1U);
  EXPECT_EQ(line.device->uart().baud, 115200U);
  line.device->power_on({});
  EXPECT_EQ(line.device->uart().baud, 9600U);
  // A refusal that waits behind the answer leaves at the old rate as well.
  for (const std::string_view text_of_host : {"baud 115200\n", "baud 7\n"})
    line.device->receive({std::as_bytes(std::span(text_of_host))}, {}, replies);
  line.device->poll(DeviceTime{} + 20ms, replies);
  EXPECT_EQ(replies.frames().size(), 3U);
  EXPECT_EQ(line.device->uart().baud, 115200U);
  line.device->power_on({});
  // The configuration has what was saved before.
  Settings settings = frame_settings(frames_of_text(text, "test.toml"));
  settings.set("baud", std::int64_t{115200});
  EXPECT_EQ(protocol_named("frame").make(settings)->uart().baud, 115200U);
  settings.set("baud", std::int64_t{19200});
  EXPECT_THROW(static_cast<void>(protocol_named("frame").make(settings)), std::invalid_argument);
  settings.set("baud", std::int64_t{0});
  settings.set("settings", std::vector<std::string>{"BAUD=115200"});
  EXPECT_EQ(protocol_named("frame").make(settings)->uart().baud, 115200U);
  settings.set("settings", std::vector<std::string>{"BAUDS=115200"});
  EXPECT_THROW(static_cast<void>(protocol_named("frame").make(settings)), std::invalid_argument);
}

// A stream that a host switches between two messages is decoded; of two that look alike, the one that is probable.
TEST(FrameRequests, SwitchedStreamsAreDecoded) {
  const std::string text = R"(
frame_version = 1
name = "test"
[setting]
FORM = ["RATE", "ANGLE"]
[[message]]
name = "rate"
when = {FORM = "RATE"}
layout = ["A1 A2", "sample_counter:u8", "rate_x_rad_per_s:f32"]
[[message]]
name = "angle"
when = {FORM = "ANGLE"}
layout = ["A1 A2", "sample_counter:u8", "delta_angle_x_rad:f32"]
)";
  Settings settings = frame_settings(frames_of_text(text, "test.toml"));
  for (const bool is_angle : {false, true}) {
    if (is_angle) settings.set("settings", std::vector<std::string>{"FORM=ANGLE"});
    Line line(protocol_named("frame"), settings);
    Recording recording;
    Sample sample;
    for (int k = 0; k < 3; ++k) {
      for (const Frame& frame : line.encode(sample)) line.decoder->feed(frame, recording);
      EXPECT_EQ(recording.measurements.size(), static_cast<std::size_t>(k) + 1) << "complete at once";
      ++sample.counter;
    }
    for (const Measurement& measurement : recording.measurements)
      EXPECT_EQ(measurement.fields, Measurement::counter | (is_angle ? Measurement::delta_angle : Measurement::rate));
  }
}

}  // namespace
}  // namespace imud
