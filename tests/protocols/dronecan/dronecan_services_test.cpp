// DroneCAN: services and parameters. Requests and responses are those that pydronecan encodes (at 08cda37).
#include <fmt/format.h>

#include "protocols/dronecan/services.hpp"
#include "protocols/dronecan/settings.hpp"
#include "tests/protocols/dronecan/dronecan_unit.hpp"

namespace imud {
namespace {

using namespace dronecan_test;

TEST(DroneCanServices, ReportsItsStatusEverySecond) {
  Unit unit("start_up_ms=1500 raw_imu_hz=0");
  EXPECT_EQ(unit.pass(0s), "1801552A#00000000080000C0") << "at power-on: initialization";
  EXPECT_EQ(unit.pass(999'999'999ns), "");
  EXPECT_EQ(unit.pass(1ns), "1801552A#01000000080000C1");
  EXPECT_EQ(unit.pass(1s), "1801552A#02000000000000C2") << "operational";
  Sample saturated;
  saturated.status = status::gyro_saturated_x << 2;
  unit.sample(saturated);
  EXPECT_EQ(unit.pass(1s), "1801552A#03000000400000C3") << "health: warning";
  EXPECT_EQ(unit.pass(1s), "1801552A#04000000000000C4");
  saturated.status |= status::not_valid;
  unit.sample(saturated);
  EXPECT_EQ(unit.pass(1s), "1801552A#05000000800000C5") << "health: error";
  EXPECT_EQ(frames_in(unit.pass(100s)), 100U);
}

TEST(DroneCanServices, GivesItsIdentity) {
  Unit unit(
      "unique_id=000102030405060708090A0B0C0D0E0F name=org.example.imu-1 software_version=1.2 hardware_version=3.4");
  unit.pass(7s);
  EXPECT_EQ(unit.answer("1E01AA8A#C3"),
            "1E010AAA#0E47070000000083 1E010AAA#0000010200000023 1E010AAA#0000000000000003 "
            "1E010AAA#0000000304000123 1E010AAA#0203040506070803 1E010AAA#090A0B0C0D0E0F23 "
            "1E010AAA#006F72672E657803 1E010AAA#616D706C652E6923 1E010AAA#6D752D3143");
}

TEST(DroneCanServices, ListsItsParameters) {
  Unit unit("raw_imu_hz=100");
  std::size_t parameters = 0;
  for (unsigned index = 0;; ++index) {
    char request[32];
    std::snprintf(request, sizeof request, "1E0BAA8A#%02X00%02X", index, 0xC0 + index % 32);
    const std::string answer = unit.answer(request);
    if (answer.find("#00000000") != answer.npos && frames_in(answer) == 1) break;
    ++parameters;
    EXPECT_GE(frames_in(answer), 3U);
    ASSERT_LT(index, 100U);
  }
  EXPECT_EQ(parameters, 13U);
}

TEST(DroneCanServices, ReadsAndWritesParameters) {
  Unit unit("raw_imu_hz=200 sample_rate_hz=1000");
  const std::string_view set_100 =
      "1E0BAA8A#0062000164000083 1E0BAA8A#0000000000726123 1E0BAA8A#775F696D755F6803 1E0BAA8A#7A63";
  EXPECT_EQ(unit.answer(set_100),
            "1E0B0AAA#3526016400000083 1E0B0AAA#0000000001C80023 1E0B0AAA#0000000000000103 "
            "1E0B0AAA#E803000000000023 1E0B0AAA#0001000000000003 1E0B0AAA#0000007261775F23 1E0B0AAA#696D755F687A43");
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) sent += frames_in(unit.sample());
  EXPECT_EQ(sent, 70U) << "at once";
  // The value after a request, by name: reading has the same response as writing.
  EXPECT_EQ(unit.answer("1E0BAA8A#B19E000072617784 1E0BAA8A#5F696D755F687A64"),
            "1E0B0AAA#3526016400000084 1E0B0AAA#0000000001C80024 1E0B0AAA#0000000000000104 "
            "1E0B0AAA#E803000000000024 1E0B0AAA#0001000000000004 1E0B0AAA#0000007261775F24 1E0B0AAA#696D755F687A44");
  // A bool has no limits.
  EXPECT_EQ(unit.answer("1E0BAA8A#F210000300696E85 1E0BAA8A#74656772616C7365"),
            "1E0B0AAA#F48D030003010085 1E0B0AAA#00696E7465677225 1E0B0AAA#616C7345");
  for (const std::string_view unknown : {"1E0BAA8A#DEF9000403616286 1E0BAA8A#636E616D6566",
                                         "1E0BAA8A#00020000C03F78C7", "1E0BAA8A#FF00C8", "1E0BAA8A#00F8C9"})
    EXPECT_EQ(unit.answer(unknown).substr(0, 17), "1E0B0AAA#00000000") << unknown;
}

// AP_Periph's, as delivered; the requests were made by the rules of the transport layer, and as the one above.
TEST(DroneCanServices, FiltersAreParameters) {
  Unit unit("sample_rate_hz=1000");
  const auto cut_offs = [&] {
    const std::optional<SensorFilters> filters = unit.device->filters();
    return filters ? std::pair{filters->gyro.cut_off_hz.x(), filters->accelerometer.cut_off_hz.x()}
                   : std::pair{-1.0, -1.0};
  };
  EXPECT_EQ(cut_offs(), (std::pair{20.0, 20.0}));
  EXPECT_EQ(unit.device->filters()->gyro.order, 2);
  unit.answer("1E0BAA8A#878B000132000084 1E0BAA8A#0000000000677924 1E0BAA8A#726F5F66696C7404 1E0BAA8A#65725F687A64");
  EXPECT_EQ(cut_offs(), (std::pair{50.0, 20.0}));
  unit.answer(
      "1E0BAA8A#FE7E000100000085 1E0BAA8A#0000000000616325 1E0BAA8A#63656C65726F6D05 1E0BAA8A#657465725F666925 "
      "1E0BAA8A#6C7465725F687A45");
  EXPECT_EQ(cut_offs(), (std::pair{50.0, 0.0})) << "none";
  EXPECT_FALSE(unit.device->filters()->accelerometer.is_on());
  unit.answer("1E0BAA8A#F23F000101010086 1E0BAA8A#0000000000677926 1E0BAA8A#726F5F66696C7406 1E0BAA8A#65725F687A66");
  EXPECT_EQ(cut_offs(), (std::pair{50.0, 0.0})) << "257 Hz is beyond the range";
  unit.device->power_on(unit.now);
  EXPECT_EQ(cut_offs(), (std::pair{20.0, 20.0})) << "were not saved";
  EXPECT_FALSE(Unit("sample_rate_hz=40 raw_imu_hz=40").device->filters()->gyro.is_on()) << "half of the rate";
}

// The response to a value that is not valid, or of another type, has the present value.
TEST(DroneCanServices, KeepsAParameterThatIsSetWrongly) {
  Unit unit("raw_imu_hz=200 sample_rate_hz=1000");
  for (const std::string_view wrong :
       {"1E0BAA8A#127800012C010085 1E0BAA8A#0000000000726125 1E0BAA8A#775F696D755F6805 1E0BAA8A#7A65",  // 300
        "1E0BAA8A#D59E0001FFFFFF86 1E0BAA8A#FFFFFFFFFF726126 1E0BAA8A#775F696D755F6806 1E0BAA8A#7A66",  // -1
        "1E0BAA8A#36000001D0070087 1E0BAA8A#0000000000726127 1E0BAA8A#775F696D755F6807 1E0BAA8A#7A67",  // 2000
        "1E0BAA8A#596800020000C888 1E0BAA8A#427261775F696D28 1E0BAA8A#755F687A48"}) {                   // 100.0
    const std::string answer = unit.answer(wrong);
    EXPECT_EQ(frames_in(answer), 7U) << wrong;
    EXPECT_EQ(answer.substr(13, 10), "01C8000000") << answer;  // the first bytes of the value: 200
  }
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) sent += frames_in(unit.sample());
  EXPECT_EQ(sent, 140U);
}

TEST(DroneCanServices, SavesAndErasesParameters) {
  constexpr std::string_view save = "1E0AAA8A#00000000000000C%u", erase = "1E0AAA8A#01000000000000C%u",
                             restart = "1E05AA8A#1E1B55CEACC%u";
  const auto text = [](std::string_view form, unsigned transfer_id) {
    char line[64];
    std::snprintf(line, sizeof line, form.data(), transfer_id);
    return std::string(line);
  };
  Unit unit("raw_imu_hz=200");
  const auto frames_of_100 = [&] {
    std::size_t sent = 0;
    for (int i = 0; i < 100; ++i) sent += frames_in(unit.sample());
    return sent / 7;
  };
  const std::string_view set_100 =
      "1E0BAA8A#0062000164000083 1E0BAA8A#0000000000726123 1E0BAA8A#775F696D755F6803 1E0BAA8A#7A63";
  EXPECT_EQ(frames_of_100(), 20U);
  unit.answer(set_100);
  EXPECT_EQ(frames_of_100(), 10U);
  EXPECT_EQ(unit.answer(text(restart, 0)), "1E050AAA#80C0");
  EXPECT_EQ(frames_of_100(), 20U) << "was not saved";
  unit.answer(set_100);
  EXPECT_EQ(unit.answer(text(save, 1)), "1E0A0AAA#00000000000080C1");
  EXPECT_EQ(unit.answer(text(restart, 1)), "1E050AAA#80C1");
  EXPECT_EQ(frames_of_100(), 10U);
  unit.device->power_on(unit.now);
  EXPECT_EQ(frames_of_100(), 10U);
  EXPECT_EQ(unit.answer(text(erase, 2)), "1E0A0AAA#00000000000080C2");
  EXPECT_EQ(frames_of_100(), 20U);
  unit.device->power_on(unit.now);
  EXPECT_EQ(frames_of_100(), 20U);
  EXPECT_EQ(unit.answer("1E0AAA8A#02000000000000C6"), "1E0A0AAA#00000000000000C6") << "there is no such opcode";
}

TEST(DroneCanServices, ChangesItsNodeIdAtARestart) {
  Unit unit("raw_imu_hz=0");
  unit.pass(10s);
  EXPECT_EQ(frames_in(unit.answer("1E0BAA8A#FB88000132000089 1E0BAA8A#00000000006E6F29 1E0BAA8A#64655F696449")), 7U);
  EXPECT_EQ(unit.answer("1E0AAA8A#00000000000000C0"), "1E0A0AAA#00000000000080C0");
  EXPECT_EQ(unit.pass(1s), "1801552A#0B000000000000CB");
  EXPECT_EQ(unit.answer("1E05AA8A#1F1B55CEACC3"), "1E050AAA#00C3") << "not the magic number";
  EXPECT_EQ(unit.answer("1E05AA8A#1E1B55CEACC4"), "1E050AAA#80C4");
  EXPECT_EQ(unit.pass(0s), "18015532#00000000000000C0") << "node 50, up since now";
  EXPECT_EQ(unit.answer("1E01AA8A#C0"), "") << "to node 42";
  EXPECT_EQ(frames_in(unit.answer("1E01B28A#C0")), 8U) << "to node 50";
}

TEST(DroneCanServices, ReportsTransportStatistics) {
  Unit unit("raw_imu_hz=1000");
  unit.pass(0s);               // NodeStatus: 1 frame
  unit.sample();               // RawIMU: 7 frames
  unit.answer("1E01AA8A#C0");  // GetNodeInfo: 8 frames
  EXPECT_EQ(unit.count("transfers_malformed"), 0U);
  unit.answer("1E0BAA8A#0000000000000082 1E0BAA8A#00000022");  // the second frame is not full
  EXPECT_EQ(unit.count("transfers_malformed"), 1U);
  Frame error;
  error.can.error = true;
  const auto replies = std::make_unique<FrameBuffer>();
  unit.device->receive(error, unit.now, *replies);
  const std::string answer = unit.answer("1E04AA8A#C3");
  ASSERT_EQ(frames_in(answer), 6U);
  std::string payload;
  for (std::size_t at = 9; at < answer.size(); at += 26) payload += answer.substr(at, 14);
  EXPECT_EQ(payload.substr(4, 72),
            "030000000000020000000000010000000000"    // transfers sent, received, errors
            "100000000000040000000000010000000000");  // frames sent, received, errors
}

TEST(DroneCanServices, KnowsItsDataTypes) {
  Unit unit;
  const std::string_view raw_imu =
      "1E020AAA#193FB574E5402C83 1E020AAA#638082EB03010523 1E020AAA#75617663616E2E03 1E020AAA#65717569706D6523 "
      "1E020AAA#6E742E6168727303 1E020AAA#2E526177494D5563";
  EXPECT_EQ(unit.answer("1E02AA8A#EB0301C3"), raw_imu);
  EXPECT_EQ(unit.answer("1E02AA8A#A695000000756184 1E02AA8A#7663616E2E707224 1E02AA8A#6F746F636F6C2E04 "
                        "1E02AA8A#706172616D2E4724 1E02AA8A#657453657444"),
            "1E020AAA#E3CCD5A4D139F984 1E020AAA#22B6A70B00000924 1E020AAA#75617663616E2E04 "
            "1E020AAA#70726F746F636F24 1E020AAA#6C2E706172616D04 1E020AAA#2E47657453657464")
      << "by name";
  EXPECT_EQ(unit.answer("1E02AA8A#611E00C5"), "1E020AAA#E477000000000085 1E020AAA#0000000000000065") << "not known";
}

// GetDataTypeInfo knows each message that the node sends, and a fault in its frames gets a right checksum.
TEST(DroneCanServices, KnowsTheDataTypeOfEachMeasurement) {
  ASSERT_EQ(dronecan::streams.size(), 7U);
  for (const dronecan::Stream& stream : dronecan::streams) {
    EXPECT_EQ(dronecan::find_message(stream.type->id), stream.type) << stream.type->name;
    Unit unit;
    const std::string request =
        fmt::format("1E02AA8A#{:02X}{:02X}01C3", stream.type->id & 0xFF, stream.type->id >> 8);
    EXPECT_GT(frames_in(unit.answer(request)), 2U) << stream.type->name << ": the name follows";
  }
}

TEST(DroneCanServices, RefusesWhatItDoesNotHave) {
  struct {
    std::string_view request, response;
  } constexpr refusals[] = {
      {"1E06AA8A#406C73C3", "1E060AAA#2B50010000000283 1E060AAA#6E6F207368656C23 1E060AAA#6C43"},  // shell
      {"1E0FAA8A#0A00C3", "1E0F0AAA#03C3"},                                                        // enumeration
      {"1E28AA8A#0A66772E62696EC3", "1E280AAA#8EEA016E6F742083 1E280AAA#737570706F727423 1E280AAA#656443"},
      {"1E2DAA8A#C3", "1E2D0AAA#07DF000000000083 1E2D0AAA#26000063"},  // files
      {"1E2EAA8A#00000000C3", "1E2E0AAA#260000C3"},
      {"1E2FAA8A#C3", "1E2F0AAA#2600C3"},
      {"1E30AA8A#0000000000C3", "1E300AAA#2600C3"},
      {"1E31AA8A#F205000000000083 1E31AA8A#0061626363", "1E310AAA#2600C3"},
      {"1E3FAA8A#0000C3", "1E3F0AAA#C3"},  // tunnel
  };
  Unit unit;
  for (const auto& [request, response] : refusals) EXPECT_EQ(unit.answer(request), response);
  EXPECT_EQ(unit.answer("1EC8AA8A#C3"), "") << "a service that nobody knows";
  for (const std::string_view short_one :
       {"1E02AA8A#EB03C4", "1E05AA8A#1E1B55CEC4", "1E0AAA8A#000000000000C4", "1E0BAA8A#00C4", "1E0BAA8A#000100C5",
        "1E0BAA8A#000409C6", "1E0BAA8A#0005C7"})
    EXPECT_EQ(unit.answer(short_one), "") << short_one;
  EXPECT_EQ(unit.count("transfers_malformed"), 7U);
}

// Responses, requests to other nodes and from nobody, and frames that are not DroneCAN's have no answer.
TEST(DroneCanServices, AnswersOnlyWhatIsAddressedToIt) {
  Unit unit;
  for (const std::string_view other :
       {"1E012A8A#C0", "1E01AB8A#C0", "1E01AA80#C0", "1E01AA8A#R", "1E01AA8A##0C0", "0AA#C0", "1E01AA8A#"})
    EXPECT_EQ(unit.answer(other), "") << other;
  EXPECT_EQ(frames_in(unit.answer("1E01AA8A#C0")), 8U);
}

}  // namespace
}  // namespace imud
