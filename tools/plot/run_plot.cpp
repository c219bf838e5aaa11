#include "tools/plot/run_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/units.hpp"
#include "tools/gnuplot.hpp"

namespace imud {

namespace {

constexpr std::size_t columns_per_channel = 5;

// The range that a diagram shows.
struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) noexcept {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // gnuplot chooses the range of y, unless the values are one but for rounding, for which it warns.
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
    text += fmt::format(",{0},{0}_truth,{0}_error,{0}_mean,{0}_sigma", channel.name());
  text += "\n";
  const std::size_t step = (run.samples() + most_rows - 1) / most_rows;
  for (std::size_t i = 0; i < run.samples(); i += step) {
    text += fmt::format("{}", static_cast<double>(i) / run.rate_hz);
    for (const auto& c : run.channels)
      text += fmt::format(",{},{},{},{},{}", c.measured[i], c.truth[i], c.error[i], c.mean[i], c.sigma[i]);
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

std::string run_plot_commands(const RunErrors& run, const std::string& samples_path, const std::string& spectrum_path,
                              const std::string& picture) {
  const std::size_t rows = run.channels.size();
  std::string text = terminal_commands(picture, 1500, 230 * rows);
  text +=
      "set datafile separator ','\nset key above noenhanced samplen 2\nset style fill transparent solid "
      "0.3 "
      "noborder\nset grid\n";
  text += fmt::format("set multiplot layout {},3\n", rows);
  const std::string samples = quoted(samples_path), spectrum = quoted(spectrum_path);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto& channel = run.channels[i];
    const double factor = channel.is_rate() ? 1 / units::degree : 1;
    const double error_factor = channel.is_rate() ? 1 / units::degree : 1000 / units::standard_gravity;
    const char* unit = channel.is_rate() ? "deg/s" : "m/s^2";
    const char* error_unit = channel.is_rate() ? "deg/s" : "mg";
    const std::size_t column = 2 + columns_per_channel * i;
    if (i == 1) text += "unset key\n";
    text += fmt::format("unset logscale\nset format '%g'\nset xlabel '{}'\n", i + 1 == rows ? "time in s" : "");
    Range values, errors;
    for (std::size_t k = 0; k < run.samples(); ++k) {
      values.add(channel.measured[k]);
      values.add(channel.truth[k]);
      errors.add(channel.error[k]);
      errors.add(channel.mean[k] - channel.sigma[k]);
      errors.add(channel.mean[k] + channel.sigma[k]);
    }
    text += values.command(factor);
    text += fmt::format(
        "set ylabel '{0} in {1}' noenhanced\nplot {2} every ::1 using 1:(${3}*{4}) with lines linecolor 2 title "
        "'measured', \\\n  {2} every ::1 using 1:(${5}*{4}) with lines linecolor 'black' title 'truth'\n",
        channel.name(), unit, samples, column, factor, column + 1);
    text += errors.command(error_factor);
    text += fmt::format(
        "set ylabel 'error in {0}' noenhanced\nplot {1} every ::1 using 1:(${2}*{5}) with lines linecolor 2 title "
        "'error', \\\n  {1} every ::1 using 1:((${3}-${4})*{5}):((${3}+${4})*{5}) with filledcurves linecolor 1 "
        "title "
        "'1 sigma', \\\n  {1} every ::1 using 1:(${3}*{5}) with lines linecolor 1 title 'mean'\n",
        error_unit, samples, column + 2, column + 3, column + 4, error_factor);
    // A channel without errors has no spectrum that a logarithmic axis could show.
    const bool has_errors = std::ranges::any_of(channel.density, [](double root) { return root > 0; });
    text += has_errors ? "set logscale xy\nset yrange [*:*]\nset format '10^{%T}'\n" : "set yrange [-1:1]\n";
    text += fmt::format("set xlabel '{}'\n", i + 1 == rows ? "frequency in Hz" : "");
    text += fmt::format(
        "set ylabel 'error in {0}/sqrt(Hz)' noenhanced\nplot {1} every ::1 using 1:(${2}*{3}) with "
        "lines linecolor 3 notitle\n",
        error_unit, spectrum, 2 + i, error_factor);
  }
  return text + "unset multiplot\nunset output\n";
}

}  // namespace imud
