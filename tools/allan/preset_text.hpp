// preset_text: the sensor of a recording as a model for imud.
#pragma once

#include <string>

#include "tools/allan/allan_report.hpp"

namespace imud {

// Returns the text of a preset file for imud's key `model`. Its sensors have the fitted terms of each axis that are
// seen, in the units of data sheets, with standard errors as comments. Their range is large, because a recording at
// rest does not show it.
std::string preset_text(const AllanReport& report);

}  // namespace imud
