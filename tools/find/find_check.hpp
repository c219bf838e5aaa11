// find_check: the option --find-check of imu-decode.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>
#include <vector>

namespace imud {

struct FindOptions {
  std::string capture;  // a port, or a file of bytes; "-" is standard input
  std::string turned;   // the capture of the sensor while it is turned by hand; empty: none
};

// Adds --find-check and --turned to a command line. `options` stays where it is.
void add_find_options(CLI::App& app, FindOptions& options);

// Reads at most `most` bytes of a capture, or as many as arrive in `for_s` seconds. Throws std::invalid_argument if
// the port carries no bytes, PortError if it cannot be opened.
std::vector<std::byte> read_capture(const std::string& capture, double for_s, std::size_t most);

// Prints the beginning of a description of the captured frames on standard output. Returns the exit code: 0, or
// `failed` if no frame was found. `rate_hz` is the rate of the most frequent messages; 0 if it is not known.
// `running` is set when the captures have been opened.
int find_check(const FindOptions& options, double for_s, double rate_hz, bool& running);

}  // namespace imud
