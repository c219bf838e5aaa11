// Datagrams of real STIM300s: decoded to their values, and encoded to the same bytes.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "protocols/stim300/datagram.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;
using Bytes = std::vector<std::byte>;

// The raw numbers of a cluster, and its status.
struct Known {
  std::array<double, 3> of;
  unsigned status;
};

Bytes written(const stim300::Configuration& configuration, const std::array<Known, 3>& known,
              const stim300::Reading& reading) {
  stim300::Memory memory;
  memory.active = configuration;
  std::array<stim300::Axes, 3> axes;
  for (const stim300::Cluster cluster : stim300::clusters) {
    const Known& one = known[cluster];
    const double lsb = stim300::lsb(configuration, cluster, stim300::value);
    axes[cluster].add(lanes(Vector3(one.of[0], one.of[1], one.of[2])) * lsb, Lanes{}, one.status);
  }
  FrameBuffer out;
  write_measurement(axes, reading, memory, out);
  const auto bytes = out.frames()[0].bytes;
  return {bytes.begin(), bytes.end()};
}

// 10 g, AUX, without CR LF: geirhovland/stim300, README (its CRC is printed there).
TEST(Stim300Known, AHealthyDatagram) {
  const Bytes real =
      hex("af000124fffad600035b00ffe7a6ffdd36081c5200ff7e70feba0c3ffa1d0023a023c023a0002319230a231c00239523b6239500ff"
          "ef0200"
          "e101fac64942c6");
  const Recording recording = Stim300Unit().decode({real});
  ASSERT_EQ(recording.measurements.size(), 1U);
  const Sample& s = recording.measurements[0].sample;
  const Vector3 dps(0.017822265625, -0.0806884765625, 0.05242919921875);
  const Vector3 g(-0.011890411376953125, -0.016986846923828125, 1.0138282775878906);
  EXPECT_TRUE(s.rate.isApprox(dps * units::degree, 1e-15));
  EXPECT_TRUE(s.specific_force.isApprox(g * units::standard_gravity, 1e-15));
  EXPECT_EQ(s.temperature_c, 35.625);
  EXPECT_EQ(s.counter, 225U);
  EXPECT_EQ(s.status, 0U);

  // The emulator has one temperature for these nine, which therefore differ, as does the CRC.
  stim300::Configuration c;
  c.content = 15;
  c.has_aux = true;
  const Bytes own = written(
      c, {{{{292, -1322, 859}, 0}, {{-6234, -8906, 531538}, 0}, {{-33168, -83444, 4192797}, 0}}},
      {.temperature_c = 35.625, .status = 0, .pps = 0xFFEF02, .pps_status = 0, .counter = 225, .latency_us = 506});
  ASSERT_EQ(own.size(), real.size());
  EXPECT_EQ(Bytes(own.begin(), own.begin() + 33), Bytes(real.begin(), real.begin() + 33))
      << "and the first temperature";
  EXPECT_EQ(Bytes(own.begin() + 51, own.begin() + 59), Bytes(real.begin() + 51, real.begin() + 59));
}

// With CR LF, overloads and every error: UBC-Rocket/Whistler-Blackcomb-v2 d438366, data/imu/imu_uart_data_2.txt, at
// these bytes.
TEST(Stim300Known, DatagramsOfAUnitInTrouble) {
  constexpr double most = 480 * 0x1p14;
  struct Datagram {
    int at;
    const char* bytes;
    std::array<Known, 3> known;
    unsigned counter, latency_us;
  };
  const std::array<Known, 3> broken = {{{{most, most, -most}, 0xFF},
                                        {{46552, -30953, 13950}, 0xEF},
                                        {{0x1p23 - 1, 1.236325740814209 * 0x1p22, -0x1p23}, 0xFF}}};
  const auto starting = [](double z, Known force, const Vector3& incline) {
    return std::array<Known, 3>{
        {{{most, most, z}, 0x5F}, force, {{incline.x() * 0x1p22, incline.y() * 0x1p22, incline.z() * 0x1p22}, 0x4F}}};
  };
  const Datagram datagrams[] = {
      {0, "93780000780000880000ff00b5d8ff871700367eef7fffff4f1ff6800000ff0101fa2f7d41270d0a", broken, 1, 506},
      {40, "93780000780000880000ff00b5d8ff871700367eef7fffff4f1ff6800000ff0201fcf0b902a20d0a", broken, 2, 508},
      {80, "93780000780000880000ff00b5d8ff871700367eef7fffff4f1ff6800000ff0301f8bed6d7330d0a", broken, 3, 504},
      {1560, "937800007800007800005f02488eff2c0003c47e4f1d192d01071b3c8bf84f2801fbc3e0b3a40d0a",
       starting(most, {{149646, -54272, 246910}, 0x4F},
                {0.45466160774230957, 0.016058683395385742, 0.9460430145263672}),
       40, 507},
      {1600, "937800007800007800005f024543ff2b7203c5484f1d121d00fa863c7e8b4f2901fa2eea54bf0d0a",
       starting(most, {{148803, -54414, 247112}, 0x4F},
                {0.45423054695129395, 0.01529073715209961, 0.9452235698699951}),
       41, 506},
      {1640, "937800007800008800005f02463aff292403c4624f1d11f001059a3c6f394f2a01fa94dd81c60d0a",
       starting(-most, {{149050, -55004, 246882}, 0x4F},
                {0.4542198181152344, 0.01596689224243164, 0.9442884922027588}),
       42, 506},
  };
  Stim300Unit unit("cr_lf=true");
  for (const Datagram& datagram : datagrams) {
    SCOPED_TRACE(datagram.at);
    const Recording recording = unit.decode({hex(datagram.bytes)});
    ASSERT_EQ(recording.measurements.size(), 1U);
    const Sample& s = recording.measurements[0].sample;
    const auto vector = [](const Known& known) { return Vector3(known.of[0], known.of[1], known.of[2]); };
    EXPECT_TRUE(s.rate.isApprox(vector(datagram.known[0]) * 0x1p-14 * units::degree, 1e-15));
    EXPECT_TRUE(s.specific_force.isApprox(vector(datagram.known[1]) * 0x1p-19 * units::standard_gravity, 1e-15));
    EXPECT_EQ(s.counter, datagram.counter);
    EXPECT_EQ(s.status, 7U | (datagram.at < 1560 ? status::not_valid : 0U))
        << "the accelerometers' have no overload bit";

    stim300::Configuration c;
    c.content = 3;
    c.cr_lf = true;
    const stim300::Reading reading = {.temperature_c = 0,
                                      .status = 0,
                                      .pps = 0,
                                      .pps_status = 0,
                                      .counter = datagram.counter,
                                      .latency_us = datagram.latency_us};
    EXPECT_EQ(written(c, datagram.known, reading), hex(datagram.bytes));
  }
  EXPECT_EQ(unit.decoder->errors().skipped_bytes, 0U);
}

// The decoder searches the rest of an incomplete datagram for the beginning of the next one.
TEST(Stim300Decoder, ADatagramCutOffTakesNoneWithIt) {
  Stim300Unit unit("start_up=false,sample_rate=2000,bit_rate=1843200");
  const auto datagrams = unit.run(4);
  ASSERT_EQ(datagrams.size(), 4U);
  for (std::size_t cut = 1; cut < datagrams[0].size(); ++cut) {
    Stim300Unit reader;
    const Recording recording =
        reader.decode({{datagrams[0].begin(), datagrams[0].begin() + static_cast<std::ptrdiff_t>(cut)},
                       datagrams[1],
                       datagrams[2]});
    ASSERT_EQ(recording.measurements.size(), 2U) << cut;
    EXPECT_EQ(recording.measurements[0].sample.counter, 1U);
    EXPECT_EQ(reader.decoder->errors().skipped_bytes, cut);
    EXPECT_GE(reader.decoder->errors().checksum, 1U);
  }
}

// Table 5-11: each special datagram has an identifier of its own with CR LF.
TEST(Stim300Decoder, TakesTheTerminationOfDatagramsFromTheSpecialOnes) {
  for (const bool cr_lf : {false, true})
    for (const char* request : {"N", "I", "C", "T", "E"}) {
      Stim300Unit unit(cr_lf ? "start_up=false,cr_lf=true" : "start_up=false");
      Stim300Unit reader(cr_lf ? "" : "cr_lf=true");
      unit.send_line(request);
      const auto datagrams = unit.run(21);
      ASSERT_EQ(datagrams.size(), 11U);
      EXPECT_EQ(reader.decode(datagrams).measurements.size(), 10U) << request;
      EXPECT_EQ(reader.decoder->errors().skipped_bytes, 0U) << request << cr_lf;
    }
}

// The line of a real unit ends without a full stop (cookednoodle/pystim300 cd54334, tests/test_client.py,
// test_exit_service_real_hardware_no_period).
TEST(Stim300Known, TheEndOfServiceMode) {
  Stim300Unit unit;
  unit.send_line("SERVICEMODE");
  EXPECT_EQ(unit.send_line("x N"), "x N\rSYSTEM RETURNING TO NORMAL MODE\r");
}

}  // namespace
}  // namespace imud
