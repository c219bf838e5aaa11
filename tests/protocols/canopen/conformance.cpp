// The configurations in which the CANopen slave is tested, and the inputs from which its fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <string>
#include <string_view>

#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {
namespace {

// The LSB of a float32 is 2^-24 of the number: the test uses numbers up to 1.
constexpr ConformanceSettings conformance_settings[] = {
    {"start_up_ms=0 self_start=true"},
    {"start_up_ms=0 self_start=true node_id=127 tpdo3_enabled=true tpdo4_enabled=true tpdo3=delta_angle_i16,time_u16",
     [](Protocol& entry) {
       entry.fields |= Measurement::delta_angle | Measurement::delta_velocity | Measurement::time;
       entry.resolution.time_s = 1e-4;
       entry.time_period_ns = 0x10000 * std::int64_t{100'000};
       entry.resolution.delta_angle = double{lsb_16[2]};
       entry.resolution.delta_velocity = double{lsb_16[3]};
       entry.range.delta_angle = 0x7FFF * double{lsb_16[2]};
       entry.range.delta_velocity = 0x7FFF * double{lsb_16[3]};
     }},
    {"start_up_ms=0 self_start=true heartbeat_ms=0 tpdo1=rate_f32.x,rate_f32.y tpdo2=rate_f32.z,counter_u32 "
     "tpdo3_enabled=true "
     "tpdo3=time_u64 tpdo4_enabled=true tpdo4=temperature_i16,status_u32,counter_u8",
     [](Protocol& entry) {
       entry.fields = Measurement::counter | Measurement::rate | Measurement::status | Measurement::time |
                      Measurement::temperature;
       entry.resolution = {.rate = 0x1p-24, .temperature_c = 0.01};
       entry.range = {.rate = 1, .temperature_c = 327.67};
       entry.counter_bits = 32;
       entry.status_bits = ~0U;
     }},
    {"start_up_ms=0 self_start=true node_id=1 tpdo1=specific_force_i32.x,specific_force_i32.y "
     "tpdo2=specific_force_i32.z,counter_u8,temperature_i16 tpdo3_enabled=true "
     "tpdo3=time_u32,slope_long_i16,slope_lateral_i16",
     [](Protocol& entry) {
       entry.fields =
           Measurement::counter | Measurement::specific_force | Measurement::time | Measurement::temperature;
       entry.resolution = {.time_s = 1e-6, .specific_force = double{lsb_32[1]}, .temperature_c = 0.01};
       entry.range = {.specific_force = 0x7FFF'FFFF * double{lsb_32[1]}, .temperature_c = 327.67};
       entry.time_period_ns = (std::int64_t{1} << 32) * 1000;
       entry.counter_bits = 8;
     }},
};

// For node 10, as candump writes them.
constexpr std::string_view host_bodies[] = {
    "000#010A",
    "000#0200",
    "000#8000",
    "000#8100",
    "000#820A",
    "080#",
    "080#01",
    "100#00F0520210280000",
    "100#785634120A30",
    "18A#R",
    "28A#0102030405060708",
    "70A#R",
    "70A#05",
    "701#05",
    "60A#4000100000000000",
    "60A#4018100100000000",
    "60A#2B171000640000",
    "60A#2B17100064000000",
    "60A#2316100164000100 701#05",
    "60A#4008100000000000 60A#6000000000000000 60A#7000000000000000",
    "60A#2100200009000000 60A#00494D5500000000 60A#1141420000000000",
    "60A#A40810007F000000 60A#A300000000000000 60A#A2067F0000000000 60A#A100000000000000",
    "60A#C400200000000000 60A#0161626364656667 60A#8261626364656667 60A#C100000000000000",
    // 2000 has 17 segments then, of which an upload sends 16 at once.
    "60A#C600200077000000 60A#0161626364656667 60A#0268696A6B6C6D6E 60A#036F707172737475 60A#04767778797A6162 "
    "60A#0563646566676869 60A#066A6B6C6D6E6F70 60A#0771727374757677 60A#0878797A61626364 60A#0965666768696A6B "
    "60A#0A6C6D6E6F707172 60A#0B73747576777879 60A#0C7A616263646566 60A#0D6768696A6B6C6D 60A#0E6E6F7071727374 "
    "60A#0F75767778797A61 60A#1062636465666768 60A#91696A6B6C6D6E6F 60A#C1B1DD0000000000",
    "60A#A40020007F000000 60A#A300000000000000",
    "60A#A2117F0000000000 60A#A100000000000000",
    "60A#A408100002000000 60A#A300000000000000 60A#A202020000000000 60A#A201020000000000 60A#A202020000000000 "
    "60A#A2027F0000000000 60A#A100000000000000",
    "60A#4001100000000000 60A#4003100100000000 60A#4002200100000000",
    "60A#4009100000000000 60A#4010100100000000 60A#4050210100000000 60A#4041210100000000 60A#4070210400000000 "
    "60A#4010600000000000 60A#4020610000000000",
    "60A#2B00600064000000 60A#23801F0000000000",
    "60A#2F03100000000000 60A#231410008A000080 60A#2303210117B7D138",
    "60A#2F29100102000000 60A#2316100164000100 701#05",
    "60A#2F001802FC000000 18A#R 080# 18A#R",
    "60A#230018018A010080 60A#2F00180604000000 60A#2F00180202000000 60A#230018018A010000 60A#2F1910000A000000 080#04",
    "60A#2310100173617665",
    "60A#231110016C6F6164",
    "60A#230018018A010080 60A#2F001A0000000000 60A#23001A0110000021 60A#2F001A0001000000 60A#230018018A010000",
    "60A#2F00180201000000 60A#2F00180600000000 60A#2B00180505000000",
    "60A#2319100008000000 080#03",
    "60A#2306100010270000 080#",
    "60A#2B17100000000000 60A#2B0C100064000000 60A#2F0D100003000000 70A#R",
    "60A#2F01200001000000",
    "60A#2F11600003000000 60A#2B12600010000000",
    "60A#8000000000000508",
    "7E5#0401000000000000 7E5#110A000000000000 7E5#1700000000000000 7E5#0400000000000000",
    "7E5#0401000000000000 7E5#11FF000000000000 7E5#5E00000000000000 7E5#1300020000000000 7E5#5A00000000000000",
    "7E5#4000000000000000 7E5#4101000000000000 7E5#4200000100000000 7E5#4301000000000000",
    "7E5#4600000000000000 7E5#4701000000000000 7E5#4800000000000000 7E5#4900000200000000 7E5#4A00000000000000 "
    "7E5#4BFFFFFFFF000000",
    "7E5#4C00000000000000",
    "7E5#5100000000800000 7E5#510000000000000001",
};
// LSS gives the device its node id again, and a reset makes that effective.
constexpr std::string_view revive[] = {"7E5#0401000000000000 7E5#110A000000000000 7E5#0400000000000000", "000#8100"};

std::string framed(std::string_view body) { return std::string(body); }
const Conformance conformance("canopen", {.settings = conformance_settings,
                                          .host = {.frame = framed,
                                                   .bodies = host_bodies,
                                                   .revive = revive,
                                                   .last = "60A#4000100000000000",
                                                   .answer = "58A#430010009A010400"}});

}  // namespace
}  // namespace imud::canopen
