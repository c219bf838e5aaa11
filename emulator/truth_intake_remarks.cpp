// The remarks of TruthIntake on what is accepted, but probably not meant.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "emulator/truth_intake.hpp"

namespace imud {

void TruthIntake::remark_place() noexcept {
  counters_.remarks.place.set([&](std::span<char> room) { return place_.describe_place(truth_, room); });
  counters_.remarks.date.set([&](std::span<char> room) { return place_.describe_date(truth_, room); });
}

// The last record is whole, but nothing says that its last number is.
void TruthIntake::remark_last_line() noexcept {
  counters_.remarks.last_line.set([&](std::span<char> room) {
    const auto result =
        fmt::format_to_n(room.data(), room.size(),
                         "the last line of the file has no line feed; it has all that a line needs, and "
                         "is used: if the file was cut, its last number may be");
    return std::min(result.size, room.size());
  });
}

}  // namespace imud
