#include "tests/protocols/conformance.hpp"

namespace imud {
namespace {

constexpr std::string_view bodies[] = {
    "18EA2000#00EE00", "18EA2000#2AF000", "18EAFF00#DAFE00",           "18EA2000#DAFE00 1CEC2000#110301FFFFDAFE00",
    "18EA2000#C5FD00", "18EEFF20#00",     "18EEFF20#0000000000000000", "1CEC2000#10090002FFD8FE00"};
constexpr std::string_view revive[] = {
    "1CECFF00#20090002FFD8FE00 1CEBFF00#0101000000000000 1CEBFF00#028020FFFFFFFFFF"};
const Conformance throwaway_node("throwaway-node",
                                 {.host = {.frame = [](std::string_view body) { return std::string(body); },
                                           .bodies = bodies,
                                           .revive = revive,
                                           .last = "18EAFF00#00EE00",
                                           .answer = "#0100000000000080"}});

}  // namespace
}  // namespace imud
