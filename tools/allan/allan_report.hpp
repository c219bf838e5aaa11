// AllanReport: the results of imu-allan, as text, JSON and CSV.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/requirement.hpp"
#include "tools/allan/allan_comparison.hpp"
#include "tools/allan/allan_curve.hpp"
#include "tools/allan/allan_fit.hpp"
#include "tools/allan/model_terms.hpp"
#include "tools/allan/still_recording.hpp"

namespace imud {

// A term in SI and in the unit of data sheets.
struct TermUnit {
  std::string_view name;       // "angle random walk"
  std::string_view si;         // "rad/sqrt(s)"
  std::string_view datasheet;  // "deg/sqrt(h)"
  std::string_view key;        // with the unit, as in configurations: "angle_random_walk_deg_per_rt_hr"
  double factor = 1;           // value in `datasheet` = factor * value in `si`
};
// In the order of allan_term_list.
const std::array<TermUnit, allan_term_count>& term_units(bool is_rate) noexcept;
// The deviation itself: deg/h, or mg.
const TermUnit& deviation_unit(bool is_rate) noexcept;

struct AllanReport {
  struct Axis {
    std::size_t number = 0;  // index in channel_names
    AllanCurve curve;
    AllanFit fit;
    bool is_increment = false;  // see StillRecording::Channel
    bool is_rate() const noexcept { return number < channels_per_sensor; }
    std::string_view name() const noexcept { return channel_names[number]; }
    const AllanCurve::Point& lowest() const noexcept;  // point of the curve, which is not empty
  };

  std::string protocol, port, ended_by;  // as on the command line
  StillRecording recording;              // its channels' values may have been removed
  std::size_t samples = 0;
  double confidence = 0;
  std::vector<Axis> axes;  // with the same averaging times
  std::vector<Requirement> required;
  std::optional<ModelTerms> against;
  double tolerance = 0;  // relative, of the comparison with `against`; 1: 100 %

  // Returns the value of a figure that `--require` may limit: "gyro_x.N" in SI,
  // "gyro_x.angle_random_walk_deg_per_rt_hr", or for the largest of the three axes "gyro.N". The value of a term
  // that was not detected is 0; for an upper limit, it is the least value that would have been detected. Throws
  // std::invalid_argument for another figure. Returns nullopt if there is no such axis.
  std::optional<double> seen(const Requirement& requirement) const;
  bool holds(const Requirement& requirement) const;
  bool keeps_all_limits() const;
  // Return the comparison of an axis with `against`, which is required, and whether every axis agrees; true
  // without a model.
  std::array<TermVerdict, allan_term_count> verdicts(const Axis& axis) const;
  bool agrees_with_model() const;
  // Returns the deviation of the model `against`.
  double model_deviation(const Axis& axis, const AllanCurve::Point& point) const;

  // Returns a table with a line for each term of each axis.
  std::string text() const;
  std::string json() const;
  // Returns a header and a row for each averaging time: tau_s, then for each axis the deviation, its bounds, the
  // deviation of the fitted terms, and, if there is a model, the model's deviation, in SI.
  std::string csv() const;
  std::size_t csv_columns_per_axis() const noexcept { return against ? 5 : 4; }

 private:
  std::string comparison_text() const;
};

}  // namespace imud
