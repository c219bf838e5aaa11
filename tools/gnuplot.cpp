#include "tools/gnuplot.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace imud {
namespace {

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

std::string data_path_beside(const std::string& picture) {
  return picture.substr(0, picture.size() - 4) + ".plot.csv";
}

void check_data_path(const std::string& path, std::string_view begin) {
  std::ifstream file(path);
  std::string line;
  if (!file || !std::getline(file, line) || line.starts_with(begin)) return;
  throw std::invalid_argument(
      fmt::format("{}: has other data than those of a plot; move it, or give another --plot FILE", path));
}

std::string terminal_commands(const std::string& picture, std::size_t width, std::size_t height) {
  return fmt::format("set terminal {} size {},{}\nset output {}\n",
                     picture.ends_with(".svg") ? "svg enhanced background 'white'" : "pngcairo enhanced", width,
                     height, in_quotes(picture));
}

std::string in_quotes(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("''") : std::string(1, c);
  return result + "'";
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
