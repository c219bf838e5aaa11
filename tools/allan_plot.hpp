// allan_plot: draws Allan deviations by gnuplot.
#pragma once

#include <string>

#include "tools/allan_report.hpp"

namespace imud {

// Throws std::invalid_argument if `path` ends neither in .svg nor in .png, and std::runtime_error, which names
// Debian's package, if there is no gnuplot.
void check_plot(const std::string& path);

// Returns the path with the ending .csv: of the data beside the picture.
std::string data_path_beside(const std::string& picture);

// Returns gnuplot's commands that draw the report's CSV, which stands at `data`, to `picture`: double logarithmic, a
// diagram for each sensor, with the bounds as a band and the fitted terms as a dashed line.
std::string plot_commands(const AllanReport& report, const std::string& data, const std::string& picture);

// Executes the commands. Throws std::runtime_error if gnuplot fails.
void run_gnuplot(const std::string& commands);

}  // namespace imud
