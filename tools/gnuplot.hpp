// Pictures by gnuplot, with their data beside them.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace imud {

// Throws std::invalid_argument if `path` ends neither in .svg nor in .png, and std::runtime_error, which names
// Debian's package, if there is no gnuplot.
void check_plot(const std::string& path);

// Returns the path of the data beside the picture: FILE.plot.csv for FILE.svg.
std::string data_path_beside(const std::string& picture);

// Throws std::invalid_argument if there is a file of that name whose first line does not begin with `begin`: another
// program or a person has written it. Call it before anything is computed.
void check_data_path(const std::string& path, std::string_view begin);

// Returns the commands that direct the output to `picture`, of a size in pixels.
std::string terminal_commands(const std::string& picture, std::size_t width, std::size_t height);

// Returns the text in gnuplot's single quotes, in which only the quote itself is special.
std::string in_quotes(const std::string& text);

// Executes the commands. Throws std::runtime_error if gnuplot fails.
void run_gnuplot(const std::string& commands);

}  // namespace imud
