// ModelTerms: the noise that imud gives the sensors of a model.
#pragma once

#include <array>
#include <string>

#include "core/allan_terms.hpp"
#include "tools/allan/still_recording.hpp"

namespace imud {

struct ModelTerms {
  std::string model;                                          // as given
  std::array<AllanTerms, channel_names.size()> of;            // in the order of channel_names; in SI
  std::array<double, channel_names.size()> flicker_from_s{};  // averaging time at which B begins
};

// Returns the terms of a preset, or of a TOML file of a user, in a sensor of this rate, as imud reads them. Throws
// std::invalid_argument if there is no such model or it has a fault.
ModelTerms model_terms(const std::string& model, double rate_hz);

}  // namespace imud
