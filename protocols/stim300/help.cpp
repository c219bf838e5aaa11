// The help texts of Service Mode (figures 9-57 to 9-72).
#include <array>
#include <utility>

#include "protocols/stim300/service.hpp"

namespace imud::stim300 {
namespace {

constexpr std::array<std::pair<char, std::string_view>, 16> texts = {{
    {'?',
     "AVAILABLE PARAMETERS:\r"
     "a: PERFORMS A SINGLE-SHOT MEASUREMENT\r"
     "b: CHANGES BIAS TRIM OFFSETS\r"
     "c: PERFORMS A DIAGNOSTIC OF THE UNIT\r"
     "d: CHANGES DATAGRAM FORMAT\r"
     "f: CHANGES LP FILTER -3DB FREQUENCY\r"
     "g: CHANGES CONFIGURATION OF GYRO G-COMPENSATION\r"
     "h: CHANGES SYSTEM CONFIGURATIONS\r"
     "i: LISTS SPECIFIC INFORMATION\r"
     "m: CHANGES SAMPLE RATE\r"
     "r: CHANGES THE LINE TERMINATION\r"
     "s: SAVES CONFIGURATION DATA\r"
     "t: CHANGES TRANSMISSION PARAMETERS\r"
     "u: CHANGES OUTPUT UNIT\r"
     "x: EXITS SERVICE MODE\r"
     "z: RESTORES FACTORY SETTINGS\r"},
    {'a', "a: PERFORMS A SINGLE-SHOT MEASUREMENT\r"},
    {'b',
     "b <BiasTrimOffset>: CHANGES BIAS TRIM OFFSET FOR ALL SENSORS AND ALL AXES TO <BiasTrimOffset>\r"
     "b <BiasTrimOffset>,<Sensor>: CHANGES BIAS TRIM OFFSET FOR ALL AXES OF SPECIFIED SENSOR TO <BiasTrimOffset>\r"
     "b <DeltaBiasTrimOffset>,<Sensor>,<Axis>: ADJUSTS BIAS TRIM OFFSET FOR SPECIFIED SENSOR AND AXIS BY "
     "<DeltaBiasTrimOffset>\r"
     "b <RefInfo>,r: DEFINES REFERENCE INFO FOR BIAS TRIM OFFSET. <RefInfo> IS A 32-BIT UNSIGNED INTEGER\r"
     "  ALLOWED VALUES FOR <Sensor>:\r   g = GYRO(S)\r   a = ACCELEROMETER(S)\r   i = INCLINOMETER(S)\r"
     "  ALLOWED VALUES FOR <Axis>:\r   x = X-AXIS\r   y = Y-AXIS\r   z = Z-AXIS\r"},
    {'c', "c: PERFORMS A DIAGNOSTIC OF THE UNIT\r"},
    {'d',
     "d <type>,<term>: CHANGES THE DATAGRAM FORMAT\r"
     "  ALLOWED VALUES FOR <type>:\r"
     "   0 = ID, RATE, COUNTER, LATENCY, CRC\r"
     "   1 = ID, RATE, ACCELERATION, COUNTER, LATENCY, CRC\r"
     "   2 = ID, RATE, INCLINATION, COUNTER, LATENCY, CRC\r"
     "   3 = ID, RATE, ACCELERATION, INCLINATION, COUNTER, LATENCY, CRC\r"
     "   4 TO 7 = 0 TO 3 AND TEMPERATURE\r"
     "   l, m, n, p = 0 TO 3 AND PPS\r"
     "   q, r, s, t = 0 TO 3, TEMPERATURE AND PPS\r"
     "  ALLOWED VALUES FOR <term>:\r   0 = NONE\r   1 = <CR><LF>\r"},
    {'f',
     "f <-3dBfreq>: CHANGES THE LP FILTER -3DB FREQUENCY [Hz] FOR ALL SENSORS AND AXES\r"
     "f <-3dBfreq>,<sens>: CHANGES THE LP FILTER -3DB FREQUENCY [Hz] FOR ALL AXES OF SPECIFIED SENSOR\r"
     "f <-3dBfreq>,<sens>,<axis>: CHANGES THE LP FILTER -3DB FREQUENCY [Hz] FOR A SPECIFIC SENSOR AND AXIS\r"
     "  ALLOWED VALUES FOR <-3dBfreq>:\r   0 = 16\r   1 = 33\r   2 = 66\r   3 = 131\r   4 = 262\r"
     "  ALLOWED VALUES FOR <sens>:\r   g = GYRO(S)\r   a = ACCELEROMETER(S)\r   i = INCLINOMETER(S)\r   p = PPS\r"
     "  ALLOWED VALUES FOR <axis>:\r   x = X-AXIS\r   y = Y-AXIS\r   z = Z-AXIS\r"},
    {'g',
     "g <StdComp>[,<FilterCutoff>]: CHANGES GYRO G-COMP TO A PRE-DEFINED CONFIGURATION\r"
     "g <BiasSource>,<BiasFilter>,<ScaleSource>,<ScaleFilter>[,<FilterCutoff>]: CHANGES CONFIGURATION OF GYRO "
     "G-COMP\r"
     "g <Xonoff>,<Yonoff>,<Zonoff>,<BiasSource>,<BiasFilter>,<ScaleSource>,<ScaleFilter>[,<FilterCutoff>]: "
     "CHANGES CONFIGURATION OF GYRO G-COMP ON SPECIFIED AXES\r"
     "  ALLOWED VALUES FOR <StdComp>:\r   0 TO 9, a TO c (0: NO GYRO G-COMP)\r"
     "  ALLOWED RANGE FOR <FilterCutoff> [Hz]:\r   0.001 TO 5.000\r"
     "  ALLOWED VALUES FOR <BiasSource> AND <ScaleSource>:\r   0 = OFF\r   1 = ACCELEROMETER\r   2 = INCLINOMETER\r"
     "  ALLOWED VALUES FOR <BiasFilter>, <ScaleFilter>, <Xonoff>, <Yonoff> AND <Zonoff>:\r   0 = OFF\r   1 = ON\r"},
    {'h',
     "h <systemconfig>,<setting>: CHANGES DEFINED SYSTEM CONFIGURATIONS\r"
     "  ALLOWED VALUES FOR <systemconfig>:\r"
     "   v = VOLTAGE-LEVEL OF DIGITAL OUTPUT SIGNALS\r"
     "   t = ACTIVE TOGGLING OF TOV FOR SPECIAL DATAGRAMS AFTER POWER-ON/RESET\r"
     "   b = TRANSMISSION OF BIAS TRIM OFFSET DATAGRAM AFTER POWER-ON/RESET\r"
     "  ALLOWED VALUES FOR <setting> WHEN <systemconfig> = v:\r   5 = 5V\r   3 = 3.3V\r"
     "  ALLOWED VALUES FOR <setting> WHEN <systemconfig> = t OR b:\r   0 = OFF\r   1 = ON\r"},
    {'i',
     "i: LISTS THE PRODUCT CONFIGURATION DATA\r"
     "i a: RETURNS THE AXIS CONFIGURATION\r"
     "i b: RETURNS THE BIAS TRIM OFFSETS\r"
     "i d: RETURNS THE DATAGRAM FORMAT\r"
     "i e: RETURNS THE EXTENDED ERROR INFORMATION FROM THE LAST DETECTED ERROR IN NORMAL MODE\r"
     "i f: RETURNS THE LP FILTER -3DB FREQUENCY\r"
     "i g: RETURNS THE CONFIGURATION OF GYRO G-COMPENSATION\r"
     "i h: RETURNS THE SYSTEM CONFIGURATIONS\r"
     "i m: RETURNS THE SAMPLE RATE\r"
     "i n: RETURNS THE PRODUCT NAME\r"
     "i p: RETURNS THE FW CONFIGURATION AND REVISION\r"
     "i r: RETURNS THE LINE TERMINATION SETTING\r"
     "i s: RETURNS THE SERIAL NUMBER\r"
     "i t: RETURNS THE TRANSMISSION PARAMETERS\r"
     "i u: RETURNS THE OUTPUT UNIT\r"
     "i x: RETURNS THE PART NUMBER\r"},
    {'m',
     "m <sampl.rate>: CHANGES THE SAMPLE RATE [samples/s]\r"
     "  ALLOWED VALUES FOR <sampl.rate>:\r"
     "   0 = 125\r   1 = 250\r   2 = 500\r   3 = 1000\r   4 = 2000\r   5 = EXTERNAL TRIGGER\r"},
    {'r',
     "r <on/off>: TURNS LINE TERMINATION ON OR OFF\r"
     "  ALLOWED VALUES FOR <on/off>:\r   0 = OFF\r   1 = ON\r"},
    {'s', "s: SAVES SYSTEM PARAMETERS TO FLASH\r"},
    {'t',
     "t <bit-rate code>[,<bit-rate>]: CHANGES THE BIT-RATE [bits/s]\r"
     "t <bit-rate code>[,<bit-rate>],<stop bits>,<parity>: CHANGES THE BIT-RATE [bits/s], NUMBER OF STOP-BITS AND "
     "PARITY\r"
     "  ALLOWED VALUES FOR <bit-rate code>:\r"
     "   0 = 374400\r   1 = 460800\r   2 = 921600\r   3 = 1843200\r   f = USER-DEFINED\r"
     "   <bit-rate> MUST ONLY BE INCLUDED WHEN <bit-rate code> = f\r"
     "  ALLOWED RANGE FOR <bit-rate>:\r   1500 - 5184000 (INTEGER VALUE)\r"
     "  ALLOWED VALUES FOR <stop bits>:\r   1 = 1\r   2 = 2\r"
     "  ALLOWED VALUES FOR <parity>:\r   0 = NONE\r   1 = ODD\r   2 = EVEN\r"},
    {'u',
     "u <sens>,<unit>: CHANGES OUTPUT UNIT\r"
     "  ALLOWED VALUES FOR <sens>:\r   g = GYRO\r   a = ACCELEROMETER\r   i = INCLINOMETER\r   p = PPS\r"
     "  ALLOWED VALUES FOR u g,<unit>:\r"
     "   0 = [\xB0/s] - ANGULAR RATE\r   1 = [\xB0] - INCREMENTAL ANGLE\r"
     "   2 = [\xB0/s] - AVERAGE ANGULAR RATE\r   3 = [\xB0] - INTEGRATED ANGLE\r"
     "   8, 9, a, b = 0 TO 3 - DELAYED\r"
     "  ALLOWED VALUES FOR u a,<unit> AND u i,<unit>:\r"
     "   0 = [g] - ACCELERATION\r   1 = [m/s] - INCREMENTAL VELOCITY\r   2 = [g] - AVERAGE ACCELERATION\r"
     "   3 = [gs] - INTEGRATED VELOCITY\r   4 = [m/s] - INTEGRATED VELOCITY\r"
     "  ALLOWED VALUES FOR u p,<unit>:\r"
     "   0 = [ ] - FILTERED PPS\r   1 = [ ] - FILTERED PPS - DELAYED\r"
     "   2 = [us] - TIME SINCE DETECTION OF 0\r   3 = [us] - TIME SINCE DETECTION OF 1\r"},
    {'x',
     "x n: EXITS SERVICE MODE AND RETURNS TO NORMAL MODE\r"
     "x i: EXITS SERVICE MODE AND RETURNS TO INIT MODE\r"
     "x N: EXITS SERVICE MODE AND RETURNS IMMEDIATELY TO NORMAL MODE\r"
     "x I: EXITS SERVICE MODE AND RETURNS IMMEDIATELY TO INIT MODE\r"
     "NB: NON-SAVED SYSTEM PARAMETERS WILL BE OVERWRITTEN BY STORED CONTENT IN FLASH WHEN EXITING TO INIT MODE\r"},
    {'z', "z: RESTORES FACTORY SETTINGS\r"},
}};

}  // namespace

std::string_view help(char command) noexcept {
  for (const auto& [known, text] : texts)
    if (known == command) return text;
  return {};
}

}  // namespace imud::stim300
