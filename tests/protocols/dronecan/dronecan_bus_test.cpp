// DroneCAN: what depends on other nodes and on time: allocation of the node id, the time of the bus, reception of
// transfers, conflicts of node ids. Frames of other nodes are those that pydronecan encodes (at 08cda37).
#include <set>

#include "protocols/dronecan/messages.hpp"
#include "tests/protocols/dronecan/dronecan_unit.hpp"

namespace imud {
namespace {

using namespace dronecan_test;

constexpr std::string_view has_6 = "1400017F#00000102030405C0",
                           has_12 = "1400017F#585D000001020381 1400017F#0405060708090A21 1400017F#0B41",
                           assigned = "1400017F#4D6BC80001020382 1400017F#0405060708090A22 1400017F#0B0C0D0E0F42";
constexpr std::string_view dynamic = "node_id=0 unique_id=000102030405060708090a0b0c0d0e0f raw_imu_hz=1000";
// The discriminator of this unique id is 0x2288.
constexpr std::string_view anonymous = "188A2100#";

std::string anonymous_frame(std::string_view data) { return std::string(anonymous) + std::string(data); }

TEST(DroneCanAllocation, GetsItsNodeIdInThreeStages) {
  Unit unit(dynamic);
  EXPECT_EQ(unit.sample(), "") << "it has no node id";
  EXPECT_EQ(unit.pass(599ms), "");
  EXPECT_EQ(unit.pass(401ms), anonymous_frame("01000102030405C0"));
  EXPECT_EQ(unit.answer(has_6), "");
  EXPECT_EQ(unit.pass(400ms), anonymous_frame("00060708090A0BC1"));
  EXPECT_EQ(unit.answer(has_12), "");
  EXPECT_EQ(unit.pass(400ms), anonymous_frame("000C0D0E0FC2"));
  EXPECT_EQ(unit.answer(assigned), "");
  EXPECT_EQ(unit.pass(0s), "18015564#01000000000000C0") << "node 100";
  EXPECT_EQ(frames_in(unit.sample()), 7U);
  EXPECT_EQ(frames_in(unit.answer("1E01E48A#C0")), 8U);
  EXPECT_EQ(unit.pass(5s).find(anonymous), std::string::npos) << "it does not ask again";
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.sample(), "") << "and it starts again without one";
  EXPECT_EQ(unit.pass(1s).substr(0, 9), anonymous);
}

TEST(DroneCanAllocation, RequestsEvery600To1000MillisecondsAtRandom) {
  Unit unit(dynamic);
  std::set<std::int64_t> periods;
  DeviceTime last = unit.now;
  for (int i = 0; i < 200; ++i) {
    const DeviceTime due = unit.device->deadline().value();
    EXPECT_GE(due - last, 600ms);
    EXPECT_LE(due - last, 1000ms);
    periods.insert((due - last).count());
    EXPECT_EQ(frames_in(unit.pass(due - unit.now)), 1U);
    last = due;
  }
  EXPECT_GT(periods.size(), 190U);
  EXPECT_LT(*periods.begin(), 610'000'000);
  EXPECT_GT(*periods.rbegin(), 990'000'000);
  std::set<std::int64_t> delays;
  for (int i = 0; i < 200; ++i) {
    unit.answer(std::string(has_6.substr(0, 23)) + "C" + "0123456789ABCDEF"[i % 16]);
    const Nanoseconds delay = unit.device->deadline().value() - unit.now;
    if (delay < 600ms) delays.insert(delay.count());
    if (i % 16 == 15) unit.pass(3s);  // a repeated transfer id is discarded until then
  }
  ASSERT_GT(delays.size(), 150U);
  EXPECT_LE(*delays.rbegin(), 400'000'000);
  EXPECT_GT(*delays.rbegin(), 390'000'000);
}

TEST(DroneCanAllocation, WaitsWhenAnotherNodeAsks) {
  Unit unit(dynamic);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(unit.pass(590ms), "");
    unit.answer("1848D100#01696D75640000C0");  // an anonymous request
  }
  EXPECT_EQ(frames_in(unit.pass(1s)), 1U);
  unit.answer(has_6);
  unit.answer("1848D100#01696D75640000C0");
  EXPECT_EQ(unit.pass(590ms), "") << "the follow-up is dropped";
  EXPECT_EQ(unit.pass(410ms).substr(9, 2), "01") << "and it begins again";
}

// Returns an allocator's message with a whole unique id: 00, 01 ... 0E, `last`.
std::string assignment(unsigned node_id, std::uint8_t last, unsigned transfer_id) {
  dronecan::Payload payload;
  payload.put_byte(node_id << 1);
  for (unsigned i = 0; i < 15; ++i) payload.put_byte(i);
  payload.put_byte(last);
  FrameBuffer frames;
  dronecan::send({.priority = 20, .type = dronecan::allocation.id, .source = 127}, dronecan::allocation, transfer_id,
                 payload.bytes(), frames);
  return text_of(frames.frames());
}

TEST(DroneCanAllocation, IgnoresOtherUnitsAndRefusals) {
  Unit unit(dynamic);
  EXPECT_EQ(assignment(100, 0x0F, 2), assigned);
  unit.pass(1s);
  unit.answer("1400017F#00FF0102030405C0");
  EXPECT_EQ(unit.pass(450ms), "") << "another unit's first part";
  unit.answer("1400017F#C8C1");
  EXPECT_EQ(unit.pass(450ms), "") << "no unique id";
  unit.answer("1400017F#C8000102030405C2");
  EXPECT_EQ(frames_in(unit.pass(450ms)), 1U) << "a node id, but not the whole unique id: the next part";
  unit.answer(assignment(100, 0x10, 3));
  EXPECT_EQ(unit.pass(450ms), "") << "another unit's node id";
  unit.answer(assignment(0, 0x0F, 4));
  EXPECT_EQ(unit.sample(), "");
  EXPECT_EQ(unit.pass(1s).substr(0, 9), anonymous) << "it still has none";
  unit.answer(assignment(100, 0x0F, 5));
  EXPECT_EQ(frames_in(unit.sample()), 7U);
}

TEST(DroneCanAllocation, IsTheSameInEveryRun) {
  Unit one(dynamic), other(dynamic);
  EXPECT_EQ(one.pass(20s), other.pass(20s));
  Unit third("node_id=0 unique_id=000102030405060708090a0b0c0d0e10");
  EXPECT_NE(Unit(dynamic).device->deadline(), third.device->deadline());
}

// --- The time of the bus

std::string sync(unsigned master, unsigned transfer_id, std::uint64_t previous_us) {
  char text[40];
  std::snprintf(text, sizeof text, "140004%02X#", master);
  std::string line = text;
  for (int i = 0; i < 7; ++i) {
    std::snprintf(text, sizeof text, "%02X", static_cast<unsigned>(previous_us >> 8 * i & 0xFFU));
    line += text;
  }
  std::snprintf(text, sizeof text, "%02X", 0xC0 + transfer_id % 32);
  return line + text;
}

class DroneCanTime : public testing::Test {
 protected:
  // The time of a measurement in us; 0: not known.
  std::int64_t time() {
    const auto measurements = unit.decoded(unit.sample());
    if (measurements.size() != 1) throw std::logic_error("no measurement");
    return measurements[0].sample.time.ns / 1000;
  }
  Unit unit{"raw_imu_hz=1000"};
};

TEST_F(DroneCanTime, IsUnknownUntilTheSecondMessageOfTheMaster) {
  unit.pass(10s);
  EXPECT_EQ(time(), 0);
  unit.answer(sync(127, 0, 0));
  EXPECT_EQ(time(), 0);
  unit.pass(500ms);
  unit.answer(sync(127, 1, 5'000'000));  // the master's time at 10 s
  EXPECT_EQ(time(), 5'500'000);
  unit.pass(250ms);
  EXPECT_EQ(time(), 5'750'000);
  unit.pass(250ms);
  unit.answer(sync(127, 2, 5'500'100));  // the master's clock is faster
  EXPECT_EQ(time(), 6'000'100);
  unit.pass(2200ms);
  EXPECT_EQ(time(), 8'200'100);
  unit.pass(1us);
  EXPECT_EQ(time(), 0) << "the master is silent";
  unit.answer(sync(127, 3, 8'200'100));
  EXPECT_EQ(time(), 0) << "its previous message is too old";
}

TEST_F(DroneCanTime, NeedsConsecutiveMessages) {
  unit.pass(10s);
  unit.answer(sync(127, 0, 0));
  unit.pass(1s);
  unit.answer(sync(127, 2, 5'000'000));
  EXPECT_EQ(time(), 0) << "one was lost";
  unit.pass(1s);
  unit.answer(sync(127, 3, 0));
  EXPECT_EQ(time(), 0) << "the master has restarted";
  unit.pass(1101ms);
  unit.answer(sync(127, 4, 8'000'000));
  EXPECT_EQ(time(), 0) << "later than the longest period";
  unit.pass(1100ms);
  unit.answer(sync(127, 5, 9'000'000));
  EXPECT_EQ(time(), 10'100'000);
  unit.answer("1400047F#000000000000C6");  // 6 bytes of data
  EXPECT_EQ(unit.count("transfers_malformed"), 1U);
}

TEST_F(DroneCanTime, FollowsTheMasterWithTheLowestNodeId) {
  unit.pass(10s);
  unit.answer(sync(20, 0, 0));
  unit.pass(1s);
  unit.answer(sync(20, 1, 1'000'000));
  unit.answer(sync(30, 0, 0));
  unit.pass(1s);
  unit.answer(sync(30, 1, 700'000'000));
  EXPECT_EQ(time(), 3'000'000) << "node 20 is the master";
  unit.answer(sync(10, 0, 0));
  EXPECT_EQ(time(), 3'000'000) << "until that of node 10 is known";
  unit.pass(1s);
  unit.answer(sync(20, 2, 3'000'000));
  unit.answer(sync(10, 1, 50'000'000));
  EXPECT_EQ(time(), 51'000'000);
  unit.pass(2201ms);
  unit.answer(sync(30, 2, 1));
  unit.pass(1s);
  unit.answer(sync(30, 3, 900'000'000));
  EXPECT_EQ(time(), 901'000'000) << "node 10 is silent";
}

TEST_F(DroneCanTime, MayBeAnyNumberOf56Bits) {
  unit.answer(sync(127, 0, 0));
  unit.pass(1s);
  unit.answer(sync(127, 1, (std::uint64_t{1} << 56) - 1));
  EXPECT_EQ(time(), 999'999) << "it wraps";
}

// --- The clock

TEST(DroneCanClock, MayBeStepped) {
  for (const std::string_view settings : {dynamic, std::string_view("raw_imu_hz=1000")}) {
    Unit one(settings), other(settings);
    std::string sent, sent_by_other;
    for (int i = 0; i < 300; ++i) {
      for (Unit* unit : {&one, &other}) {
        std::string& text = unit == &one ? sent : sent_by_other;
        text += unit->pass(37ms) + unit->sample() + ',';
        if (i % 10 == 0)
          text +=
              unit->answer(sync(127, static_cast<unsigned>(i / 10), 1'000'000 + 370'000U * static_cast<unsigned>(i)));
        if (i % 100 == 1) text += unit->answer("1E0BAA8A#0062000164000083");  // a transfer that has no end
        if (i == 30) text += unit->answer(has_6);
        if (i == 50) text += unit->answer(has_12);
        if (i == 70) text += unit->answer(assigned);
      }
      if (i % 7 != 3) continue;
      const Nanoseconds by = i % 2 == 0 ? 100s : -50s;
      other.device->step_clock(by);
      other.now = other.now + by;
    }
    EXPECT_EQ(sent, sent_by_other);
    EXPECT_GT(frames_in(sent), 1000U);
    EXPECT_EQ(one.count("transfers_timed_out"), settings == dynamic ? 0U : 3U);
    EXPECT_EQ(other.count("transfers_timed_out"), one.count("transfers_timed_out"));
  }
}

// --- Transfers

constexpr std::string_view first = "1E0BAA8A#0062000164000083", second = "1E0BAA8A#0000000000726123",
                           third = "1E0BAA8A#775F696D755F6803", fourth = "1E0BAA8A#7A63";
std::string join(std::initializer_list<std::string_view> frames) {
  std::string text;
  for (const std::string_view frame : frames) text += std::string(frame) + ' ';
  return text;
}

TEST(DroneCanTransfers, TimeOutAfterTwoSeconds) {
  Unit unit;
  unit.answer(join({first, second, third}));
  unit.pass(1999ms);
  EXPECT_EQ(frames_in(unit.answer(fourth)), 7U) << "still in time";
  unit.pass(3s);
  unit.answer(join({first, second, third}));
  EXPECT_EQ(unit.count("transfers_timed_out"), 0U);
  unit.pass(2s);
  EXPECT_EQ(unit.count("transfers_timed_out"), 1U);
  EXPECT_EQ(unit.answer(fourth), "");
  EXPECT_EQ(unit.count("transfers_malformed"), 0U);
  EXPECT_EQ(frames_in(unit.answer(join({first, second, third, fourth}))), 7U);
  unit.pass(3s);
  unit.answer(join({first, second}));
  unit.pass(1500ms);
  unit.answer(join({first, second, third}));
  unit.pass(1500ms);
  EXPECT_EQ(frames_in(unit.answer(fourth)), 7U) << "since the transfer's own first frame";
  EXPECT_EQ(unit.count("transfers_timed_out"), 1U);
}

TEST(DroneCanTransfers, MustBeWhole) {
  Unit unit;
  std::uint64_t malformed = 0;
  for (const std::string& wrong :
       {join({first, third, fourth}), join({first, first, second}), join({first, second, third, "1E0BAA8A#7B63"}),
        join({first, "1E0BAA8A#00000000007223"})}) {
    EXPECT_EQ(unit.answer(wrong), "") << wrong;
    EXPECT_GT(unit.count("transfers_malformed"), malformed) << wrong;
    malformed = unit.count("transfers_malformed");
    unit.answer(join({"1E0BAA8A#0000C0"}));  // ends an unfinished one
    malformed = unit.count("transfers_malformed");
  }
  EXPECT_EQ(unit.answer(join({second, third, fourth})), "") << "without its first frame";
  EXPECT_EQ(frames_in(unit.answer(join({first, second, third, fourth}))), 7U);
  EXPECT_EQ(unit.answer(join({first, second, third, fourth})), "") << "repeated";
  unit.pass(2s);
  EXPECT_EQ(frames_in(unit.answer(join({first, second, third, fourth}))), 7U) << "a transfer that has the same id";
}

// A controller may receive a frame twice, if the other nodes' acknowledgement of it is disturbed.
TEST(DroneCanTransfers, MayHaveRepeatedFrames) {
  Unit unit;
  EXPECT_EQ(frames_in(unit.answer(join({first, second, second, third, third, fourth, fourth}))), 7U);
  EXPECT_EQ(unit.answer(join({second, third})), "") << "of no transfer";
  unit.pass(2s);
  EXPECT_EQ(frames_in(unit.answer(join({first, second, "1E0BAA8A#775F696D755F6804", third, fourth}))), 7U)
      << "a frame with another transfer id, and the toggle of the third";
  EXPECT_EQ(unit.count("transfers_malformed"), 0U);
  EXPECT_EQ(unit.answer("1E0BAA8A#0000E0"), "") << "the first frame has no toggle";
  EXPECT_EQ(unit.count("transfers_malformed"), 1U);
}

TEST(DroneCanTransfers, MayBeAsLongAsTheLongestRequest) {
  using namespace dronecan;
  const auto request = [](std::size_t size, unsigned transfer_id) {
    FrameBuffer frames;
    const std::vector<std::byte> payload(size, std::byte{0});
    constexpr DataType write{49, true, 0x515AA1DC77E58429, ""};
    send({.type = 49, .source = 10, .is_service = true, .is_request = true, .destination = 42}, write, transfer_id,
         payload, frames);
    return text_of(frames.frames());
  };
  Unit unit;
  EXPECT_EQ(unit.answer(request(398, 0)), "00310AAA#2600C0");
  EXPECT_EQ(unit.answer(request(400, 1)), "00310AAA#2600C1");
  EXPECT_EQ(unit.answer(request(401, 2)), "");
  EXPECT_EQ(unit.count("transfers_malformed"), 1U);
}

TEST(DroneCanTransfers, AreSentWholeOrNotAtAll) {
  using namespace dronecan;
  const auto frames = std::make_unique<FrameBuffer>();
  const std::vector<std::byte> payload(200);
  while (send({.type = 1003}, raw_imu, 0, payload, *frames) == 29) continue;
  EXPECT_EQ(frames->frames().size(), 58U) << "64 fit";
}

// The oldest unfinished transfers are discarded if there are more than can be received at once.
TEST(DroneCanTransfers, MayBeInterleaved) {
  const auto from = [](std::string_view frame, unsigned source) {
    std::string text(frame);
    char hex[12];
    std::snprintf(hex, sizeof hex, "%02X", 0x80U | source);
    return text.replace(6, 2, hex);
  };
  for (const unsigned nodes : {16U, 20U}) {
    Unit unit;
    for (const std::string_view part : {first, second, third})
      for (unsigned node = 1; node <= nodes; ++node) EXPECT_EQ(unit.answer(from(part, node)), "");
    unsigned answered = 0;
    for (unsigned node = 1; node <= nodes; ++node) answered += !unit.answer(from(fourth, node)).empty();
    EXPECT_EQ(answered, 16U);
    EXPECT_EQ(unit.count("transfers_malformed"), nodes == 16 ? 0U : 4U);
    unit.pass(2s);
    EXPECT_EQ(unit.answer("1E01AA8A#C1").empty(), false);
  }
}

// --- Other nodes with the same node id

TEST(DroneCanNodeId, OfAnotherNodeIsCounted) {
  Unit unit("raw_imu_hz=0");
  EXPECT_EQ(unit.answer("1801552B#07000000480000C0"), "");
  EXPECT_EQ(unit.count("node_id_conflicts"), 0U);
  EXPECT_EQ(unit.answer("1801552A#07000000480000C0"), "");
  EXPECT_EQ(unit.count("node_id_conflicts"), 1U);
  EXPECT_EQ(unit.answer("1E01AAAA#C0"), "") << "a request from itself";
  EXPECT_EQ(unit.count("node_id_conflicts"), 2U);
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.count("node_id_conflicts"), 2U) << "since it was made";
}

// --- The configuration

TEST(DroneCanSettings, AreChecked) {
  for (const std::string_view wrong :
       {"raw_imu_hz=300", "sample_rate_hz=100 raw_imu_hz=200", "static_temperature_hz=3", "unique_id=12",
        "unique_id=00000000000000000000000000000000", "unique_id=0001020304050607x8090a0b0c0d0e0f", "name=IMU",
        "name=", "software_version=1", "software_version=1.2.3", "hardware_version=256.0"})
    EXPECT_THROW(Unit{wrong}, std::invalid_argument) << wrong;
}

TEST(DroneCanSettings, GiveTheLoadOfTheBus) {
  const Protocol& protocol = protocol_named("dronecan");
  const auto messages =
      protocol.can_messages(settings_of(protocol, "raw_imu_hz=1000 solution_hz=100 static_temperature_hz=10"), 1000);
  ASSERT_EQ(messages.size(), 4U);
  EXPECT_EQ(messages[0].can.id, 0x1003E82AU);
  EXPECT_EQ(messages[0].max_frames_per_s, 500);
  EXPECT_EQ(messages[1].can.id, 0x1003EB2AU);
  EXPECT_EQ(messages[1].max_frames_per_s, 7000);
  EXPECT_EQ(messages[1].max_size, 8U);
  EXPECT_EQ(messages[2].max_frames_per_s, 10);
  EXPECT_EQ(messages[2].max_size, 5U);
  EXPECT_EQ(messages[3].can.id, 0x1801552AU);
  EXPECT_EQ(messages[3].max_frames_per_s, 1);
  const auto allocated = protocol.can_messages(settings_of(protocol, dynamic), 1000);
  ASSERT_EQ(allocated.size(), 3U);
  EXPECT_TRUE(allocated[0].is_assigned && allocated[1].is_assigned && !allocated[2].is_assigned);
  EXPECT_EQ(allocated[2].can.id, 0x188A2100U);
}

}  // namespace
}  // namespace imud
