// The STIM300 against its datasheet, TS1524 rev. 31.
#include <gtest/gtest.h>

#include <cmath>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;

// Tables 5-12, 5-21, 5-22: identifier, size, checksum of every content.
TEST(Stim300, EveryDatagramHasItsIdentifierAndSize) {
  const std::array<unsigned, 16> identifiers = {0x90, 0x91, 0x92, 0x93, 0x94, 0xA5, 0xA6, 0xA7,
                                                0xF0, 0xF1, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7};
  const std::array<unsigned, 16> with_aux = {0x90, 0x91, 0x92, 0x93, 0x94, 0xA5, 0xA6, 0xA7,
                                             0x98, 0x99, 0x9A, 0x9B, 0x9C, 0xAD, 0xAE, 0xAF};
  const std::array<std::size_t, 16> sizes = {18, 28, 28, 38, 25, 42, 42, 59, 22, 32, 32, 42, 29, 46, 46, 63};
  for (unsigned content = 0; content < 32; ++content) {
    const auto flag = [&](unsigned bit) { return (content >> bit & 1U) != 0 ? "true" : "false"; };
    for (const bool cr_lf : {false, true}) {
      Stim300Unit unit(std::string("start_up=false,sample_rate=500,acceleration=") + flag(0) +
                       ",inclination=" + flag(1) + ",temperature=" + flag(2) + ",pps=" + flag(3) +
                       ",aux_input=" + flag(4) + ",cr_lf=" + (cr_lf ? "true" : "false"));
      unit.sample.rate = {0.1, -0.2, 0.3};
      unit.sample.specific_force = {1, 2, -9};
      const auto datagrams = unit.run(40);
      ASSERT_EQ(datagrams.size(), 10U);
      EXPECT_EQ(first(datagrams[0]), (content & 16U) != 0 ? with_aux[content & 15U] : identifiers[content]);
      EXPECT_EQ(datagrams[0].size(), sizes[content & 15U] + (cr_lf ? 2U : 0U));
      const Recording recording = unit.decode(datagrams);
      ASSERT_EQ(recording.measurements.size(), 10U);
      EXPECT_NEAR(recording.measurements[9].sample.rate.y(), -0.2, 0x1p-15 * units::degree);
      EXPECT_EQ(recording.measurements[9].sample.counter, 36U);  // internal samples
    }
  }
}

TEST(Stim300, EveryUnitIsWhatTheModelSays) {
  for (const int range : {5, 10, 30, 80}) {
    const double force_lsb = (range == 5 ? 0x1p-20 : range == 10 ? 0x1p-19 : range == 30 ? 0x1p-18 : 0x1p-16);
    for (const bool increments : {false, true}) {
      Stim300Unit unit("start_up=false,sample_rate=250,accelerometer_range_g=" + std::to_string(range) +
                       (increments ? ",gyro_unit=increment,accelerometer_unit=increment"
                                   : ",gyro_unit=average,accelerometer_unit=average"));
      unit.sample.rate = {0.5, -1.5, 3};
      unit.sample.specific_force = {-2, 9.8, 25};
      unit.sample.delta_angle = {0.0006, -0.0004, 0.002};
      unit.sample.delta_velocity = {0.001, 0.0049, -0.0125};
      unit.run(8);
      const Recording recording = unit.decode(unit.run(8));
      ASSERT_EQ(recording.measurements.size(), 1U);
      const Sample& s = recording.measurements[0].sample;
      // Eight internal samples.
      if (increments) {
        EXPECT_LE((s.delta_angle - 8 * unit.sample.delta_angle).cwiseAbs().maxCoeff(), 0x1p-22 * units::degree);
        EXPECT_LE((s.delta_velocity - 8 * unit.sample.delta_velocity).cwiseAbs().maxCoeff(), force_lsb / 16);
      } else {
        EXPECT_LE((s.rate - 2000 * unit.sample.delta_angle).cwiseAbs().maxCoeff(), 0x1p-15 * units::degree);
        EXPECT_LE((s.specific_force - 2000 * unit.sample.delta_velocity).cwiseAbs().maxCoeff(),
                  force_lsb / 2 * units::standard_gravity);
      }
    }
  }
}

// Section 7.5.2.2.5: in [-4, 4) deg, without an error.
TEST(Stim300, AnIntegratedAngleWraps) {
  Stim300Unit unit(
      "start_up=false,sample_rate=2000,bit_rate=1843200,acceleration=false,inclination=false,temperature=false,gyro_"
      "unit=integrated");
  unit.sample.delta_angle = {0.1 * units::degree, -0.1 * units::degree, 0};
  double angle = 0, before = 0;
  int wrapped = 0;
  const auto datagrams = unit.run(300);
  ASSERT_EQ(datagrams.size(), 300U);
  for (const auto& datagram : datagrams) {
    angle += 0.1;
    const auto at = [&](std::size_t i) { return std::to_integer<std::int32_t>(datagram[i]); };
    const double shown = ((at(1) << 24 | at(2) << 16 | at(3) << 8) >> 8) * 0x1p-21;
    EXPECT_GE(shown, -4);
    EXPECT_LT(shown, 4);
    EXPECT_NEAR(std::remainder(shown - angle, 8), 0, 0x1p-22 + 1e-12);
    wrapped += shown < before ? 1 : 0;
    before = shown;
  }
  EXPECT_EQ(wrapped, 4) << "30 deg";
}

// Section 7.5.1 and Table 5-2: three special datagrams, from 0.2 s at most after the reset on; valid after 0.7 s.
TEST(Stim300, StartsUpAsAfterPowerOn) {
  Stim300Unit unit("");
  const auto check = [&] {
    EXPECT_TRUE(unit.run(200).empty());
    const auto datagrams = unit.run(200);
    ASSERT_GT(datagrams.size(), 50U);
    EXPECT_EQ(first(datagrams[0]), 0xB1U);
    EXPECT_EQ(first(datagrams[1]), 0xB5U);
    EXPECT_EQ(first(datagrams[2]), 0xBCU);
    EXPECT_EQ(first(datagrams[3]), 0xA7U);
    EXPECT_EQ(datagrams[3][10], std::byte{0x40});  // start-up
    EXPECT_EQ(unit.run(998).back()[10], std::byte{0x40});
    EXPECT_EQ(unit.run(6).back()[10], std::byte{0});
  };
  check();
  EXPECT_EQ(unit.send_line("R"), "");
  check();
}

// Sections 7.5.2.1 and 8.7: samples that were not sent in a datagram are not part of the next one.
TEST(Stim300, SumsRestartInServiceMode) {
  Stim300Unit unit("start_up=false,sample_rate=500,gyro_unit=increment");
  unit.sample.delta_angle = {0.001, 0, 0};
  unit.run(401);
  unit.send_line("SERVICEMODE");
  unit.run(4002);
  unit.send_line("x N");
  const Recording recording = unit.decode(unit.run(8));
  ASSERT_EQ(recording.measurements.size(), 2U);
  for (const Measurement& measurement : recording.measurements)
    EXPECT_NEAR(measurement.sample.delta_angle.x(), 0.004, 1e-8) << "four internal samples";
}

// Table 5-18, byte 14: error 16 is set during start-up.
TEST(Stim300, TheErrorsOfTheStartAreOverWithIt) {
  for (const int samples : {1398, 1402}) {
    Stim300Unit unit("");
    unit.run(samples);
    unit.send_line("E");
    const auto datagram = unit.run(2).at(0);
    ASSERT_EQ(first(datagram), 0xBEU);
    for (std::size_t byte = 1; byte <= 16; ++byte)
      EXPECT_EQ(std::to_integer<unsigned>(datagram[byte]), samples < 1400 && byte == 14 ? 1U : 0U) << byte;
  }
}

TEST(Stim300, ABiasTrimOffsetIsInTheIncrements) {
  Stim300Unit unit("start_up=false,sample_rate=250,gyro_unit=increment,accelerometer_unit=increment");
  unit.send_line("UTILITYMODE");
  EXPECT_EQ(unit.ask("sbto,0.5,g,y").substr(0, 15), "#sbto,0,0.00000");
  EXPECT_EQ(unit.ask("sbto,0.05,a,z").substr(0, 15), "#sbto,0,0.00000");
  unit.ask("xn");
  unit.run(8);
  const Recording recording = unit.decode(unit.run(8));
  ASSERT_EQ(recording.measurements.size(), 1U);
  const Sample& s = recording.measurements[0].sample;
  EXPECT_NEAR(s.delta_angle.y() / units::degree, 0.5 * 8 / 2000, 0x1p-22) << "8 of 2000 internal samples";
  EXPECT_NEAR(s.delta_velocity.z() / units::standard_gravity, 0.05 * 8 / 2000, 0x1p-22);
}

// Sections 7.5.1 and 8: a request during Init Mode replaces the first Normal Mode datagram.
TEST(Stim300, ARequestDuringTheStartWaitsForNormalMode) {
  const auto identifiers = [](Stim300Unit& unit) {
    std::vector<unsigned> all;
    for (const auto& datagram : unit.run(400)) all.push_back(first(datagram));
    all.resize(5);
    return all;
  };
  Stim300Unit unit("");
  unit.run(100);
  unit.send_line("N");
  unit.send_line("C");
  EXPECT_EQ(identifiers(unit), (std::vector{0xB1U, 0xB5U, 0xBCU, 0xBCU, 0xA7U})) << "the last that was asked for";
  EXPECT_EQ(unit.send_line("E\rR\rI"), "");
  EXPECT_EQ(identifiers(unit), (std::vector{0xB1U, 0xB5U, 0xBCU, 0xB5U, 0xA7U}))
      << "a reset forgets what was asked before";
  unit.send_line("R");
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
  EXPECT_TRUE(unit.run(1000).empty());
  EXPECT_EQ(unit.ask("xn"), "#xn,0");
  EXPECT_EQ(identifiers(unit), (std::vector{0xB1U, 0xB5U, 0xBCU, 0xA7U, 0xA7U})) << "those of the start are not lost";
}

TEST(Stim300, IdentifiesItselfInTheDatasheetsFormat) {
  Stim300Unit unit;
  for (const char* command : {"N", "I", "C", "E", "T"}) {
    unit.run(1);
    EXPECT_EQ(unit.send_line(command), "") << "nothing is echoed";
    const auto datagrams = unit.run(2);
    ASSERT_EQ(datagrams.size(), 1U);
    const std::span<const std::byte> body(datagrams[0].data(), datagrams[0].size() - 4);
    const std::vector<std::byte> bytes(body.begin(), body.end());
    switch (*command) {
      case 'N':
        EXPECT_EQ(bytes, hex("b10841672d4400002d3210030000004b")) << "84167-4400003-321 K";
        break;
      case 'I':
        EXPECT_EQ(bytes, hex("b54e2558240500200200000000000000"));
        break;
      case 'C':
        EXPECT_EQ(bytes, hex("bc4b006e217044407044407044430c00000000000000"));
        break;
      case 'E':
        EXPECT_EQ(bytes, hex("be00000000000000000000000000000000"));
        break;
      default:
        EXPECT_EQ(bytes.size(), 36U);
        break;
    }
    Recording recording;
    unit.decoder->feed({datagrams[0]}, recording);
    EXPECT_EQ(unit.decoder->errors().skipped_bytes + unit.decoder->errors().checksum, 0U);
  }
  EXPECT_EQ(first(unit.run(2)[0]), 0xA7U);
  unit.send_line("n");
  unit.send_line("CC");
  unit.send_line(std::string(300, 'N'));
  EXPECT_EQ(first(unit.run(2)[0]), 0xA7U) << "what is not a command is nothing";
}

// Table 5-12, all of it: the highest rate of each datagram at each bit-rate. At a higher one samples are lost.
TEST(Stim300, ALineTooSlowLosesSamples) {
  const std::array<std::array<int, 4>, 16> table = {{{1000, 2000, 2000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {500, 1000, 2000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {1000, 1000, 2000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {500, 500, 1000, 2000},
                                                     {500, 500, 1000, 2000}}};
  const std::array<int, 4> bit_rates = {374400, 460800, 921600, 1843200};
  for (unsigned content = 0; content < 16; ++content) {
    const auto flag = [&](unsigned bit) { return (content >> bit & 1U) != 0 ? "true" : "false"; };
    for (std::size_t i = 0; i < bit_rates.size(); ++i) {
      for (const int rate : {500, 1000, 2000}) {
        Stim300Unit unit("start_up=false,bit_rate=" + std::to_string(bit_rates[i]) +
                         ",sample_rate=" + std::to_string(rate) + ",acceleration=" + flag(0) +
                         ",inclination=" + flag(1) + ",temperature=" + flag(2) + ",pps=" + flag(3));
        const auto arrived = static_cast<int>(unit.run(2000).size());
        EXPECT_EQ(arrived == rate, rate <= table[content][i]) << content << ' ' << bit_rates[i] << ' ' << rate;
        unit.send_line("E");
        const auto errors = unit.run(16);
        ASSERT_FALSE(errors.empty());
        EXPECT_EQ((errors[0][8] & std::byte{0x10}) != std::byte{0}, arrived < rate) << "E68, UART unable to transmit";
      }
    }
  }
}

// Equation 12, which counts CR LF, parity and stop bits: nothing is lost where it allows a rate, and Service Mode
// agrees.
TEST(Stim300, ALineCarriesWhatTheEquationAllows) {
  const std::array<std::size_t, 16> sizes = {18, 28, 28, 38, 25, 42, 42, 59, 22, 32, 32, 42, 29, 46, 46, 63};
  const std::array<int, 4> bit_rates = {374400, 460800, 921600, 1843200};
  int allowed = 0;
  for (unsigned at = 0; at < 16 * 4 * 8; ++at) {
    const unsigned content = at % 16, code = at / 16 % 4;
    const bool cr_lf = (at & 64U) != 0, parity = (at & 128U) != 0, two_stops = (at & 256U) != 0;
    const auto word = [](bool on) { return std::string(on ? "true" : "false"); };
    const auto bits = (sizes[content] + (cr_lf ? 2 : 0)) * (10U + (parity ? 1 : 0) + (two_stops ? 1 : 0));
    for (const int rate : {500, 1000, 2000}) {
      const bool fits = 1.1 * static_cast<double>(bits) * rate <= bit_rates[code];
      allowed += fits ? 1 : 0;
      Stim300Unit unit("start_up=false,bit_rate=" + std::to_string(bit_rates[code]) +
                       ",sample_rate=" + std::to_string(rate) + ",acceleration=" + word(content & 1U) +
                       ",inclination=" + word(content & 2U) + ",temperature=" + word(content & 4U) +
                       ",pps=" + word(content & 8U) + ",cr_lf=" + word(cr_lf) +
                       ",parity=" + (parity ? "odd" : "none") + ",stop_bits=" + (two_stops ? "2" : "1"));
      EXPECT_EQ(unit.run(200).size() == static_cast<std::size_t>(rate / 10), fits) << at << ' ' << rate;
      unit.send_line("SERVICEMODE");
      const std::string text = unit.send_line(std::string("m ") + (rate == 500 ? '2' : rate == 1000 ? '3' : '4'));
      EXPECT_EQ(text.find("E007") == std::string::npos, fits) << at << ' ' << rate;
    }
  }
  EXPECT_GT(allowed, 500);
  EXPECT_LT(allowed, 1400);
}

TEST(Stim300, StatusBitsReportFaults) {
  Stim300Unit unit;
  const auto status = [&](std::size_t at) {
    unit.run(2);
    return std::to_integer<unsigned>(unit.run(2).at(0)[at]);
  };
  unit.sample.specific_force = {0, 0, 9.8};
  EXPECT_EQ(status(10) | status(20) | status(30), 0U);
  unit.sample.status = status::gyro_saturated_x << 1 | status::accelerometer_saturated_x << 2;
  EXPECT_EQ(status(10), 0x12U);
  EXPECT_EQ(status(20), 0x14U);
  EXPECT_EQ(status(30), 0U);
  unit.sample.status = status::not_valid;
  EXPECT_EQ(status(10), 0x80U);
  unit.sample.status = 0;
  unit.sample.temperature_c = 90;
  EXPECT_EQ(status(10), 0x20U);
  unit.sample.temperature_c = 20;
  unit.sample.specific_force = {18, 0, 9.8};
  EXPECT_EQ(status(30), 0U) << "1.84 g";
  unit.sample.specific_force = {18.5, 0, 9.8};
  EXPECT_EQ(status(30), 0x11U) << "overload at 1.87 g (Table 5-8, note 1)";
  // One of several internal samples is enough (section 7.6).
  unit.run(1);
  unit.sample.status = 1;
  EXPECT_TRUE(unit.run(1).empty());
  unit.sample.status = 0;
  const auto after = unit.run(1);
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(std::to_integer<unsigned>(after[0][10]), 0x11U);
}

// Tables 5-4 to 5-7, note 1. At a range of 30 g, 24 bits hold up to 32 g.
TEST(Stim300, AccelerometersReportOverloadATenthBeyondTheirRange) {
  for (const auto& [range, overload, shown] :
       {std::tuple{"5", 5.5, 0x580000}, {"10", 11.0, 0x580000}, {"30", 33.0, 0x7FFFFF}, {"80", 96.0, 0x600000}}) {
    Settings settings(find_protocol("stim300")->settings);
    settings.set_text("accelerometer_range_g", range);
    const Product product = find_protocol("stim300")->product(settings);
    EXPECT_NEAR(product.accelerometer.max / units::standard_gravity, overload, 1e-9) << range;
    Stim300Unit unit(std::string("start_up=false,accelerometer_range_g=") + range);
    unit.sample.specific_force = {0, product.accelerometer.max, 0};
    unit.sample.status = status::accelerometer_saturated_x << 1;
    const auto datagram = unit.run(2).at(0);
    EXPECT_EQ(datagram[20], std::byte{0x12});
    const auto at = [&](std::size_t i) { return std::to_integer<int>(datagram[i]); };
    EXPECT_EQ(at(14) << 16 | at(15) << 8 | at(16), shown) << range;
  }
}

// Real units' frames show 0x7FFFFF and 0x800000 (stim300_known_test.cpp).
TEST(Stim300, TheInclinometerEndsWithItsFormat) {
  Stim300Unit unit;
  unit.sample.specific_force = Vector3(1.9, 2.5, -2.5) * units::standard_gravity;
  const auto datagram = unit.run(2).at(0);
  EXPECT_EQ((std::vector<std::byte>(datagram.begin() + 21, datagram.begin() + 31)), hex("79999a7fffff80000017"));
}

// Inclinometers are sensors beside the accelerometers, with their own status, trim and units.
TEST(Stim300, TheInclinometersAreTheirOwn) {
  Stim300Unit unit;
  unit.sample.specific_force = Vector3(0.5, -0.5, 3) * units::standard_gravity;
  unit.sample.inclination = Vector3(0.25, -0.25, 1.5) * units::standard_gravity;
  const auto cluster = [&](std::size_t begin) {
    const auto datagram = unit.run(4).at(1);  // the first may have the status of a sample before
    return std::vector<std::byte>(datagram.begin() + static_cast<std::ptrdiff_t>(begin),
                                  datagram.begin() + static_cast<std::ptrdiff_t>(begin + 10));
  };
  EXPECT_EQ(cluster(11), hex("040000fc000018000000"));  // 2^-19 g
  EXPECT_EQ(cluster(21), hex("100000f0000060000000"));  // 2^-22 g
  unit.sample.inclination = Vector3(0.25, -0.25, 1.9) * units::standard_gravity;
  EXPECT_EQ(cluster(21), hex("100000f0000079999a14")) << "overload at 1.87 g";
  unit.sample.inclination = Vector3(0.25, -0.25, 1.5) * units::standard_gravity;
  unit.sample.status = 2U * status::inclinometer_saturated_x;
  EXPECT_EQ(cluster(21), hex("100000f0000060000012")) << "overload of a range that ends before";
  EXPECT_EQ(cluster(11), hex("040000fc000018000000"));
  unit.sample.status = 0;
  unit.send_line("SERVICEMODE");
  unit.send_line("b 0.015625,i,x");
  unit.send_line("x N");
  EXPECT_EQ(cluster(21), hex("110000f0000060000000"));
  EXPECT_EQ(cluster(11), hex("040000fc000018000000"));
}

// The newest sample that is compensated at the edge has its own inclinometers.
TEST(Stim300, InclinometersFollowAnExternalTrigger) {
  Stim300Unit unit("start_up=false,sample_rate=0,bit_rate=1843200");
  unit.sample.inclination = Vector3(0.25, 0, 0) * units::standard_gravity;
  unit.run(2);
  unit.sample.inclination = Vector3(0.5, 0, 0) * units::standard_gravity;
  unit.run(1);
  unit.sample.inclination = Vector3(0.75, 0, 0) * units::standard_gravity;
  unit.device->trigger(unit.now() + std::chrono::microseconds(400));
  const auto datagram = unit.run(1).at(0);
  EXPECT_EQ((std::vector<std::byte>(datagram.begin() + 21, datagram.begin() + 24)), hex("200000"));
}

// Section 12.
TEST(Stim300, ThePartNumberIsThatOfItsAccelerometers) {
  for (const auto& [range, id] : {std::pair{"5", "84458"}, {"10", "84167"}, {"30", "84461"}, {"80", "84615"}}) {
    Stim300Unit unit(std::string("start_up=false,accelerometer_range_g=") + range);
    const std::string number = id;
    unit.send_line("N");
    const auto datagram = unit.run(2).at(0);
    EXPECT_EQ((std::vector<std::byte>(datagram.begin(), datagram.begin() + 5)), hex("b10" + number + "2d"));
    unit.send_line("UTILITYMODE");
    EXPECT_EQ(unit.ask("ix"), "#ix,0," + number + "-4400003-321,K");
    unit.ask("xn");
    const std::string line = "PART NUMBER = " + number + "-4400003-321 REV K\r";
    EXPECT_NE(unit.send_line("SERVICEMODE").find(line), std::string::npos);
    EXPECT_EQ(unit.send_line("i x"), "i x\r" + line + '>');
    EXPECT_NE(unit.send_line("c").find(line), std::string::npos);
  }
}

TEST(Stim300, ACommandCutOffIsDiscarded) {
  Stim300Unit unit;
  FrameBuffer replies;
  const std::string half = "UTILITY";
  unit.device->receive({std::as_bytes(std::span(half))}, unit.now(), replies);
  unit.run(2100);
  EXPECT_EQ(unit.send_line("MODE"), "");
  EXPECT_EQ(unit.send_line("UTILITYMODE"), "#UTILITYMODE,234\r");
}

}  // namespace
}  // namespace imud
