// run_plot: the picture of an emulated run, and its data.
#pragma once

#include <string>

#include "tools/plot/run_errors.hpp"

namespace imud {

// Return the data as CSV with a header, in SI: time_s and, for each channel, the measured value, the truth, the error
// and the mean and standard deviation of the error, of at most `most_rows` samples at equal distances; and
// frequency_hz with the roots of the error's density.
std::string samples_csv(const RunErrors& run);
std::string spectrum_csv(const RunErrors& run);
inline constexpr std::size_t most_rows = 4000;

// Returns gnuplot's commands that draw these data, in the files at the two paths, to the file `picture`: a row for
// each channel, with the truth over the measurement, the error with its one-sigma envelope, and the error's
// spectrum.
std::string run_plot_commands(const RunErrors& run, const std::string& samples_path, const std::string& spectrum_path,
                              const std::string& picture);

}  // namespace imud
