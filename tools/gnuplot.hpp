// Pictures by gnuplot, with their data beside them.
#pragma once

#include <cstddef>
#include <string>

namespace imud {

// Throws std::invalid_argument if `path` ends neither in .svg nor in .png, and std::runtime_error, which names
// Debian's package, if there is no gnuplot.
void check_plot(const std::string& path);

// Returns the path with the ending .csv: of the data beside the picture.
std::string data_path_beside(const std::string& picture);

// Returns the commands that direct the output to `picture`, of a size in pixels.
std::string terminal_commands(const std::string& picture, std::size_t width, std::size_t height);

// Returns the text in gnuplot's single quotes, in which nothing is special but the quote.
std::string quoted(const std::string& text);

// Executes the commands. Throws std::runtime_error if gnuplot fails.
void run_gnuplot(const std::string& commands);

}  // namespace imud
