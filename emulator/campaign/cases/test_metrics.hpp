// Reads the metrics that the system under test has written.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace imud {

// Returns the JSON object in a text; null, with the place of the fault and the remedy in `fault`, if there is none:
// "line 2, column 14: `NaN` is no value of JSON; write null, or leave it out". Lines and columns begin with 1; a
// column is a byte.
nlohmann::ordered_json read_metrics(const std::string& text, std::string& fault);

}  // namespace imud
