// The error of the time stamps that a product reports, apart from the instants of its samples.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/numbers/random.hpp"
#include "core/vector.hpp"

namespace imud {

// A stamp is the time of the sample's instant + offset + jitter n, n ~ N(0, 1), rounded to ns. The default of every
// member switches its part off.
struct StampErrorModel {
  double offset_s = 0;  // within +-1
  double jitter_s = 0;  // standard deviation, 0 to 0.1
};

// Nothing here allocates or throws.
class StampError {
 public:
  explicit StampError(const StampErrorModel& model) noexcept : model_(model) {}
  bool is_on() const noexcept { return model_.offset_s != 0 || model_.jitter_s > 0; }
  // Returns the error of the stamp of sample `k`, ns, for Sample::stamp_error_ns.
  std::int32_t at(const Normals& normals, std::uint64_t k) const noexcept {
    double error_s = model_.offset_s;
    if (model_.jitter_s > 0) error_s += model_.jitter_s * normals(Quantity::rate, Process::stamp_jitter, k)[0];
    return static_cast<std::int32_t>(std::lround(1e9 * error_s));
  }

 private:
  StampErrorModel model_;
};

}  // namespace imud
