// preset_text: the sensor of a recording as a model for imud.
#pragma once

#include <string>

#include "tools/allan/allan_report.hpp"

namespace imud {

// Returns a preset's file, for the key `model` of imud, whose sensors have the fitted terms of each axis: all terms
// that are seen, in the units of data sheets, with standard errors as comments. The range of the sensors, which a
// recording at rest does not show, is large.
std::string preset_text(const AllanReport& report);

}  // namespace imud
