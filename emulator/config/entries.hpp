// The entries of the tables of protocols, truth formats, transports and presets that have a name.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "emulator/config/presets.hpp"
#include "protocols/protocol.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

struct Entries {
  const Protocol* protocol = nullptr;
  const TruthFormat* format = nullptr;
  const Transport* transport = nullptr;
  const Preset* preset = nullptr;
};

// Returns the entries called `name`. If there is none, prints the fault and returns nullopt.
std::optional<Entries> find_entries(const std::string& name);

// Returns the initial value of a setting as JSON. The same text is valid in TOML.
nlohmann::ordered_json initial_value(const Setting& setting);

// Returns "0 to 10", "one of a, b", of a list "any of a, b"; empty if every value is valid.
std::string valid_values(const Setting& setting);
std::string valid_values(const PortOption& option);

}  // namespace imud
