// The command `imud init`: a configuration for a product, a port and a simulator.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/protocol.hpp"

namespace CLI {
class App;
}

namespace imud {

struct InitOptions {
  std::string product;  // a protocol, or a product of one
  std::string port;
  std::string from;                  // choose_truth()
  std::string truth;                 // the port of the truth, or its number; empty: the simulator's own
  std::string place;                 // LATITUDE,LONGITUDE[,HEIGHT]; empty: none
  std::string output = "imud.toml";  // -: standard output
  bool is_forced = false;
};

// Adds the command with its options to the command line.
const CLI::App* add_init_command(CLI::App& app, InitOptions& options);

// Writes the configuration and prints what to do next, to standard error if the output is -, which is standard
// output. Asks if product, port or simulator is missing and standard input and output are a terminal. Returns the
// exit code. Throws OpenError if something is missing or wrong, PortError or ConfigError if `imud check` would refuse
// the configuration; nothing is written then.
int init(InitOptions options);

// Returns the units that a protocol has as values of its setting `model`; empty if the protocol has only one unit.
std::span<const std::string_view> units_of(const Protocol& protocol);

// A product by one of its names.
struct ChosenProduct {
  const Protocol* protocol = nullptr;
  std::string unit;  // a value of the protocol's setting `model`; empty: the default one
};
// Returns the protocol, or the unit of a protocol, of that name, whatever its case. Throws OpenError, which suggests
// the nearest name, if there is none.
ChosenProduct choose_product(const std::string& name);
// Throws OpenError if the port does not suit the protocol: the kind of the port is unknown, or carries other data.
void check_device_port(const Protocol& protocol, const std::string& port);
// Returns the lines of [earth] for a place and a truth. Throws OpenError if `place` is no place.
std::string earth_lines(const std::string& place, bool is_on_earth, bool is_inertial);

}  // namespace imud
