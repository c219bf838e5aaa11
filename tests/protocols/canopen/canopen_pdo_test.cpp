// The transmit PDOs of the CANopen device: when they are sent, what they have, and how a master configures them.
#include "core/units.hpp"
#include "tests/protocols/canopen/canopen_unit.hpp"

namespace imud {
namespace {

using canopen_test::Unit;
using namespace std::chrono_literals;

// Only TPDO1, with the counter.
const std::string counter_only = "self_start=true heartbeat_ms=0 tpdo2_enabled=false tpdo1=counter_u8";

// Makes TPDO1 invalid, calls `change`, and makes it valid again.
template <class Change>
void reconfigure(Unit& unit, Change&& change) {
  EXPECT_EQ(unit.write(0x1800, 1, 0x8000'018A, 4), 0U);
  change();
  EXPECT_EQ(unit.write(0x1800, 1, 0x0000'018A, 4), 0U);
}

// --- When they are sent

TEST(CanopenPdo, EverySampleOrAtTheInhibitTime) {
  Unit unit(counter_only);
  unit.pass(0s);
  EXPECT_EQ(unit.step(), "18A#00");
  EXPECT_EQ(unit.step(), "18A#01");
  EXPECT_EQ(unit.write(0x1800, 3, 250, 2), 0x08000022U) << "the PDO is valid";
  reconfigure(unit, [&] { EXPECT_EQ(unit.write(0x1800, 3, 250, 2), 0U); });  // 25 ms
  std::string sent;
  for (int k = 0; k < 9; ++k) sent += unit.step() + ",";
  EXPECT_EQ(sent, "18A#02,,,18A#05,,,18A#08,,,");
}

TEST(CanopenPdo, TheEventTimerHasNoDrift) {
  Unit unit(counter_only);
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1800, 5, 25, 2), 0U) << "also while the PDO is valid";
  std::string sent;
  for (int k = 0; k < 11; ++k) sent += unit.step() + ",";
  EXPECT_EQ(sent, "18A#00,,,18A#03,,18A#05,,,18A#08,,18A#0A,");
}

TEST(CanopenPdo, AtEverySync) {
  Unit unit(counter_only);
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1800, 2, 1, 1), 0U);
  EXPECT_EQ(unit.send("080#"), "") << "there is no sample yet";
  EXPECT_EQ(unit.step(), "");
  EXPECT_EQ(unit.send("080#"), "18A#00");
  EXPECT_EQ(unit.send("080#"), "18A#00") << "the newest sample";
  unit.step();
  unit.step();
  EXPECT_EQ(unit.send("080#"), "18A#02");
  EXPECT_EQ(unit.send("080#05"), "08A#4082110600000000") << "a SYNC with a counter";
  EXPECT_EQ(unit.count("syncs"), 4U);
  EXPECT_EQ(unit.pass(1s), "08A#0000000600000000");
  unit.send("000#8000");
  EXPECT_EQ(unit.send("080#"), "") << "pre-operational";
  EXPECT_EQ(unit.write(0x1005, 0, 0x4000'0080, 4), 0x06090030U) << "no producer of SYNC";
  EXPECT_EQ(unit.write(0x1005, 0, 0xA0, 4), 0U);
  unit.send("000#0100");
  EXPECT_EQ(unit.send("080#"), "");
  EXPECT_EQ(unit.send("0A0#"), "18A#02");
}

TEST(CanopenPdo, AtEveryThirdSyncOrIfThereIsANewSample) {
  Unit unit(counter_only);
  unit.pass(0s);
  unit.write(0x1800, 2, 3, 1);
  std::string sent;
  for (int k = 0; k < 9; ++k) {
    sent += unit.step();
    sent += unit.send("080#") + ",";
  }
  EXPECT_EQ(sent, ",,18A#02,,,18A#05,,,18A#08,");
  unit.write(0x1800, 2, 0, 1);
  unit.step();
  EXPECT_EQ(unit.send("080#"), "18A#09");
  EXPECT_EQ(unit.send("080#"), "");
  for (const unsigned reserved : {241U, 251U}) EXPECT_EQ(unit.write(0x1800, 2, reserved, 1), 0x06090030U);
}

TEST(CanopenPdo, TheStartValueChoosesTheFirstSync) {
  Unit unit(counter_only);
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1019, 0, 10, 1), 0U);
  EXPECT_EQ(unit.write(0x1800, 6, 4, 1), 0x08000022U);
  reconfigure(unit, [&] {
    unit.write(0x1800, 2, 2, 1);
    EXPECT_EQ(unit.write(0x1800, 6, 4, 1), 0U);
  });
  std::string sent;
  for (int counter : {2, 3, 4, 5, 6, 7, 8, 9, 10, 1, 2}) {
    char sync[8];
    std::snprintf(sync, sizeof sync, "080#%02X", static_cast<unsigned>(counter));
    unit.step();
    sent += unit.send(sync) + ",";
  }
  EXPECT_EQ(sent, ",,18A#02,,18A#04,,18A#06,,18A#08,,18A#0A,");
  EXPECT_EQ(unit.write(0x1006, 0, 10'000, 4), 0U);
  EXPECT_EQ(unit.write(0x1019, 0, 0, 1), 0x08000022U) << "while SYNC has a period";
}

TEST(CanopenPdo, TheStartValueIsOfNoUseWithoutACounter) {
  Unit unit(counter_only);
  unit.pass(0s);
  unit.write(0x1019, 0, 10, 1);
  reconfigure(unit, [&] {
    unit.write(0x1800, 2, 1, 1);
    unit.write(0x1800, 6, 4, 1);
  });
  unit.step();
  EXPECT_EQ(unit.send("080#01"), "");
  EXPECT_EQ(unit.write(0x1019, 0, 0, 1), 0U);
  EXPECT_EQ(unit.send("080#"), "18A#00");
}

TEST(CanopenPdo, ASyncThatStaysAwayIsReported) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  unit.write(0x1006, 0, 10'000, 4);
  EXPECT_EQ(unit.pass(1s), "") << "the first SYNC begins it";
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(unit.send("080#"), "");
    EXPECT_EQ(unit.pass(10ms), "");
  }
  EXPECT_EQ(unit.pass(4ms), "");
  EXPECT_EQ(unit.pass(1ms), "08A#0081110500000000");
  EXPECT_EQ(unit.pass(1s), "");
  EXPECT_EQ(unit.send("080#"), "08A#0000000500000000");
  unit.send("000#0200");
  EXPECT_EQ(unit.pass(1s), "");
  unit.send("000#8000");
  EXPECT_EQ(unit.pass(1s), "") << "a stopped node awaits none";
}

TEST(CanopenPdo, AtARemoteRequest) {
  Unit unit(counter_only);
  unit.pass(0s);
  unit.write(0x1800, 2, 253, 1);
  EXPECT_EQ(unit.send("18A#R"), "");
  EXPECT_EQ(unit.step(), "");
  EXPECT_EQ(unit.send("18A#R"), "18A#00");
  EXPECT_EQ(unit.send("28A#R 18B#R"), "");
  unit.write(0x1800, 2, 252, 1);
  EXPECT_EQ(unit.send("18A#R"), "") << "no SYNC has come";
  EXPECT_EQ(unit.send("080#"), "");
  unit.step();
  EXPECT_EQ(unit.send("18A#R"), "18A#00") << "the sample of the SYNC";
  EXPECT_EQ(unit.send("080# 18A#R"), "18A#01");
  reconfigure(unit, [&] {});
  EXPECT_EQ(unit.write(0x1800, 1, 0x4000'018A, 4), 0U);
  unit.write(0x1800, 2, 253, 1);
  EXPECT_EQ(unit.send("18A#R"), "") << "remote requests are forbidden";
}

TEST(CanopenPdo, InTheOrderOfTheirIdentifiers) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo1=counter_u8 tpdo2=counter_u8 tpdo3=counter_u8 tpdo3_enabled=true");
  unit.pass(0s);
  EXPECT_EQ(unit.step(), "18A#00 28A#00 38A#00");
  EXPECT_EQ(unit.write(0x1800, 1, 0x3FF, 4), 0x06090030U) << "the PDO is valid";
  EXPECT_EQ(unit.write(0x1800, 1, 0x8000'018A, 4), 0U);
  for (const unsigned restricted : {0U, 0x7FU, 0x101U, 0x60AU, 0x58AU, 0x6E0U, 0x70AU, 0x800U, 0x2000'018AU})
    EXPECT_EQ(unit.write(0x1800, 1, restricted, 4), 0x06090030U) << restricted;
  EXPECT_EQ(unit.write(0x1800, 1, 0x3FF, 4), 0U);
  EXPECT_EQ(unit.step(), "28A#01 38A#01 3FF#01");
}

// --- What they have

TEST(CanopenPdo, AMasterMapsOtherObjects) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo2_enabled=false");
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1A00, 0, 0, 1), 0x08000022U) << "the PDO is valid";
  reconfigure(unit, [&] {
    EXPECT_EQ(unit.write(0x1A00, 1, 0x2101'0120, 4), 0x08000022U) << "the mapping is valid";
    EXPECT_EQ(unit.write(0x1A00, 0, 0, 1), 0U);
    EXPECT_EQ(unit.write(0x1A00, 1, 0x1234'0020, 4), 0x06020000U);
    EXPECT_EQ(unit.write(0x1A00, 1, 0x2101'0420, 4), 0x06090011U);
    EXPECT_EQ(unit.write(0x1A00, 1, 0x1000'0020, 4), 0x06040041U);
    EXPECT_EQ(unit.write(0x1A00, 1, 0x2101'0110, 4), 0x06040042U);
    EXPECT_EQ(unit.write(0x1A00, 1, 0x2101'0120, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 2, 0x2160'0110, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 3, 0x1001'0008, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 4, 0x2180'0210, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 0, 4, 1), 0x06040042U) << "nine bytes";
    EXPECT_EQ(unit.write(0x1A00, 0, 9, 1), 0x06040042U);
    EXPECT_EQ(unit.write(0x1A00, 5, 0, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 0, 3, 1), 0U);
  });
  reconfigure(unit, [&] { EXPECT_EQ(unit.write(0x1A00, 0, 0, 1), 0U); });
  EXPECT_EQ(unit.step() + unit.send("18A#R"), "") << "without objects";
  reconfigure(unit, [&] { EXPECT_EQ(unit.write(0x1A00, 0, 3, 1), 0U); });
  unit.sample.temperature_c = -12.34;
  EXPECT_EQ(unit.step(), "18A#000040002EFB00") << "0.25 rad/s, -12.34 degrees, no error";
  unit.sample.status = status::not_valid;
  EXPECT_EQ(unit.step(), "08A#0050810200010000 18A#000040002EFB81");
}

TEST(CanopenPdo, IncrementsAreSumsSinceTheMessageWasSent) {
  Unit unit(
      "self_start=true heartbeat_ms=0 tpdo1=delta_angle_i16.x,counter_u8 tpdo2=delta_angle_i16.x "
      "tpdo1_event_ms=30 tpdo2_type=1");
  unit.sample.delta_angle = Vector3(0x1p-17, 0, 0);
  unit.pass(0s);
  std::string sent;
  for (int k = 0; k < 5; ++k) sent += unit.step() + ",";
  EXPECT_EQ(sent, "18A#010000,,,18A#030003,,");
  EXPECT_EQ(unit.send("080#"), "28A#0500");
  EXPECT_EQ(unit.send("080#"), "28A#0000");
  EXPECT_EQ(unit.step(), "");
  EXPECT_EQ(unit.write(0x2001, 0, 0, 1), 0x06090030U);
  EXPECT_EQ(unit.write(0x2001, 0, 1, 1), 0U) << "restarts all sums";
  EXPECT_EQ(unit.step(), "18A#010006");
  EXPECT_EQ(unit.send("080#"), "28A#0100");
  unit.send("000#8000");
  unit.step();
  unit.step();
  unit.send("000#0100");
  EXPECT_EQ(unit.step(), "18A#010009") << "only those since it is operational";
}

TEST(CanopenPdo, ValuesSaturateAndLsbsCanChange) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo2_enabled=false tpdo1=rate_i16,time_u16");
  unit.pass(0s);
  unit.sample.rate = {1e9, -1e9, 0x1p-12};
  EXPECT_EQ(unit.step(), "18A#FF7F008001006400") << "half an LSB is rounded away from zero";
  EXPECT_EQ(unit.write(0x2103, 1, 0x3F000000, 4), 0U);  // 0.5 rad/s
  unit.sample.rate = {2, -2, 0.2};
  EXPECT_EQ(unit.step(), "18A#0400FCFF0000C800");
  EXPECT_EQ(unit.write(0x2103, 2, 0x3F000000, 4), 0x06010002U);
}

// TIME (CiA 301, 7.2.6): milliseconds since midnight, days since 1984-01-01.
TEST(CanopenPdo, TheTimeOfDayComesFromTheMaster) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo2_enabled=false tpdo1=time_of_day");
  unit.pass(0s);
  EXPECT_EQ(unit.step(), "18A#000000000000");
  EXPECT_EQ(unit.send("100#FF5B26051027"), "");  // 86399999 ms, day 10000
  EXPECT_EQ(unit.step(), "18A#090000001127");
  EXPECT_EQ(unit.step(400us), "18A#090000001127");
  EXPECT_EQ(unit.step(100us), "18A#0A0000001127");
  EXPECT_EQ(unit.write(0x1012, 0, 0x100, 4), 0U);
  EXPECT_EQ(unit.send("100#000000000000"), "") << "not consumed";
  EXPECT_EQ(unit.step(500us), "18A#0A0000001127");
  EXPECT_EQ(unit.write(0x1012, 0, 0xC000'0100, 4), 0x06090030U) << "no producer of TIME";
}

// Object 6010 and its likes: the sum of the angle, which may be inverted, and two offsets, if scaling is on.
TEST(CanopenPdo, SlopesAreThoseOfTheAxesAboveTheHorizontal) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  const double angle = 30 * units::degree, g = 9.80665;
  unit.sample.specific_force = {g * std::sin(angle), 0, -g * std::cos(angle)};
  unit.step();
  EXPECT_EQ(unit.read(0x6010), 3000U);
  EXPECT_EQ(unit.read(0x6020), 0U);
  EXPECT_EQ(unit.write(0x6000, 0, 1, 2), 0U);
  EXPECT_EQ(unit.read(0x6110), 30000U);
  EXPECT_EQ(unit.write(0x6000, 0, 2, 2), 0x06090030U);
  EXPECT_EQ(unit.write(0x6111, 0, 1, 1), 0U);
  EXPECT_EQ(unit.read(0x6110), static_cast<std::uint32_t>(-30000));
  EXPECT_EQ(unit.write(0x6114, 0, 500, 4), 0U);
  EXPECT_EQ(unit.read(0x6110), static_cast<std::uint32_t>(-30000)) << "no scaling";
  EXPECT_EQ(unit.write(0x6111, 0, 3, 1), 0U);
  EXPECT_EQ(unit.read(0x6110), static_cast<std::uint32_t>(-29500));
  EXPECT_EQ(unit.write(0x6112, 0, 1000, 4), 0U) << "the slope is 1 degree now";
  EXPECT_EQ(unit.read(0x6113), 30500U);
  EXPECT_EQ(unit.read(0x6110), 1000U);
  EXPECT_EQ(unit.write(0x6111, 0, 4, 1), 0x06090031U);
  EXPECT_EQ(unit.read(0x6010), 30000U) << "the other object has its own parameters";
  unit.sample.specific_force = {0, -g * std::sin(angle), -g * std::cos(angle)};
  unit.step();
  EXPECT_EQ(unit.read(0x6120), static_cast<std::uint32_t>(-30000));
}

// --- The decoder

TEST(CanopenDecoder, NeverMixesTwoSamples) {
  const Protocol& protocol = protocol_named("canopen");
  const Settings settings = settings_of(protocol, "start_up_ms=0 self_start=true tpdo3_enabled=true");
  Line line(protocol, settings);
  std::mt19937_64 random(5);
  std::vector<Sample> samples = random_samples(1000, protocol, random);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].counter = i;
  std::vector<StoredFrame> frames = line.encode_all(samples);
  std::erase_if(frames, [&](const StoredFrame&) { return random() % 4 == 0; });
  Recording all;
  line.feed(frames, all);
  EXPECT_GT(all.measurements.size(), 200U);
  EXPECT_LT(all.measurements.size(), 700U);
  for (const Measurement& one : all.measurements) {
    const Sample& sent = samples[one.sample.counter];
    EXPECT_NEAR(one.sample.rate.x(), sent.rate.x(), 0x1p-12);
    EXPECT_NEAR(one.sample.specific_force.x(), sent.specific_force.x(), 0x1p-9);
  }
  EXPECT_GT(line.decoder->errors().incomplete, 200U);
}

// A PDO with another schedule makes a measurement of its own.
TEST(CanopenDecoder, SeparatesSchedules) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo3_enabled=true tpdo3=temperature_i16,counter_u8 tpdo3_event_ms=50");
  const auto decoder = unit.protocol.make_decoder(
      settings_of(unit.protocol, "tpdo3_enabled=true tpdo3=temperature_i16,counter_u8 tpdo3_event_ms=50"));
  Recording recording;
  unit.pass(0s);
  for (int k = 0; k < 10; ++k) each_frame(unit.step(), [&](const Frame& frame) { decoder->feed(frame, recording); });
  ASSERT_EQ(recording.measurements.size(), 12U);
  EXPECT_EQ(std::ranges::count_if(
                recording.measurements,
                [](const Measurement& m) { return m.fields == (Measurement::temperature | Measurement::counter); }),
            2);
}

TEST(CanopenPdo, AMappingMayFillTheFrame) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo2_enabled=false");
  unit.pass(0s);
  reconfigure(unit, [&] {
    EXPECT_EQ(unit.write(0x1A00, 0, 0, 1), 0U);
    for (unsigned k = 1; k <= 2; ++k) EXPECT_EQ(unit.write(0x1A00, k, 0x2101'0020 | k << 8, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 0, 2, 1), 0U) << "eight bytes";
  });
  EXPECT_EQ(unit.step().size(), 20U);
  reconfigure(unit, [&] {
    EXPECT_EQ(unit.write(0x1A00, 0, 0, 1), 0U);
    for (unsigned k = 1; k <= 8; ++k) EXPECT_EQ(unit.write(0x1A00, k, 0x1001'0008, 4), 0U);
    EXPECT_EQ(unit.write(0x1A00, 0, 8, 1), 0U) << "eight objects";
  });
  EXPECT_EQ(unit.step(), "18A#0000000000000000");
}

// CiA 301, 1800:6: the first SYNC is the one with this value of the counter.
TEST(CanopenPdo, TheSyncStartValueIsAwaitedWhereverTheCounterBegins) {
  for (const unsigned first : {1U, 3U, 4U, 9U}) {
    Unit unit(counter_only);
    unit.pass(0s);
    unit.send("000#8000");
    EXPECT_EQ(unit.write(0x1019, 0, 10, 1), 0U);
    EXPECT_EQ(unit.write(0x1800, 1, 0x8000'018A, 4), 0U);
    EXPECT_EQ(unit.write(0x1800, 2, 2, 1), 0U);
    EXPECT_EQ(unit.write(0x1800, 6, 3, 1), 0U);
    EXPECT_EQ(unit.write(0x1800, 1, 0x0000'018A, 4), 0U);
    unit.send("000#0100");
    unit.step();
    unsigned sent = 0;
    for (unsigned k = 0; k < 10; ++k) {
      const unsigned counter = (first - 1 + k) % 10 + 1;
      char sync[16];
      std::snprintf(sync, sizeof sync, "080#%02X", counter);
      if (unit.send(sync).empty()) continue;
      if (sent++ == 0) {
        EXPECT_EQ(counter, 3U) << "after " << first;
      }
    }
    EXPECT_GT(sent, 0U) << first;
  }
}

TEST(CanopenPdo, TheTimeOfDayEndsWithThePower) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo2_enabled=false tpdo1=time_of_day");
  unit.pass(0s);
  unit.send("100#FF5B26F51027");  // the four bits above the milliseconds are reserved
  EXPECT_EQ(unit.step(0s), "18A#FF5B26051027");
  unit.device->power_on(unit.now);
  unit.pass(0s);
  EXPECT_EQ(unit.step(), "18A#000000000000");
}

}  // namespace
}  // namespace imud
