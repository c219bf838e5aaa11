// The configurations in which VectorNav devices are tested, and the inputs from which their fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <cstdio>
#include <string>
#include <string_view>

#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {
namespace {

constexpr ConformanceSettings conformance_settings[] = {
    {"async_type=0 binary_1=1,1,04,0ED0"},
    {"model=vn-200 async_type=0 binary_2=1,1,05,0920,0810"},
    {"model=vn-300 async_type=0 binary_3=1,1,04,0600",
     [](Protocol& entry) { entry.fields = Measurement::rate | Measurement::specific_force; }},
};

constexpr std::string_view host_bodies[] = {"VNRRG,01",
                                            "VNRRG,27",
                                            "VNWRG,05,921600",
                                            "VNWRG,06,14,1",
                                            "VNWRG,07,200",
                                            "VNWRG,75,3,16,01,0721",
                                            "VNWRG,76,1,1,7F,7FFF,03FF,1FFF,3FFF,1FFF,1FFF,3FFF",
                                            "VNWRG,77,1,2,04,0ED0",
                                            "VNASY,1",
                                            "VNASY,0",
                                            "VNWNV",
                                            "VNRFS",
                                            "VNRST",
                                            "VNTAR",
                                            "VNBOM,1",
                                            "VNWRG,35,1,1,1,1",
                                            "VNWRG,26,+1,0,0,0,1,0,0,0,1",
                                            "VNRRG,54",
                                            "VNWRG,0,a tag",
                                            "VNWRG,75,1,0,01,0029",
                                            "VNWRG,30,1,2,0,0,3,0,2",
                                            "VNWRG,84,9,0,0,0,9,0,0,0,9,1,1,1",
                                            "VNRRG,80",
                                            "VNRRG,05,2"};
constexpr std::string_view revive[] = {""};  // ends a line that was cut off

std::string framed(std::string_view body) {
  char end[8];
  std::snprintf(end, sizeof end, "*%02X\r\n", xor_of(body));
  return "$" + std::string(body) + end;
}
const Conformance conformance(
    "vectornav",
    {.settings = conformance_settings,
     .host = {.frame = framed, .bodies = host_bodies, .revive = revive, .last = "VNRRG,04", .answer = "2.1.0.0"}});

}  // namespace
}  // namespace imud::vectornav
