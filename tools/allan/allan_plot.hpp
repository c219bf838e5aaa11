// allan_plot: draws Allan deviations by gnuplot.
#pragma once

#include <string>

#include "tools/allan/allan_report.hpp"

namespace imud {

// Returns gnuplot's commands that draw the report's CSV in the file `data` to the file `picture`: double
// logarithmic, a diagram for each sensor, with the bounds as a band, the fitted terms as a dashed line, and the
// model, if there is one, as a dotted line. A channel that never changes is left out. Throws std::runtime_error if no
// channel is left.
std::string plot_commands(const AllanReport& report, const std::string& data, const std::string& picture);

}  // namespace imud
