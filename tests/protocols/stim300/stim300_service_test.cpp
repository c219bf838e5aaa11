// Service Mode of the STIM300 against its datasheet, TS1524 rev. 31, section 9.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/stim300/stim300_unit.hpp"

namespace imud {
namespace {

using namespace stim300_test;

// Replaces CR by LF, and the signs by "deg" and "+-".
std::string legible(const std::string& raw) {
  std::string text;
  for (const char c : raw) {
    if (c == '\r')
      text += '\n';
    else if (c == '\xB0')
      text += "deg";
    else if (c == '\xB1')
      text += "+-";
    else
      text += c;
  }
  return text;
}

class InService : public Stim300Unit {
 public:
  explicit InService(std::string_view settings = "start_up=false") : Stim300Unit(settings) {
    entry = legible(send_line("SERVICEMODE"));
  }
  // Returns the text between the echo of the line and the prompt, both of which it checks.
  std::string type(const std::string& line) {
    const std::string text = legible(send_line(line)), echo = line + "\n";
    if (!text.starts_with(echo)) return "no echo: " + text;
    if (!text.ends_with("\n>")) return "no prompt: " + text;
    return text.substr(echo.size(), text.size() - echo.size() - 1);
  }
  std::string entry;
};

constexpr const char* g_compensation_off = R"(GYRO G-COMPENSATION:
 BIAS SOURCE, X-AXIS = OFF
 BIAS G-COMP LP-FILTER, X-AXIS = NA
 SCALE SOURCE, X-AXIS = OFF
 SCALE G-COMP LP-FILTER, X-AXIS = NA
 BIAS SOURCE, Y-AXIS = OFF
 BIAS G-COMP LP-FILTER, Y-AXIS = NA
 SCALE SOURCE, Y-AXIS = OFF
 SCALE G-COMP LP-FILTER, Y-AXIS = NA
 BIAS SOURCE, Z-AXIS = OFF
 BIAS G-COMP LP-FILTER, Z-AXIS = NA
 SCALE SOURCE, Z-AXIS = OFF
 SCALE G-COMP LP-FILTER, Z-AXIS = NA
 G-COMP LP-FILTER CUTOFF = 0.010 HZ
)";

// Figure 9-21, in its order, with which Service Mode begins (section 8.7).
TEST(Stim300Service, BeginsWithTheDescriptionOfTheUnit) {
  InService unit("start_up=false,gyro_unit=rate,temperature=false,bit_rate=1843200,sample_rate=2000");
  const std::string wanted = std::string(R"(SERIAL NUMBER = N25582405002002
PRODUCT = STIM300
PART NUMBER = 84167-4400003-321 REV K
FW CONFIG = SWD12404 REV 0
GYRO OUTPUT UNIT = [deg/s] - ANGULAR RATE
ACCELEROMETER OUTPUT UNIT = [g] - ACCELERATION
INCLINOMETER OUTPUT UNIT = [g] - ACCELERATION
PPS OUTPUT UNIT = [us] - TIME SINCE DETECTION OF 1
SAMPLE RATE [samples/s] = 2000
GYRO CONFIG = XYZ
ACCELEROMETER CONFIG = XYZ
INCLINOMETER CONFIG = XYZ
GYRO RANGE:
 X-AXIS: +- 400deg/s
 Y-AXIS: +- 400deg/s
 Z-AXIS: +- 400deg/s
ACCELEROMETER RANGE:
 X-AXIS: +- 10g
 Y-AXIS: +- 10g
 Z-AXIS: +- 10g
INCLINOMETER RANGE:
 X-AXIS: +- 1.7g
 Y-AXIS: +- 1.7g
 Z-AXIS: +- 1.7g
GYRO LP FILTER -3dB FREQUENCY, X-AXIS [Hz] = 262
GYRO LP FILTER -3dB FREQUENCY, Y-AXIS [Hz] = 262
GYRO LP FILTER -3dB FREQUENCY, Z-AXIS [Hz] = 262
ACCELEROMETER LP FILTER -3dB FREQUENCY, X-AXIS [Hz] = 262
ACCELEROMETER LP FILTER -3dB FREQUENCY, Y-AXIS [Hz] = 262
ACCELEROMETER LP FILTER -3dB FREQUENCY, Z-AXIS [Hz] = 262
INCLINOMETER LP FILTER -3dB FREQUENCY, X-AXIS [Hz] = 262
INCLINOMETER LP FILTER -3dB FREQUENCY, Y-AXIS [Hz] = 262
INCLINOMETER LP FILTER -3dB FREQUENCY, Z-AXIS [Hz] = 262
PPS LP FILTER -3dB FREQUENCY [Hz] = 262
)") + g_compensation_off +
                             R"(BIAS TRIM OFFSET:
 GYRO X-AXIS [deg/s] = 0.00000
 GYRO Y-AXIS [deg/s] = 0.00000
 GYRO Z-AXIS [deg/s] = 0.00000
 ACCELEROMETER X-AXIS [g] = 0.000000
 ACCELEROMETER Y-AXIS [g] = 0.000000
 ACCELEROMETER Z-AXIS [g] = 0.000000
 INCLINOMETER X-AXIS [g] = 0.0000000
 INCLINOMETER Y-AXIS [g] = 0.0000000
 INCLINOMETER Z-AXIS [g] = 0.0000000
 REFERENCE INFO = 0
DATAGRAM = RATE, ACCELERATION, INCLINATION
DATAGRAM TERMINATION = NONE
BIT-RATE [bits/s] = 1843200
DATA LENGTH = 8
STOP BITS = 1
PARITY = NONE
LINE TERMINATION = ON
SYSTEM CONFIGURATIONS:
 VOLTAGE-LEVEL OF DIGITAL OUTPUT SIGNALS: 5V
 TOV ACTIVE FOR SPECIAL DATAGRAMS AFTER POWER-ON/RESET: OFF
 BTO-DATAGRAM TRANSMISSION AFTER POWER-ON/RESET: OFF
)";
  EXPECT_EQ(unit.entry, wanted + ">");
  EXPECT_EQ(unit.type("i"), wanted);
  // It contains all of its parts.
  std::string parts;
  for (const char part : std::string("snxpumafgbdtrh")) {
    parts = unit.type(std::string("i ") + part);
    EXPECT_GT(parts.size(), 10U);
    EXPECT_NE(wanted.find(parts), std::string::npos) << part << '\n' << parts;
  }
}

// Figures 9-3 to 9-7.
TEST(Stim300Service, TrimsBiases) {
  InService unit;
  EXPECT_EQ(unit.type("b 0,a"),
            "BIAS TRIM OFFSET:\n ACCELEROMETER X-AXIS [g] = 0.000000\n ACCELEROMETER Y-AXIS [g] = 0.000000\n"
            " ACCELEROMETER Z-AXIS [g] = 0.000000\n");
  EXPECT_EQ(unit.type("b 0.02343,g"),
            "BIAS TRIM OFFSET:\n GYRO X-AXIS [deg/s] = 0.02343\n GYRO Y-AXIS [deg/s] = 0.02343\n"
            " GYRO Z-AXIS [deg/s] = 0.02343\n");
  EXPECT_EQ(unit.type("b 0.001,g,x"), "BIAS TRIM OFFSET:\n GYRO X-AXIS [deg/s] = 0.02443\n")
      << "with an axis it is added";
  EXPECT_EQ(unit.type("b 0.5,g"),
            "BIAS TRIM OFFSET:\n GYRO X-AXIS [deg/s] = 0.50000\n GYRO Y-AXIS [deg/s] = 0.50000\n"
            " GYRO Z-AXIS [deg/s] = 0.50000\n")
      << "without one it is set";
  EXPECT_TRUE(unit.type("b 0.01").ends_with(" INCLINOMETER Z-AXIS [g] = 0.0100000\n")) << "without a sensor, too";
  EXPECT_TRUE(unit.type("b 0.02443,g,x").ends_with(" = 0.03443\n"));
  EXPECT_EQ(unit.type("b 2.3,i"),
            "BIAS TRIM OFFSET:\n INCLINOMETER X-AXIS [g] = 0.0200000\n INCLINOMETER Y-AXIS [g] = 0.0200000\n"
            " INCLINOMETER Z-AXIS [g] = 0.0200000\nE008 BIAS TRIM OFFSET(S) SET TO MIN OR MAX\n");
  EXPECT_EQ(unit.type("b 43639,r"), "BIAS TRIM OFFSET:\n REFERENCE INFO = 43639\n");
  EXPECT_EQ(unit.type("b 0.5,g,x,1"), "E002 INCORRECT NUMBER OF PARAMETERS\n");
  EXPECT_EQ(unit.type("b inf"), "E003 INVALID PARAMETER\n");
  EXPECT_EQ(unit.type("b 0.1,p"), "E003 INVALID PARAMETER\n");
  unit.send_line("x N");
  unit.sample.rate = {0, 0, 0};
  const Recording recording = unit.decode(unit.run(2));
  EXPECT_NEAR(recording.measurements.at(0).sample.rate.x(), 0.03443 * units::degree, 0x1p-15 * units::degree);
}

// Figures 9-9 to 9-13, 9-18 to 9-20, 9-38 to 9-41, 9-45, 9-47 and 9-48.
TEST(Stim300Service, AnswersAsTheDatasheetShows) {
  InService unit("start_up=false,bit_rate=1843200");
  EXPECT_EQ(unit.type("d 0,0"), "DATAGRAM = RATE\nDATAGRAM TERMINATION = NONE\n");
  EXPECT_EQ(unit.type("d 3,1"), "DATAGRAM = RATE, ACCELERATION, INCLINATION\nDATAGRAM TERMINATION = <CR><LF>\n");
  EXPECT_EQ(unit.type("d t,0"),
            "DATAGRAM = RATE, ACCELERATION, INCLINATION, TEMPERATURE, PPS\nDATAGRAM TERMINATION = NONE\n");
  EXPECT_EQ(unit.type("f 2,a,x"), "ACCELEROMETER LP FILTER -3dB FREQUENCY, X-AXIS [Hz] = 66\n");
  EXPECT_EQ(unit.type("f 1,g"),
            "GYRO LP FILTER -3dB FREQUENCY, X-AXIS [Hz] = 33\n"
            "GYRO LP FILTER -3dB FREQUENCY, Y-AXIS [Hz] = 33\n"
            "GYRO LP FILTER -3dB FREQUENCY, Z-AXIS [Hz] = 33\n");
  const std::string all = unit.type("f 3");
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 10);
  EXPECT_TRUE(all.ends_with("\nPPS LP FILTER -3dB FREQUENCY [Hz] = 131\n")) << all;
  EXPECT_EQ(unit.type("h v,5"), "VOLTAGE-LEVEL OF DIGITAL OUTPUT SIGNALS: 5V\n");
  EXPECT_EQ(unit.type("h v,3"), "VOLTAGE-LEVEL OF DIGITAL OUTPUT SIGNALS: 3.3V\n");
  EXPECT_EQ(unit.type("h t,0"), "TOV ACTIVE FOR SPECIAL DATAGRAMS AFTER POWER-ON/RESET: OFF\n");
  EXPECT_EQ(unit.type("h b,1"), "BTO-DATAGRAM TRANSMISSION AFTER POWER-ON/RESET: ON\n");
  EXPECT_EQ(unit.type("m 2"), "SAMPLE RATE [samples/s] = 500\n");
  EXPECT_EQ(unit.type("m 5"), "SAMPLE RATE = EXTERNAL TRIGGER\n");
  EXPECT_EQ(unit.type("a"), "E001 UNKNOWN COMMAND\n") << "not with an external trigger (section 9.1)";
  EXPECT_EQ(unit.type("r 0"), "LINE TERMINATION = OFF\n");
  EXPECT_EQ(unit.type("r 1"), "LINE TERMINATION = ON\n");
  EXPECT_EQ(unit.type("t 2,1,2"), "BIT-RATE [bits/s] = 921600\nDATA LENGTH = 8\nSTOP BITS = 1\nPARITY = EVEN\n");
  EXPECT_EQ(unit.device->uart(), (UartSettings{921600, Parity::even, 1}));
  EXPECT_EQ(unit.type("t f,500000"), "BIT-RATE [bits/s] = 499663\nDATA LENGTH = 8\nSTOP BITS = 1\nPARITY = EVEN\n")
      << "82944000/166 (Equation 13)";
  EXPECT_EQ(unit.type("t f,500000,2,1"),
            "BIT-RATE [bits/s] = 499663\nDATA LENGTH = 8\nSTOP BITS = 2\nPARITY = ODD\n");
  EXPECT_EQ(unit.device->uart(), (UartSettings{499663, Parity::odd, 2}));
  EXPECT_EQ(unit.type("u g,0"), "GYRO OUTPUT UNIT = [deg/s] - ANGULAR RATE\n");
  EXPECT_EQ(unit.type("u g,8"), "GYRO OUTPUT UNIT = [deg/s] - ANGULAR RATE DELAYED\n");
  EXPECT_EQ(unit.type("u a,2"), "ACCELEROMETER OUTPUT UNIT = [g] - AVERAGE ACCELERATION\n");
  EXPECT_EQ(unit.type("u p,2"), "PPS OUTPUT UNIT = [us] - TIME SINCE DETECTION OF 0\n");
  EXPECT_EQ(unit.type("?").substr(0, 64), "AVAILABLE PARAMETERS:\na: PERFORMS A SINGLE-SHOT MEASUREMENT\nb: C");
  for (const char command : std::string("abcdfghimrstuxz"))
    EXPECT_EQ(unit.type(std::string("? ") + command)[0], command);
}

// Figures 9-14 to 9-17.
TEST(Stim300Service, ConfiguresTheGCompensation) {
  InService unit;
  const std::string off = g_compensation_off;
  const auto with = [&](const std::string& text, std::string from, const std::string& to) {
    std::string changed = text;
    for (std::size_t at = 0; (at = changed.find(from, at)) != std::string::npos; at += to.size())
      changed.replace(at, from.size(), to);
    return changed;
  };
  const auto axes = [&](std::string bias, std::string bias_filter, std::string scale, std::string scale_filter,
                        std::string hz) {
    std::string text = off;
    for (const std::string axis : {"X", "Y", "Z"}) {
      text = with(text, " BIAS SOURCE, " + axis + "-AXIS = OFF", " BIAS SOURCE, " + axis + "-AXIS = " + bias);
      text = with(text, "BIAS G-COMP LP-FILTER, " + axis + "-AXIS = NA",
                  "BIAS G-COMP LP-FILTER, " + axis + "-AXIS = " + bias_filter);
      text = with(text, " SCALE SOURCE, " + axis + "-AXIS = OFF", " SCALE SOURCE, " + axis + "-AXIS = " + scale);
      text = with(text, "SCALE G-COMP LP-FILTER, " + axis + "-AXIS = NA",
                  "SCALE G-COMP LP-FILTER, " + axis + "-AXIS = " + scale_filter);
    }
    return with(text, "0.010", hz);
  };
  EXPECT_EQ(unit.type("g 0"), off);
  const std::string warning = "GYRO G-COMPENSATION: WARNING: DELAYED GYRO OUTPUT UNIT IS RECOMMENDED\n";
  EXPECT_EQ(unit.type("g 8,0.3"), with(axes("ACC", "ON", "ACC", "OFF", "0.300"), "GYRO G-COMPENSATION:\n", warning));
  EXPECT_EQ(unit.type("i g"), axes("ACC", "ON", "ACC", "OFF", "0.300"));
  EXPECT_EQ(unit.type("g 4"), axes("ACC", "ON", "OFF", "NA", "0.010"))
      << "no warning where all is filtered (Table 9-22)";
  unit.type("u g,8");
  EXPECT_EQ(unit.type("g 1"), axes("OFF", "NA", "ACC", "OFF", "0.010"));
  EXPECT_EQ(unit.type("g 2,1,1,0,0.5"), axes("INC", "ON", "ACC", "OFF", "0.500"));
  const std::string z = unit.type("g 0,0,1,2,1,1,0");
  EXPECT_NE(z.find("SOURCE, Y-AXIS = OFF"), std::string::npos);
  EXPECT_NE(z.find(" BIAS SOURCE, Z-AXIS = INC\n BIAS G-COMP LP-FILTER, Z-AXIS = ON\n SCALE SOURCE, Z-AXIS = ACC\n"
                   " SCALE G-COMP LP-FILTER, Z-AXIS = OFF\n G-COMP LP-FILTER CUTOFF = 0.500 HZ\n"),
            std::string::npos)
      << z;
  EXPECT_EQ(unit.type("g 1,2,3"), "E002 INCORRECT NUMBER OF PARAMETERS\n");
  EXPECT_EQ(unit.type("g d"), "E003 INVALID PARAMETER\n");
  EXPECT_EQ(unit.type("g 1,5.1"), "E003 INVALID PARAMETER\n");
}

// Figures 9-1 and 9-2.
TEST(Stim300Service, MeasuresOnce) {
  InService unit("start_up=false,accelerometer_unit=increment");
  unit.sample.rate = Vector3(1.43253, 2.34525, 243.33628) * units::degree;
  unit.sample.specific_force = Vector3(0.042113, 0.000342, 0.929376) * units::standard_gravity;
  unit.sample.temperature_c = 32.326;
  unit.sample.status = status::gyro_saturated_x << 2;
  EXPECT_TRUE(unit.run(11).empty());
  const std::string text = unit.type("a");
  EXPECT_TRUE(
      text.starts_with("GYRO X-AXIS = 1.43253 deg/s\nGYRO Y-AXIS = 2.34525 deg/s\nGYRO Z-AXIS = 243.33628 deg/s\n"
                       "GYRO STATUS = 00010100 = NOT OK\n BIT 4: OVERLOAD\n BIT 2: ERROR IN Z-CHANNEL\n"
                       "ACCELEROMETER X-AXIS = 0.042113 g\nACCELEROMETER Y-AXIS = 0.000342 g\n"
                       "ACCELEROMETER Z-AXIS = 0.929376 g\nACCELEROMETER STATUS = 00000000 = OK\n"
                       "INCLINOMETER X-AXIS = 0.0421130 g\n"))
      << text;
  EXPECT_NE(text.find("TEMPERATURE ACC Y-AXIS = 32.326 degC\n"), std::string::npos);
  EXPECT_NE(text.find("\nCOUNTER = 10\nLATENCY = 506 us\n"), std::string::npos);
  EXPECT_EQ(unit.type("a "), text) << "a blank is no parameter";
  EXPECT_EQ(unit.type("a 1"), "E002 INCORRECT NUMBER OF PARAMETERS\n");
}

// Figures 9-8, 9-25 and 9-26.
TEST(Stim300Service, Diagnoses) {
  InService unit;
  EXPECT_EQ(unit.type("i e"), "NO ERRORS DETECTED\n");
  const std::string good = unit.type("c");
  EXPECT_EQ(good.find("FAIL"), std::string::npos);
  EXPECT_EQ(std::count(good.begin(), good.end(), '\n'), 5 + 11 + 9 + 36 + 24 + 1 + 12) << "results and headings";
  unit.sample.status = status::gyro_saturated_x << 2 | status::accelerometer_saturated_x;
  unit.run(1);
  EXPECT_NE(unit.type("c").find("\nGYRO Z-AXIS:\n GYRO Z-AXIS DATA RECEIVED = OK\n"), std::string::npos);
  EXPECT_NE(unit.type("c").find(" GYRO Z-AXIS NO OVERLOAD DETECTED = FAIL\n"), std::string::npos);
  unit.sample.status = 0;
  EXPECT_EQ(unit.type("i e"),
            "GYRO Z-AXIS NO OVERLOAD DETECTED = FAIL\nACCELEROMETER X-AXIS NO OVERLOAD DETECTED = FAIL\n"
            "LAST ERROR HISTORY IS NOW CLEARED\n");
  EXPECT_EQ(unit.type("i e"), "NO ERRORS DETECTED\n");
}

TEST(Stim300Service, RefusesAsInTheTablesOfErrors) {
  InService unit;
  for (const char* line : {"n", "A", "$isn,28", "UTILITYMODE", "i q", "i ab"})
    EXPECT_EQ(unit.type(line), "E001 UNKNOWN COMMAND\n") << line;
  for (const char* line :
       {"b", "b,0", "c 1", "d 1", "d 1,0,0", "f",   "g", "h v",   "i a,b", "m",         "m,1",
        "r", "s 1", "t",   "t f", "t 1,1",   "u g", "x", "z s,s", "? a,b", "f 1,g,x,y", "g 1,1,1,1,1,1,1,1,1"})
    EXPECT_EQ(unit.type(line), "E002 INCORRECT NUMBER OF PARAMETERS\n") << line;
  for (const char* line :
       {"d u,0", "d 1,2",    "d L,0",       "f 5",     "f 4,q", "f 4,p,x", "h q,1", "h v,1", "m 6", "m 55", "r 2",
        "t 4",   "t f,1499", "t f,5184001", "t 1,3,0", "u g,4", "u p,4",   "x q",   "z q",   "? q", "m -1"})
    EXPECT_EQ(unit.type(line), "E003 INVALID PARAMETER\n") << line;
  // Table 5-12: 374400 bit/s carry 63 characters 500 times per second.
  EXPECT_EQ(unit.type("t 0"), "E007 DATAGRAM WILL BE TOO LONG TO TRANSMIT\n");
  EXPECT_EQ(unit.device->uart().baud, 921600U);
  EXPECT_EQ(unit.type("m 2"), "SAMPLE RATE [samples/s] = 500\n");
  EXPECT_EQ(unit.type("t 0").substr(0, 27), "BIT-RATE [bits/s] = 374400\n");
  EXPECT_EQ(unit.type("m 3"), "SAMPLE RATE [samples/s] = 1000\nE007 DATAGRAM WILL BE TOO LONG TO TRANSMIT\n");
  EXPECT_EQ(unit.type("i m"), "SAMPLE RATE [samples/s] = 1000\n") << "set nevertheless (section 9.9)";
  EXPECT_EQ(unit.type("d p,0"), "E007 DATAGRAM WILL BE TOO LONG TO TRANSMIT\n");
  EXPECT_EQ(unit.type("d 1,0").substr(0, 31), "DATAGRAM = RATE, ACCELERATION\nD");
}

// Table 9-2.
TEST(Stim300Service, EchoesAndTakesBack) {
  InService unit;
  FrameBuffer replies;
  const auto send = [&](std::string_view typed) {
    replies.clear();
    unit.device->receive({std::as_bytes(std::span(typed))}, unit.now(), replies);
    std::string text;
    for (const Frame& frame : replies.frames())
      for (const std::byte byte : frame.bytes) text += static_cast<char>(byte);
    return text;
  };
  EXPECT_EQ(send("m"), "m");
  EXPECT_EQ(send(" 7"), " 7");
  unit.run(20'000);  // ten seconds between two characters
  EXPECT_EQ(send("\b"), "\b");
  EXPECT_EQ(send("2\r"), "2\rSAMPLE RATE [samples/s] = 500\r>");
  EXPECT_EQ(send("\b\b\r\n"), "\r>") << "nothing to take back";
  EXPECT_EQ(send("i n\ri m\r"), "i n\rPRODUCT = STIM300\r>i m\rSAMPLE RATE [samples/s] = 500\r>");
  EXPECT_EQ(send(std::string(200, 'i')), std::string(80, 'i')) << "the input buffer has 80 characters";
  EXPECT_EQ(send("\r"), "\r>") << "a longer line is forgotten";
  EXPECT_EQ(send("m " + std::string(77, ' ') + "1\r").substr(80), "\rSAMPLE RATE [samples/s] = 250\r>");
  EXPECT_EQ(send("m " + std::string(77, ' ') + "25\r").substr(80), "\r>");
  send("m ");
  unit.run(119'999);
  EXPECT_EQ(send("3"), "3");
  unit.run(120'000);
  EXPECT_EQ(send("\r"), "\r>") << "a minute after the last character it is forgotten";
  EXPECT_EQ(send("i m\r"), "i m\rSAMPLE RATE [samples/s] = 250\r>");
}

// Figures 9-42 to 9-44.
TEST(Stim300Service, SavesWhatIsConfirmed) {
  InService unit;
  const std::string question = "s\nSYSTEM PARAMETERS WILL BE PERMANENTLY CHANGED. CONFIRM SAVE(Y/N): ";
  EXPECT_EQ(legible(unit.send_line("s")), question);
  EXPECT_EQ(unit.type("N"), "SAVE COMMAND ABORTED.\n");
  EXPECT_EQ(legible(unit.send_line("s")), question);
  EXPECT_EQ(unit.type("y"), "SAVE COMMAND ABORTED.\nE003 INVALID PARAMETER\n");
  unit.type("t 3,2,1");
  unit.type("m 1");
  EXPECT_EQ(unit.device->uart(), (UartSettings{1843200, Parity::odd, 2}));
  unit.send_line("s");
  unit.type("N");
  EXPECT_EQ(unit.device->uart(), (UartSettings{921600, Parity::none, 1}))
      << "the line's settings go back (Table 9-43)";
  EXPECT_EQ(unit.type("i m"), "SAMPLE RATE [samples/s] = 250\n");
  unit.send_line("s");
  EXPECT_EQ(unit.type("Y"), "SYSTEM PARAMETERS SUCCESSFULLY STORED IN FLASH.\nNUMBER OF SAVES = 1\n");
  unit.send_line("x I");
  unit.run(2000);
  EXPECT_EQ(unit.run(16).size(), 2U) << "250 a second, also after a reset";
}

// Figures 9-49 to 9-53 and Table 9-54.
TEST(Stim300Service, LeavesForNormalOrInitMode) {
  InService unit;
  unit.run(2);
  const unsigned before = std::to_integer<unsigned>([&] {
    unit.send_line("x N");
    return unit.run(2).at(0);
  }()[52]);
  EXPECT_EQ(unit.send_line("i"), "") << "in Normal Mode";
  unit.send_line("SERVICEMODE");
  EXPECT_TRUE(unit.run(100).empty()) << "no datagrams meanwhile";
  EXPECT_EQ(legible(unit.send_line("x n")), "x n\nSYSTEM RETURNING TO NORMAL MODE\n");
  EXPECT_EQ(unit.send_line("i"), "");
  EXPECT_TRUE(unit.run(5998).empty()) << "a hold time of 3 s";
  const auto datagrams = unit.run(4);
  ASSERT_FALSE(datagrams.empty());
  EXPECT_EQ(datagrams[0][10], std::byte{0}) << "without a start-up (section 7.5.2.1)";
  // The counter has continued: 100 samples, 6000, and two up to the next datagram.
  EXPECT_EQ((std::to_integer<unsigned>(datagrams[0][52]) - before) % 256, 6102 % 256);

  const std::string question = "CURRENT SYSTEM PARAMETERS DO NOT MATCH FLASH CONTENT. CONFIRM EXIT(Y/N): ";
  unit.send_line("SERVICEMODE");
  unit.type("m 4");
  EXPECT_EQ(legible(unit.send_line("x i")), "x i\n" + question);
  EXPECT_EQ(unit.type("N"), "");
  EXPECT_EQ(legible(unit.send_line("x n")), "x n\n" + question);
  EXPECT_EQ(unit.type("n"), "E003 INVALID PARAMETER\n");
  EXPECT_EQ(legible(unit.send_line("x i")), "x i\n" + question);
  EXPECT_EQ(legible(unit.send_line("Y")), "Y\nSYSTEM RETURNING TO INIT MODE\n");
  EXPECT_TRUE(unit.run(6199).empty());
  EXPECT_EQ(first(unit.run(10).at(0)), 0xB1U) << "from the part number on";
  unit.run(1400);
  EXPECT_EQ(unit.run(20).size(), 10U) << "what was not saved is gone";
}

// Figures 9-54 to 9-56.
TEST(Stim300Service, GoesBackToTheFactorySettings) {
  InService unit("start_up=false,parity=even,sample_rate=250");
  const std::string confirm = "RESTORE TO FACTORY SETTINGS.\nCONFIRM CHANGE TO FACTORY SETTINGS";
  unit.type("m 3");
  EXPECT_EQ(legible(unit.send_line("z")), "z\n" + confirm + "(Y/N): ");
  EXPECT_EQ(unit.type("Y"),
            "APPLYING FACTORY SETTINGS\nFACTORY SETTINGS APPLIED. TO PERMANENTLY STORE THE SETTINGS, USE THE SAVE "
            "OR 'z s' COMMAND.\n");
  EXPECT_EQ(unit.type("i m"), "SAMPLE RATE [samples/s] = 250\n");
  unit.type("m 2");
  unit.type("t 3,1,0");
  EXPECT_EQ(legible(unit.send_line("z s")), "z s\n" + confirm + " AND SAVING(Y/N): ");
  EXPECT_EQ(legible(unit.send_line("Y")),
            "Y\nTHE TRANSMISSION CONFIGURATION WILL BE CHANGED TO:\nBIT-RATE [bits/s] = 921600\n"
            "DATA LENGTH = 8\nSTOP BITS = 1\nPARITY = EVEN\nPLEASE CONFIRM (Y/N): ");
  EXPECT_EQ(unit.type("N"), "");
  EXPECT_EQ(unit.type("i m"), "SAMPLE RATE [samples/s] = 500\n");
  unit.send_line("z s");
  unit.send_line("Y");
  EXPECT_EQ(unit.type("Y"), "APPLYING FACTORY SETTINGS\nFACTORY SETTINGS APPLIED AND SAVED.\nNUMBER OF SAVES = 1\n");
  EXPECT_EQ(unit.device->uart(), (UartSettings{921600, Parity::even, 1}));
  EXPECT_EQ(unit.type("i m"), "SAMPLE RATE [samples/s] = 250\n");
}

}  // namespace
}  // namespace imud
