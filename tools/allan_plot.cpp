#include "tools/allan_plot.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

namespace imud {

namespace {

// A text in gnuplot's single quotes, in which nothing is special but the quote.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c);
  return result + "'";
}

bool has_gnuplot() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((folder + "/gnuplot").c_str(), X_OK) == 0) return true;
  return false;
}

}  // namespace

void check_plot(const std::string& path) {
  if (!path.ends_with(".svg") && !path.ends_with(".png"))
    throw std::invalid_argument(fmt::format("--plot {}: right would be FILE.svg or FILE.png", path));
  if (!has_gnuplot())
    throw std::runtime_error("--plot: there is no gnuplot; right would be: apt-get install gnuplot-nox");
}

std::string data_path_beside(const std::string& picture) { return picture.substr(0, picture.size() - 4) + ".csv"; }

std::string plot_commands(const AllanReport& report, const std::string& data, const std::string& picture) {
  std::size_t diagrams = 0;
  for (const bool is_rate : {true, false})
    for (const auto& axis : report.axes)
      if (axis.is_rate() == is_rate) {
        ++diagrams;
        break;
      }
  std::string text = fmt::format("set terminal {} size 900,{}\nset output {}\n",
                                 picture.ends_with(".svg") ? "svg enhanced background 'white'" : "pngcairo enhanced",
                                 520 * diagrams, quoted(picture));
  text +=
      "set datafile separator ','\nset logscale xy\nset format '10^{%T}'\nset grid xtics ytics mxtics mytics\n"
      "set key outside right top noenhanced\nset style fill transparent solid 0.2 noborder\n"
      "set xlabel 'averaging time in s'\n";
  text += fmt::format("set multiplot layout {},1\n", diagrams);
  const double percent = 100 * report.confidence;
  for (const bool is_rate : {true, false}) {
    const TermUnit& unit = deviation_unit(is_rate);
    std::string plots;
    std::size_t color = 0;
    for (std::size_t i = 0; i < report.axes.size(); ++i) {
      const auto& axis = report.axes[i];
      if (axis.is_rate() != is_rate) continue;
      const std::size_t column = 2 + report.csv_columns_per_axis() * i;
      const auto scaled = [&](std::size_t offset) { return fmt::format("(${}*{})", column + offset, unit.factor); };
      ++color;
      plots += fmt::format("{}{} every ::1 using 1:{}:{} with filledcurves linecolor {} title '{:.3g} %'",
                           plots.empty() ? "plot " : ", \\\n  ", quoted(data), scaled(1), scaled(2), color, percent);
      plots += fmt::format(
          ", \\\n  {} every ::1 using 1:{} with linespoints linecolor {} pointtype 7 pointsize 0.4 title '{}'",
          quoted(data), scaled(0), color, axis.name());
      plots += fmt::format(", \\\n  {} every ::1 using 1:{} with lines linecolor {} dashtype 2 title 'fitted'",
                           quoted(data), scaled(3), color);
      if (report.against)
        plots += fmt::format(", \\\n  {} every ::1 using 1:{} with lines linecolor 'black' linewidth 2 dashtype 3 {}",
                             quoted(data), scaled(4),
                             color == 1 ? "title " + quoted(report.against->model) : std::string("notitle"));
    }
    if (plots.empty()) continue;
    text += fmt::format("set ylabel '{} deviation in {}'\n{}\n", name_of(report.axes.front().curve.kind),
                        unit.datasheet, plots);
  }
  return text + "unset multiplot\nunset output\n";
}

void run_gnuplot(const std::string& commands) {
  std::FILE* pipe = ::popen("gnuplot", "w");
  if (pipe == nullptr) throw std::runtime_error("gnuplot cannot be started");
  const bool is_written = std::fwrite(commands.data(), 1, commands.size(), pipe) == commands.size();
  const int status = ::pclose(pipe);
  if (!is_written || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error("gnuplot has failed, as it reports above");
}

}  // namespace imud
