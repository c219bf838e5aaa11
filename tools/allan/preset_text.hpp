// preset_text: the sensor of a recording as a model for imud.
#pragma once

#include <string>

#include "tools/allan/allan_report.hpp"

namespace imud {

// Returns the text of a preset file for imud's key `model`. The preset's sensors have, for each axis, the fitted
// terms that were detected, in the units of data sheets, with standard errors as comments. The sensors' range is
// large, because a recording at rest does not show the range.
std::string preset_text(const AllanReport& report);

}  // namespace imud
