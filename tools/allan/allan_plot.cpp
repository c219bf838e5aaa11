#include "tools/allan/allan_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "tools/gnuplot.hpp"

namespace imud {
namespace {

// A channel that never changes has no deviation that a logarithmic axis could show.
bool is_drawn(const AllanReport::Axis& axis) {
  return std::ranges::any_of(axis.curve.points, [](const AllanCurve::Point& point) { return point.deviation > 0; });
}

}  // namespace

std::string plot_commands(const AllanReport& report, const std::string& data, const std::string& picture) {
  std::size_t diagrams = 0;
  for (const bool is_rate : {true, false})
    for (const auto& axis : report.axes)
      if (axis.is_rate() == is_rate && is_drawn(axis)) {
        ++diagrams;
        break;
      }
  if (diagrams == 0)
    throw std::runtime_error("--plot: no channel changes, and a logarithmic axis cannot show a deviation of 0");
  std::string text = terminal_commands(picture, 900, 520 * diagrams);
  text +=
      "set datafile separator ','\nset logscale xy\nset format '10^{%T}'\nset grid xtics ytics mxtics mytics\n"
      "set key outside right top noenhanced\nset style fill transparent solid 0.2 noborder\n"
      "set xlabel 'averaging time in s'\n";
  const double rate_hz = report.recording.rate_hz;
  const std::string title = fmt::format("{} {}: {} samples at {:.6g} Hz in {:.6g} s", report.protocol, report.port,
                                        report.samples, rate_hz, static_cast<double>(report.samples) / rate_hz);
  text += fmt::format("set multiplot layout {},1 title {} noenhanced\n", diagrams, in_quotes(title));
  const double percent = 100 * report.confidence;
  for (const bool is_rate : {true, false}) {
    const TermUnit& unit = deviation_unit(is_rate);
    std::string plots;
    std::size_t color = 0;
    for (std::size_t i = 0; i < report.axes.size(); ++i) {
      const auto& axis = report.axes[i];
      if (axis.is_rate() != is_rate || !is_drawn(axis)) continue;
      const std::size_t column = 2 + report.csv_columns_per_axis() * i;
      const auto scaled = [&](std::size_t offset) { return fmt::format("(${}*{})", column + offset, unit.factor); };
      ++color;
      plots +=
          fmt::format("{}{} every ::1 using 1:{}:{} with filledcurves linecolor {} title '{:.3g} %'",
                      plots.empty() ? "plot " : ", \\\n  ", in_quotes(data), scaled(1), scaled(2), color, percent);
      plots += fmt::format(
          ", \\\n  {} every ::1 using 1:{} with linespoints linecolor {} pointtype 7 pointsize 0.4 title '{}'",
          in_quotes(data), scaled(0), color, axis.name());
      plots += fmt::format(", \\\n  {} every ::1 using 1:{} with lines linecolor {} dashtype 2 title 'fitted'",
                           in_quotes(data), scaled(3), color);
      if (report.against)
        plots += fmt::format(", \\\n  {} every ::1 using 1:{} with lines linecolor 'black' linewidth 2 dashtype 3 {}",
                             in_quotes(data), scaled(4),
                             color == 1 ? "title " + in_quotes(report.against->model) : std::string("notitle"));
    }
    if (plots.empty()) continue;
    text += fmt::format("set ylabel '{} deviation in {}'\n{}\n", name_of(report.axes.front().curve.kind),
                        unit.datasheet, plots);
  }
  return text + "unset multiplot\nunset output\n";
}

}  // namespace imud
