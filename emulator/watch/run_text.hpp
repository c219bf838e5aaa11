// The figures of a run as text, from the answers of the control protocol.
#pragma once

#include <string>
#include <vector>

#include "emulator/control/json_rpc.hpp"

namespace imud {

// Returns the lines of a table. Columns are as wide as their widest text, and two spaces apart. `left`: the columns
// that are aligned left; the others are aligned right. Each row has as many texts as the first.
std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows,
                                     const std::vector<std::size_t>& left);

// Returns the text with ? in place of each control character, also one encoded in UTF-8, because a terminal would
// execute it. Line feeds are kept.
std::string printable(std::string text);

// Returns "0:03:05" for 185 s, "2 d 0:03:05" for two days more.
std::string run_time_text(double duration_s);

// Returns the table of the imus: product, configured rate, figures and port. `status`: the answer to the request
// `status`. `counters`: the figures to show, of the whole run or of an interval, in the form of the member `counters`
// of this answer.
std::vector<std::string> imu_lines(const Json& status, const Json& counters);
// Returns a line about the clock of the grids of samples; empty if they have no epoch.
std::string clock_line(const Json& counters);
// Returns a line about the truth of these figures.
std::string truth_line(const Json& counters);
// Returns a line for each fault that acts.
std::vector<std::string> fault_lines(const Json& status);

}  // namespace imud
