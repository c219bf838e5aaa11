#include "tools/plot/run_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "core/units.hpp"
#include "tools/gnuplot.hpp"

namespace imud {
namespace {

using Channel = RunErrors::Channel;

// The columns of a channel in the file of samples. A chart may draw each of them.
constexpr struct Column {
  std::string_view suffix;  // of the channel's name
  std::vector<double> Channel::*values;
} columns[] = {{"", &Channel::measured},
               {"_truth", &Channel::truth},
               {"_error", &Channel::error},
               {"_mean", &Channel::mean},
               {"_sigma", &Channel::sigma}};

// Returns the number of the column within its channel; it does not compile for values without a column.
consteval std::size_t place_of(std::vector<double> Channel::*values) {
  std::size_t place = 0;
  while (columns[place].values != values) ++place;
  return place;
}

// The range that a diagram shows.
struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) noexcept {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // gnuplot chooses the range of y, unless all values are equal except for rounding; gnuplot would warn about such
  // values.
  std::string command(double factor) const {
    constexpr double rounding = 1e-6;
    if (high - low > rounding * std::max(std::abs(low), std::abs(high))) return "set yrange [*:*]\n";
    return fmt::format("set yrange [{}:{}]\n", low * factor - 1, high * factor + 1);
  }
};

}  // namespace

std::string samples_csv(const RunErrors& run) {
  std::string text = "time_s";
  for (const auto& channel : run.channels)
    for (const Column& column : columns) text += fmt::format(",{}{}", channel.name(), column.suffix);
  text += "\n";
  for (const auto& channel : run.channels)
    for (const Column& column : columns)
      if ((channel.*column.values).size() != run.samples())
        throw std::logic_error(fmt::format("compare_runs() has not computed {}{}", channel.name(), column.suffix));
  const std::size_t step = (run.samples() + most_rows - 1) / most_rows;
  for (std::size_t i = 0; i < run.samples(); i += step) {
    text += fmt::format("{}", static_cast<double>(i) / run.rate_hz);
    for (const auto& channel : run.channels)
      for (const Column& column : columns) text += fmt::format(",{}", (channel.*column.values)[i]);
    text += "\n";
  }
  return text;
}

std::string spectrum_csv(const RunErrors& run) {
  std::string text = "frequency_hz";
  for (const auto& channel : run.channels) text += fmt::format(",{}", channel.name());
  text += "\n";
  for (std::size_t k = 0; k < run.frequencies_hz.size(); ++k) {
    text += fmt::format("{}", run.frequencies_hz[k]);
    for (const auto& channel : run.channels) text += fmt::format(",{}", channel.density[k]);
    text += "\n";
  }
  return text;
}

namespace {

// A channel whose charts are drawn, with the quoted paths of the data.
struct Row {
  const RunErrors& run;
  std::size_t number;
  std::string samples, spectrum;

  const Channel& channel() const { return run.channels[number]; }
  bool is_last() const { return number + 1 == run.channels.size(); }
  // gnuplot's column of values, from 1.
  std::size_t column(std::size_t place) const { return 2 + std::size(columns) * number + place; }
  double factor() const { return channel().is_rate() ? 1 / units::degree : 1; }
  double error_factor() const { return channel().is_rate() ? 1 / units::degree : 1000 / units::standard_gravity; }
  // Returns the command of a label below the lowest chart of a column.
  std::string x_label(std::string_view text) const {
    return is_last() ? fmt::format("set xlabel '{}'\n", text) : std::string();
  }
  const char* error_unit() const { return channel().is_rate() ? "deg/s" : "mg"; }
};

std::string values_chart(const Row& row) {
  constexpr std::size_t measured = place_of(&Channel::measured), truth = place_of(&Channel::truth);
  Range range;
  for (const double value : row.channel().measured) range.add(value);
  for (const double value : row.channel().truth) range.add(value);
  return row.x_label("time in s") + range.command(row.factor()) +
         fmt::format(
             "set ylabel '{0} in {1}' noenhanced\nplot {2} every ::1 using 1:(${3}*{4}) with lines linecolor 2 title "
             "'measured', \\\n  {2} every ::1 using 1:(${5}*{4}) with lines linecolor 'black' title 'truth'\n",
             row.channel().name(), row.channel().is_rate() ? "deg/s" : "m/s^2", row.samples, row.column(measured),
             row.factor(), row.column(truth));
}

std::string errors_chart(const Row& row) {
  constexpr std::size_t error = place_of(&Channel::error), mean = place_of(&Channel::mean),
                        sigma = place_of(&Channel::sigma);
  const Channel& channel = row.channel();
  Range range;
  for (std::size_t i = 0; i < row.run.samples(); ++i) {
    range.add(channel.error[i]);
    range.add(channel.mean[i] - channel.sigma[i]);
    range.add(channel.mean[i] + channel.sigma[i]);
  }
  return row.x_label("time in s") + range.command(row.error_factor()) +
         fmt::format(
             "set ylabel 'error in {0}' noenhanced\nplot {1} every ::1 using 1:(${2}*{5}) with lines linecolor 2 "
             "title "
             "'error', \\\n  {1} every ::1 using 1:((${3}-${4})*{5}):((${3}+${4})*{5}) with filledcurves linecolor 1 "
             "title '1 sigma', \\\n  {1} every ::1 using 1:(${3}*{5}) with lines linecolor 1 title 'mean'\n",
             row.error_unit(), row.samples, row.column(error), row.column(mean), row.column(sigma),
             row.error_factor());
}

std::string spectrum_chart(const Row& row) {
  // A channel without errors has no spectrum that a logarithmic axis could show.
  const bool has_errors = std::ranges::any_of(row.channel().density, [](double root) { return root > 0; });
  return row.x_label("frequency in Hz") +
         (has_errors ? "set logscale xy\nset format '10^{%T}'\n" : "set yrange [-1:1]\n") +
         fmt::format(
             "set ylabel 'error in {}/sqrt(Hz)' noenhanced\nplot {} every ::1 using 1:(${}*{}) with lines "
             "linecolor 3 notitle\n",
             row.error_unit(), row.spectrum, 2 + row.number, row.error_factor());
}

// The charts of a channel, from the left. Each begins with linear axes without labels, whose ranges follow from the
// data.
constexpr std::string (*charts[])(const Row&) = {values_chart, errors_chart, spectrum_chart};

}  // namespace

std::string run_plot_commands(const RunErrors& run, const std::string& samples_path, const std::string& spectrum_path,
                              const std::string& picture) {
  const std::size_t rows = run.channels.size();
  std::string text = terminal_commands(picture, 500 * std::size(charts), 230 * rows);
  text +=
      "set datafile separator ','\nset key above noenhanced samplen 2\nset style fill transparent solid "
      "0.3 "
      "noborder\nset grid\n";
  text += fmt::format("set multiplot layout {},{}\n", rows, std::size(charts));
  for (std::size_t i = 0; i < rows; ++i) {
    if (i == 1) text += "unset key\n";
    for (const auto chart : charts)
      text += "unset logscale\nset format '%g'\nset autoscale\nunset xlabel\nunset ylabel\n" +
              chart({run, i, in_quotes(samples_path), in_quotes(spectrum_path)});
  }
  return text + "unset multiplot\nunset output\n";
}

}  // namespace imud
