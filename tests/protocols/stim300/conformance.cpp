// The configurations in which the STIM300 is tested, and the inputs from which its fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <string>
#include <string_view>

#include "core/sample.hpp"
#include "core/units.hpp"
#include "protocols/stim300/stim300.hpp"

namespace imud::stim300 {
namespace {

constexpr void set_accelerometer_lsb(Protocol& entry, double lsb_g) {
  entry.resolution.specific_force = lsb_g * units::standard_gravity;
  entry.range.specific_force = (0x1p23 - 1) * lsb_g * units::standard_gravity;
}

// The CRC does not cover CR LF. Increments beyond 24 bits set overload bits (Table 5-2, note 9) that are not in the
// sample's status.
constexpr ConformanceSettings conformance_settings[] = {
    {"sample_rate=2000 bit_rate=1843200 start_up=false"},
    {"sample_rate=2000 bit_rate=1843200 start_up=false cr_lf=true pps=true accelerometer_range_g=5",
     [](Protocol& entry) {
       set_accelerometer_lsb(entry, 0x1p-20);
       entry.has_checksum = false;
       entry.burst_bits = 0;
     }},
    {"sample_rate=2000 bit_rate=1843200 start_up=false aux_input=true pps=true accelerometer_range_g=80",
     [](Protocol& entry) { set_accelerometer_lsb(entry, 0x1p-16); }},
    {"sample_rate=2000 bit_rate=921600 start_up=false acceleration=false temperature=false",
     [](Protocol& entry) {
       entry.fields = Measurement::counter | Measurement::rate | Measurement::status;
       entry.status_bits = 7U | status::not_valid;
     }},
    {"sample_rate=2000 bit_rate=1843200 start_up=false gyro_unit=increment accelerometer_unit=increment "
     "accelerometer_range_g=30",
     [](Protocol& entry) {
       entry.fields = Measurement::counter | Measurement::delta_angle | Measurement::delta_velocity |
                      Measurement::temperature | Measurement::status;
       entry.resolution.delta_angle = 0x1p-21 * units::degree;
       entry.resolution.delta_velocity = 0x1p-21;
       entry.range.delta_angle = (0x1p23 - 1) * 0x1p-21 * units::degree;
       entry.range.delta_velocity = (0x1p23 - 1) * 0x1p-21;
       entry.status_bits = status::not_valid;
     }},
};

constexpr std::string_view host_bodies[] = {"N",
                                            "I",
                                            "C",
                                            "T",
                                            "E",
                                            "R",
                                            "SERVICEMODE",
                                            "UTILITYMODE",
                                            "$sm,4,",
                                            "$sgu,b,",
                                            "$sau,1,",
                                            "$sd,t,",
                                            "$ie,",
                                            "$st,921600,2,n,1,0,0,",
                                            "$saf,z,4,",
                                            "$sconf,v,5,",
                                            "$ibto,",
                                            "$sbto,3.4e-03,g,y,",
                                            "$save,",
                                            "$sfs,1,",
                                            "$xn,",
                                            "$sdbto,1e308,-1,0,0.1,0.1,0.1,1,1,1,",
                                            "$srf,4294967295,",
                                            "$irng,",
                                            "$ix,",
                                            "$ig,x,",
                                            "$sg,y,1,1,2,0,0.5,",
                                            "$st,1500,1,o,1,1,0,",
                                            "SERVICEMODE\ri",
                                            "SERVICEMODE\rc",
                                            "a",
                                            "b 0.001,g,x",
                                            "b 7,r",
                                            "d t,1",
                                            "f 2,a,x",
                                            "g 8,0.3",
                                            "g 0,0,1,2,1,1,0",
                                            "h v,3",
                                            "i e",
                                            "i g",
                                            "m 5",
                                            "r 0",
                                            "s",
                                            "Y",
                                            "N",
                                            "t f,500000,2,1",
                                            "t 3,1,0",
                                            "u g,8",
                                            "x n",
                                            "x I",
                                            "z s",
                                            "? g",
                                            "\b\b\b"};
constexpr std::string_view revive[] = {"$xn,", "N", "x N"};

std::string framed(std::string_view body) {
  std::string text(body);
  if (text.starts_with('$')) text += std::to_string(crc8(text));
  return text + '\r';
}
const Conformance conformance("stim300", {.settings = conformance_settings,
                                          .host = {.frame = framed,
                                                   .bodies = host_bodies,
                                                   .revive = revive,
                                                   .last = "UTILITYMODE",
                                                   .answer = "#UTILITYMODE,234"}});

}  // namespace
}  // namespace imud::stim300
