#include "emulator/plan/line_load.hpp"

#include <fmt/format.h>

#include "emulator/ground/plural.hpp"

namespace imud {
namespace {

// Returns "45.1 %", or "45.1 % on average and 52.0 % at most".
std::string share_text(double average_percent, double percent) {
  return average_percent < percent ? fmt::format("{:.1f} % on average and {:.1f} % at most", average_percent, percent)
                                   : fmt::format("{:.1f} %", percent);
}

}  // namespace

std::string LineLoad::text() const {
  std::string line = frames_per_sample == 0 ? fmt::format("{:.0f} frames/s", frames_per_s)
                                            : fmt::format("{} of {} bytes together per sample",
                                                          plural(frames_per_sample, "frame"), bytes_per_sample);
  const bool varies = average_bits_per_s < bits_per_s;
  line += varies ? fmt::format(", {:.0f} bit/s on average and {:.0f} at most", average_bits_per_s, bits_per_s)
                 : fmt::format(", {:.0f} bit/s", bits_per_s);
  if (line_bits_per_s > 0.0)
    line += fmt::format(", {} of the line's {:.0f} bit/s", share_text(average_percent, percent), line_bits_per_s);
  return line;
}

std::string BusLoad::text() const {
  return fmt::format("{} of {:.0f} bit/s", share_text(average_percent, percent), line_bits_per_s);
}

}  // namespace imud
