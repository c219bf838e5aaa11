// Reads the metrics that the system under test has written.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace imud {

// Returns the JSON object in a text. If the text has none, returns null and sets `fault` to the place of the fault
// with the remedy: "line 2, column 14: `NaN` is no value of JSON; write null, or leave it out". Lines and columns
// count from 1; a column is a byte.
nlohmann::ordered_json read_metrics(const std::string& text, std::string& fault);

}  // namespace imud
