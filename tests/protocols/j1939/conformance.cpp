// The configurations in which the unit is tested, and the inputs from which its fuzz test starts.
#include "tests/protocols/conformance.hpp"

#include <string>
#include <string_view>

#include "protocols/j1939/measured.hpp"

namespace imud::j1939 {
namespace {

constexpr void set_fine(Protocol& entry) {
  entry.resolution = {.rate = fine_rate_scale.lsb(), .specific_force = fine_force_scale.lsb()};
}

constexpr ConformanceSettings conformance_settings[] = {
    {"claim_wait_ms=0"},
    {"claim_wait_ms=0 slot_order=j1939 axis_signs=enu claim_period_ms=1000 identification=j1939"},
    {"claim_wait_ms=0 packet_types=ari_hr,accs_hr,ssi", set_fine},
    {"claim_wait_ms=0 packet_types=ssi2,ari,accs,ari_hr,accs_hr,ssi name_arbitrary_address=false rate_priority=1",
     set_fine},
    // The firmware rounds down.
    {"claim_wait_ms=0 model=openimu300ri packet_types=ssi2,ari,accs,mag,position source_address=200",
     [](Protocol& entry) {
       entry.resolution = {.rate = 2 * rate_scale.lsb(), .specific_force = 2 * force_scale.lsb()};
     }},
};

constexpr std::string_view host_bodies[] = {
    "18EAFF00#00EE00",                          // request for address claims
    "18EA8000#C5FD00",                          // ECU identification
    "18EAFF00#00FEDA",                          // software, high byte first
    "18EA8000#2DF000",                          // ACCS
    "18EA8000#54FF00",                          // master status
    "18EA8000#59FF00",                          // user behavior
    "18EA8000#EBFE00",                          // component identification: refused
    "18FF5500#8002",                            // packet rate
    "18FF5600#803F000000",                      // packet types
    "18FF5600#80070024FF",                      // with priorities
    "18FF5700#801932",                          // filters
    "18FF5800#800048",                          // orientation
    "18FF5900#8008004000FF",                    // user behavior
    "18FF5900#800000080081",                    // a new address
    "18FF5B00#80FFD007D0070A00",                // algorithm
    "18FF5100#0080",                            // save
    "18FF5100#0280",                            // save and restart
    "18FF5000#0280",                            // reset and restart
    "18FFF000#805051525354636D",                // banks
    "18FFF100#8055565758595B00",                //
    "18DFFF00#3FFFFFFFFFFFFFFF",                // DM13: stop
    "18DFFF00#7FFFFFFFFFFFFFFF",                // DM13: start
    "18D98000#10DF0000000007FF",                // DM14: memory access
    "18EEFF80#0000000000000000",                // a claim that wins
    "18EEFF80#FFFFFFFFFFFFFFFF",                // a claim that loses
    "18EEFF90#0100000000000000",                // a claim of another address
    "0CF02A80#0102030405060708",                // another node's frame
    "1CECFF00#20090002FFD8FE00 1CEBFF00#0101",  // commanded address, badly cut
    "1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#028081FFFFFFFFFF",  // commanded address
    "1CEC8000#10090002FFD8FE00",                                                      // RTS
    "1CEB8000#010100E066008300",                                                      // and data
    "1CEB8000#028081FFFFFFFFFF",
    "1CEC8000#110201FFFFC5FD00",        // CTS
    "1CEC8000#110001FFFFC5FD00",        // CTS that holds
    "1CEC8000#13190004FFC5FD00",        // end of message
    "1CEC8000#FF02FFFFFFC5FD00",        // abort
    "18EAFF00#C5FD00 18EAFF00#DAFE00",  // one broadcast after another
    // RTS, answered by CTS, the first packets again and again; and by an abort.
    "18EA8000#C5FD00 1CEC8000#110201FFFFC5FD00 1CEC8000#110401FFFFC5FD00 1CEC8000#110401FFFFC5FD00 "
    "1CEC8000#110401FFFFC5FD00",
    "18EA8000#C5FD00 1CEC8000#FF02FFFFFFC5FD00",
    // Commanded address, packet by packet.
    "1CEC8000#1009000201D8FE00 1CEB8000#010100E066008300 1CEB8000#028080FFFFFFFFFF",
    "18EA8000#52FF00 18EA8000#55FF00 18EA8000#56FF00 18EA8000#57FF00 18EA8000#58FF00 18EA8000#5BFF00",
    "1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#028080FFFFFFFFFF",  // the first address again
};
// Broadcasts that command the address 0x80, by the unit's NAME with the arbitrary-address bit, and without.
constexpr std::string_view revive[] = {
    "1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#028080FFFFFFFFFF",
    "1CECFF00#20090002FFD8FE00 1CEBFF00#010100E066008300 1CEBFF00#020080FFFFFFFFFF"};

std::string framed(std::string_view body) { return std::string(body); }
const Conformance conformance("j1939", {.settings = conformance_settings,
                                        .host = {.frame = framed,
                                                 .bodies = host_bodies,
                                                 .revive = revive,
                                                 .last = "18EAFF00#00EE00",
                                                 .answer = "#0100E066008300"}});

}  // namespace
}  // namespace imud::j1939
