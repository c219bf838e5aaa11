#include "tools/campaign/campaign_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "core/numbers/number_text.hpp"
#include "emulator/campaign/shards/wilson.hpp"
#include "protocols/wire/csv_field.hpp"
#include "tools/campaign/campaign_report.hpp"
#include "tools/gnuplot.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

using Figure = CaseStatistics::Figure;
using Axis = CaseStatistics::Axis;

constexpr std::size_t most_places = 200;  // values of an axis in a picture
constexpr std::size_t most_labels = 12;

// An axis of a diagram: the values in their order, at numbers if all are numbers, otherwise at 0, 1, 2 ...
struct Scale {
  const Axis& axis;
  std::vector<std::size_t> order;
  std::vector<double> places;
  bool is_number = true, is_logarithmic = false;
};

Scale scale_of(const Axis& axis) {
  if (axis.values.size() > most_places)
    throw std::runtime_error(fmt::format("--plot: {} has more than {} values", axis.name, most_places));
  Scale scale{axis, order_of(axis), {}};
  for (const std::size_t value : scale.order) {
    const std::optional<double> number = finite_number_in(axis.values[value]);
    scale.is_number = scale.is_number && number.has_value();
    scale.places.push_back(number.value_or(0));
  }
  if (!scale.is_number)
    for (std::size_t i = 0; i < scale.places.size(); ++i) scale.places[i] = static_cast<double>(i);
  // Values with one ratio, which the digits of a plan round.
  scale.is_logarithmic = scale.is_number && scale.places.size() > 2 && scale.places.front() > 0;
  for (std::size_t i = 2; i < scale.places.size() && scale.is_logarithmic; ++i) {
    constexpr double rounding = 0.02;
    const double ratio = scale.places[i - 1] / scale.places[i - 2], next = scale.places[i] / scale.places[i - 1];
    scale.is_logarithmic = std::abs(next / ratio - 1) < rounding;
  }
  return scale;
}

// Returns a value as a label; of a long one, such as a path, the end.
std::string label_of(const std::string& value) {
  constexpr std::size_t longest = 28;
  const std::string line = on_one_line(value);
  return line.size() <= longest ? line : "..." + line.substr(line.size() - longest + 3);
}

// Returns the commands that label an axis, "x" or "y". `by_number`: its values are at their numbers, otherwise at
// their places in the order.
std::string axis_commands(const Scale& scale, std::string_view axis, bool by_number) {
  std::string text = fmt::format("set {}label {} noenhanced\n", axis, in_quotes(on_one_line(scale.axis.name)));
  if (by_number && scale.is_logarithmic) text += fmt::format("set logscale {}\n", axis);
  const std::size_t count = scale.order.size();
  if (by_number && scale.is_number && count > most_labels) return text;
  const std::size_t step = (count + most_labels - 1) / most_labels;
  std::string labels;
  std::size_t characters = 0;
  for (std::size_t i = 0; i < count; i += step) {
    const std::string label = label_of(scale.axis.values[scale.order[i]]);
    characters += label.size() + 2;
    const double place = by_number ? scale.places[i] : static_cast<double>(i);
    labels += fmt::format("{}{} {}", labels.empty() ? "" : ", ", in_quotes(label), place);
  }
  const bool is_crowded = axis == "x" && characters > 80;
  return text + fmt::format("set {}tics noenhanced {}({})\n", axis, is_crowded ? "rotate by -30 " : "", labels);
}

std::string begin(const std::string& picture, const std::string& title, std::size_t width, std::size_t height) {
  return terminal_commands(picture, width, height) +
         "set datafile separator ','\nset key above noenhanced samplen 2\nset style fill transparent solid 0.3 "
         "noborder\nset grid\n" +
         fmt::format("set title {} noenhanced\n", in_quotes(on_one_line(title)));
}

std::string cases_text(const CaseStatistics& statistics, std::size_t cases) {
  return statistics.sample().size() < statistics.runs()
             ? fmt::format("{} of {} cases, chosen at random", cases, statistics.cases())
             : fmt::format("{} cases", cases);
}

CampaignPicture histogram(const CaseStatistics& statistics, std::size_t number, const std::string& data_path,
                          const std::string& picture) {
  const Figure& figure = statistics.figures()[number];
  const std::vector<double> sorted = statistics.sorted(number);
  if (sorted.empty()) throw std::runtime_error(fmt::format("--plot: no case has a number for {}", figure.name));
  // 2 n^(1/3) bins of equal width.
  const double low = sorted.front(), high = sorted.back();
  const auto bins = low < high ? static_cast<std::size_t>(std::clamp(
                                     std::ceil(2 * std::cbrt(static_cast<double>(sorted.size()))), 1.0, 100.0))
                               : 1;
  const double width = low < high ? (high - low) / static_cast<double>(bins) : 1;
  std::vector<std::uint64_t> counts(bins);
  for (const double value : sorted)
    ++counts[std::min(bins - 1, static_cast<std::size_t>(std::max(0.0, (value - low) / width)))];
  std::string data = fmt::format("{},middle,width,cases\n", campaign_data);
  for (std::size_t i = 0; i < bins; ++i)
    data += fmt::format("histogram,{},{},{}\n", low + (static_cast<double>(i) + (low < high ? 0.5 : 0)) * width,
                        width, counts[i]);
  std::string text =
      begin(picture,
            fmt::format("{}: {}, mean {:.4g}, standard deviation {:.4g}", figure.name,
                        cases_text(statistics, sorted.size()), figure.all.mean, figure.all.deviation()),
            900, 520);
  text += fmt::format("set xlabel {} noenhanced\nset ylabel 'cases'\nset yrange [0:*]\n", in_quotes(figure.name));
  if (low == high) text += fmt::format("set xrange [{}:{}]\n", low - 1, high + 1);
  text += fmt::format("plot {} every ::1 using 2:4:3 with boxes linecolor 2 fillstyle solid 0.5 border notitle\n",
                      in_quotes(data_path));
  return {data, text};
}

constexpr std::string_view percentile_columns = "p5,p25,p50,p75,p95";

// Returns ",p5,p25,..." of sorted numbers.
std::string percentile_cells(const std::vector<double>& sorted) {
  std::string cells;
  for (const double share : {0.05, 0.25, 0.5, 0.75, 0.95}) cells += fmt::format(",{}", percentile(sorted, share));
  return cells;
}

// Returns the command that draws rows with their places, the means and the percentiles.
std::string fan_commands(const std::string& figure, const std::string& file) {
  return fmt::format("set ylabel {} noenhanced\nplot ", in_quotes(figure)) + file +
         "2:5:9 with filledcurves linecolor 1 title '5 to 95 %', \\\n  " + file +
         "2:6:8 with filledcurves linecolor 1 fillstyle transparent solid 0.45 title '25 to 75 %', \\\n  " + file +
         "2:7 with linespoints linecolor 'black' pointtype 7 title '50 %', \\\n  " + file +
         "2:4 with lines linecolor 'black' dashtype 2 title 'mean'\n";
}

CampaignPicture fan(const CaseStatistics& statistics, std::size_t number, std::size_t axis,
                    const std::string& data_path, const std::string& picture) {
  const Figure& figure = statistics.figures()[number];
  const Scale scale = scale_of(statistics.axes()[axis]);
  const auto sorted = statistics.sorted_by(number, axis);
  std::string data = fmt::format("{},place,runs,mean,{},value\n", campaign_data,
                                 figure.is_expectation ? "low,high" : percentile_columns);
  std::uint64_t runs = 0;
  for (std::size_t i = 0; i < scale.order.size(); ++i) {
    const std::size_t value = scale.order[i];
    if (value >= figure.by_axis[axis].size() || figure.by_axis[axis][value].runs == 0) continue;
    const Moments& moments = figure.by_axis[axis][value];
    runs += moments.runs;
    data += fmt::format("{},{},{},{}", figure.is_expectation ? "pass_rate" : "fan", scale.places[i], moments.runs,
                        figure.is_expectation ? 100 * moments.mean : moments.mean);
    if (figure.is_expectation) {
      const Interval interval = wilson_interval(moments.passes, moments.runs);
      data += fmt::format(",{},{}", 100 * interval.low, 100 * interval.high);
    } else {
      data += percentile_cells(sorted[value]);
    }
    data += "," + csv_field(on_one_line(scale.axis.values[value])) + "\n";
  }
  if (runs == 0) throw std::runtime_error(fmt::format("--plot: no case has a number for {}", figure.name));
  std::string text = begin(picture, fmt::format("{}: {}", figure.name, cases_text(statistics, runs)), 900, 560);
  text += axis_commands(scale, "x", true) + "set autoscale xfix\n";
  if (!scale.is_number || scale.order.size() == 1)
    text += fmt::format("set xrange [{}:{}]\n", scale.places.front() - 0.5, scale.places.back() + 0.5);
  const std::string file = in_quotes(data_path) + " every ::1 using ";
  if (figure.is_expectation)
    return {data, text + "set ylabel 'passed in %'\nset yrange [-2:102]\nplot " + file +
                      "2:5:6 with filledcurves linecolor 1 title '95 % interval (Wilson)', \\\n  " + file +
                      "2:4 with linespoints linecolor 1 pointtype 7 title 'pass rate'\n"};
  return {data, text + fan_commands(figure.name, file)};
}

CampaignPicture heat_map(const CaseStatistics& statistics, std::size_t number, const std::vector<std::size_t>& axes,
                         const std::string& data_path, const std::string& picture) {
  const Figure& figure = statistics.figures()[number];
  const Scale x = scale_of(statistics.axes()[axes[0]]), y = scale_of(statistics.axes()[axes[1]]);
  const std::size_t columns = x.order.size(), rows = y.order.size();
  std::vector<std::vector<Moments>> cells(x.axis.values.size(), std::vector<Moments>(y.axis.values.size()));
  std::size_t cases = 0;
  for (std::size_t row = 0; row < statistics.sample().size(); ++row) {
    const double value = statistics.number(row, number);
    const std::size_t at_x = statistics.sample().at(row, axes[0]), at_y = statistics.sample().at(row, axes[1]);
    if (std::isnan(value) || at_x >= columns || at_y >= rows) continue;
    cells[at_x][at_y].add(value);
    ++cases;
  }
  if (cases == 0) throw std::runtime_error(fmt::format("--plot: no case has a number for {}", figure.name));
  std::string data = fmt::format("{},x,y,mean,runs,value_x,value_y\n", campaign_data);
  for (std::size_t j = 0; j < rows; ++j)
    for (std::size_t i = 0; i < columns; ++i) {
      const Moments& cell = cells[x.order[i]][y.order[j]];
      const std::string mean =
          cell.runs == 0 ? "nan" : fmt::format("{}", figure.is_expectation ? 100 * cell.mean : cell.mean);
      data += fmt::format("heat_map,{},{},{},{},{},{}\n", i, j, mean, cell.runs,
                          csv_field(on_one_line(x.axis.values[x.order[i]])),
                          csv_field(on_one_line(y.axis.values[y.order[j]])));
    }
  const std::string what = figure.is_expectation ? "passed in %" : "mean of " + figure.name;
  std::string text = begin(picture, fmt::format("{}: {}", figure.name, cases_text(statistics, cases)), 900, 640);
  text += axis_commands(x, "x", false) + axis_commands(y, "y", false);
  text += fmt::format(
      "unset grid\nunset key\nset style fill solid\nset palette defined (0 '#ffffff', 1 '#9ecae1', 2 '#4292c6')\nset "
      "cblabel {} "
      "noenhanced\nset xrange [-0.5:{}]\nset yrange "
      "[-0.5:{}]\nset tics out nomirror\n",
      in_quotes(what), static_cast<double>(columns) - 0.5, static_cast<double>(rows) - 0.5);
  if (figure.is_expectation) text += "set cbrange [0:100]\n";
  const std::string file = in_quotes(data_path) + " every ::1 using ";
  text += "plot " + file + "2:3:4 with image pixels";
  // With at most 120 cells each has room for its number.
  if (columns * rows <= 120) text += fmt::format(", \\\n  {}2:3:(sprintf('%.3g', $4)) with labels font ',9'", file);
  return {data, text + "\n"};
}

}  // namespace

CampaignPicture draw_over_time(const CaseStatistics& statistics, const std::string& name,
                               const std::string& data_path, const std::string& picture) {
  std::string data = fmt::format("{},time_s,runs,mean,{}\n", campaign_data, percentile_columns);
  std::uint64_t runs = 0;
  for (const auto& [time_s, number] : statistics.find_over_time(name)) {
    const Moments& all = statistics.figures()[number].all;
    if (all.runs == 0) continue;
    runs = std::max(runs, all.runs);
    data += fmt::format("over_time,{},{},{}{}\n", time_s, all.runs, all.mean,
                        percentile_cells(statistics.sorted(number)));
  }
  if (runs == 0) throw std::runtime_error(fmt::format("--plot: no case has a number for {}", name));
  return {data, begin(picture, fmt::format("{}: {}", name, cases_text(statistics, runs)), 900, 560) +
                    "set xlabel 'time in s'\nset autoscale xfix\n" +
                    fan_commands(name, in_quotes(data_path) + " every ::1 using ") + "unset output\n"};
}

CampaignPicture draw_campaign(const CaseStatistics& statistics, std::size_t figure,
                              const std::vector<std::size_t>& axes, const std::string& data_path,
                              const std::string& picture) {
  CampaignPicture drawn = axes.empty()       ? histogram(statistics, figure, data_path, picture)
                          : axes.size() == 1 ? fan(statistics, figure, axes[0], data_path, picture)
                                             : heat_map(statistics, figure, axes, data_path, picture);
  drawn.commands += "unset output\n";
  return drawn;
}

}  // namespace imud
