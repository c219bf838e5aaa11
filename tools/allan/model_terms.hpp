// ModelTerms: the noise that imud gives the sensors of a model, and the Allan curve that a recording of such
// sensors has.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "tools/allan/allan_term_list.hpp"
#include "tools/allan/still_recording.hpp"

namespace imud {

// The noise of one channel beside B, K and R: N and Q behind the filter of the sensor, and the rounding to its
// LSB. The rounding is modelled as white noise of LSB/sqrt(12), which is right where the noise of a sample is
// above half an LSB. A filter of the values does not act on increments.
struct SampleNoise {
  // u^2: the autocovariance of the values at multiples of the sample period, and of the mean rates at multiples of
  // the period of the sensor's own samples.
  std::vector<double> of_values, of_rates;
  std::size_t decimation = 1;  // the sensor's own samples in one of the recording

  // Returns the variance of the kind over `factor` samples of the recording; for the total variance, returns the
  // Allan variance.
  double variance(AllanKind kind, std::size_t factor, bool is_increment) const noexcept;
};

struct ModelTerms {
  std::string model;                                          // as given
  std::array<AllanTerms, channel_names.size()> of;            // in the order of channel_names; in SI
  std::array<double, channel_names.size()> flicker_from_s{};  // averaging time at which B begins
  std::array<SampleNoise, channel_names.size()> noise;        // empty: not known, see model_terms()

  // Returns the deviation that a recording of the channel has, computed from the terms of the channel, and from
  // `noise` where `noise` is known.
  double deviation(AllanKind kind, std::size_t channel, const AveragingTime& time, bool is_increment) const;
};

// Returns the terms of a preset, or of a TOML file of a user, in a sensor of this rate, as imud reads them. With a
// `source`, also returns the noise of the samples that the sensor sends at this rate: a product's noise, with the
// product's own filters and digits. Throws std::invalid_argument if there is no such model or the model has a
// fault.
ModelTerms model_terms(const std::string& model, double rate_hz, const DecodeOptions* source = nullptr);

}  // namespace imud
