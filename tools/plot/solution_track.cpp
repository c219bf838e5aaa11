#include "tools/plot/solution_track.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/navigation/aid_names.hpp"
#include "core/units.hpp"
#include "tools/gnuplot.hpp"
#include "tools/plot/run_plot.hpp"

namespace imud {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
const Vector3 unknown_vector = Vector3::Constant(unknown);

Vector3 vector_of(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }
Quaternion attitude_of(const SolutionRow& row) { return {row.q_LP[0], row.q_LP[1], row.q_LP[2], row.q_LP[3]}; }

// Roll, pitch and heading, deg.
Vector3 angles_of(const Quaternion& q) {
  const Matrix3 m = q.toRotationMatrix();
  return Vector3(std::atan2(m(2, 1), m(2, 2)), std::asin(std::clamp(-m(2, 0), -1.0, 1.0)),
                 std::atan2(m(1, 0), m(0, 0))) /
         units::degree;
}

void add(SolutionTrack& track, std::size_t first, const Vector3& value, const Vector3& truth, const Vector3& error,
         const Vector3& sigma) {
  for (std::size_t i = 0; i < 3; ++i) {
    SolutionTrack::Channel& channel = track.channels[first + i];
    const auto k = static_cast<Eigen::Index>(i);
    channel.value.push_back(value[k]);
    channel.truth.push_back(truth[k]);
    channel.error.push_back(error[k]);
    channel.sigma.push_back(sigma[k]);
  }
}

std::vector<SolutionTrack::Aid> aids_of(std::span<const SolutionRow> rows) {
  std::vector<SolutionTrack::Aid> all;
  for (std::size_t i = 0; i < aid::names.size(); ++i) {
    const unsigned bit = 1U << i;
    SolutionTrack::Aid aid{aid::names[i]};
    bool is_there = false;
    for (const SolutionRow& row : rows) {
      const bool is_used = (row.aids_used & bit) != 0, is_rejected = (row.aids_rejected & bit) != 0;
      aid.use.push_back(is_used ? 1 : is_rejected ? -1 : 0);
      is_there = is_there || is_used || is_rejected;
    }
    if (is_there) all.push_back(std::move(aid));
  }
  return all;
}

}  // namespace

bool SolutionTrack::Channel::is_known() const noexcept {
  return std::ranges::any_of(error, [](double one) { return !std::isnan(one); });
}

SolutionTrack compare_solutions(std::span<const SolutionRow> rows, std::span<const SolutionRow> truth) {
  if (rows.size() != truth.size())
    throw std::runtime_error(
        fmt::format("solutions of {} and of {} samples cannot be compared", rows.size(), truth.size()));
  SolutionTrack track{.channels = {{{"roll", "about_north", "deg"},
                                    {"pitch", "about_east", "deg"},
                                    {"heading", "about_down", "deg"},
                                    {"velocity_north", "velocity_north", "m/s"},
                                    {"velocity_east", "velocity_east", "m/s"},
                                    {"velocity_down", "velocity_down", "m/s"},
                                    {"north", "north", "m"},
                                    {"east", "east", "m"},
                                    {"down", "down", "m"}}}};
  const SolutionRow* origin = nullptr;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const SolutionRow &row = rows[i], &right = truth[i];
    if (origin == nullptr && right.has_place) origin = &right;
    track.time_s.push_back(static_cast<double>(row.time_ns - rows.front().time_ns) / 1e9);
    const Quaternion q = attitude_of(row), true_q = attitude_of(right);
    const auto sigma = [&](std::size_t first) {
      return Vector3(row.sigma[first], row.sigma[first + 1], row.sigma[first + 2]);
    };
    // While the unit reports that it aligns, its attitude is arbitrary.
    constexpr double anything = 3.0;  // rad
    const bool has_attitude = row.sigma[0] < anything;
    const Vector3 turned = log(q * true_q.conjugate()) / units::degree;
    add(track, 0, angles_of(q), angles_of(true_q), has_attitude ? turned : unknown_vector,
        has_attitude ? Vector3(sigma(0) / units::degree) : unknown_vector);
    const bool has_place = row.has_place && right.has_place;
    const Vector3 v = vector_of(row.v_L), true_v = vector_of(right.v_L);
    Vector3 r = unknown_vector, true_r = unknown_vector, off = unknown_vector;
    if (has_place) {
      const Matrix3 at_origin = dcm_EL(origin->latitude, origin->longitude);
      r = at_origin.transpose() * (vector_of(row.r_E) - vector_of(origin->r_E));
      true_r = at_origin.transpose() * (vector_of(right.r_E) - vector_of(origin->r_E));
      off = dcm_EL(right.latitude, right.longitude).transpose() * (vector_of(row.r_E) - vector_of(right.r_E));
    }
    add(track, 3, has_place ? v : unknown_vector, has_place ? true_v : unknown_vector,
        has_place ? Vector3(v - true_v) : unknown_vector, has_place ? sigma(3) : unknown_vector);
    add(track, 6, r, true_r, off, has_place ? sigma(6) : unknown_vector);
    double sum = 0, known = 0;
    for (const SolutionTrack::Channel& channel : track.channels) {
      const double ratio = channel.error.back() / channel.sigma.back();
      if (std::isnan(ratio)) continue;
      sum += ratio * ratio;
      ++known;
    }
    track.normalized_square.push_back(sum / known);  // NaN if none is known
    track.fix_age_s.push_back(has_place ? row.fix_age_s : unknown);
  }
  track.aids = aids_of(rows);
  if (!track.channels[0].is_known())
    throw std::runtime_error(
        "--solution: the unit has not aligned in this run, so that there is no solution to draw");
  return track;
}

std::string track_csv(const SolutionTrack& track) {
  std::string text = "time_s,fix_age_s,normalized_square";
  for (const auto& aid : track.aids) text += fmt::format(",{}", aid.name);
  for (const auto& channel : track.channels)
    text += fmt::format(",{0},{0}_truth,{1}_error,{1}_sigma", channel.name, channel.error_name);
  text += "\n";
  const std::size_t step = (track.samples() + most_rows - 1) / most_rows;
  for (std::size_t i = 0; i < track.samples(); i += step) {
    text += fmt::format("{},{},{}", track.time_s[i], track.fix_age_s[i], track.normalized_square[i]);
    for (const auto& aid : track.aids) text += fmt::format(",{}", aid.use[i]);
    for (const auto& channel : track.channels)
      text += fmt::format(",{},{},{},{}", channel.value[i], channel.truth[i], channel.error[i], channel.sigma[i]);
    text += "\n";
  }
  return text;
}

std::string track_plot_commands(const SolutionTrack& track, const std::string& path, const std::string& picture) {
  constexpr std::size_t first_aid = 4, columns = 4;  // from 1; of a channel
  const std::size_t first_column = first_aid + track.aids.size();
  const std::string data = in_quotes(path) + " every ::1";
  const auto drawn =
      static_cast<std::size_t>(std::ranges::count_if(track.channels, &SolutionTrack::Channel::is_known));
  std::string text = terminal_commands(picture, 1200, 230 * (drawn + 1));
  text +=
      "set datafile separator ','\nset datafile missing 'nan'\nset key above noenhanced samplen 2\nset style fill "
      "transparent solid 0.3 noborder\nset grid\n";
  text += fmt::format("set multiplot layout {},2\n", drawn + 1);
  for (std::size_t i = 0; i < track.channels.size(); ++i) {
    const auto& channel = track.channels[i];
    if (!channel.is_known()) continue;  // an AHRS without a place has no velocity and no position
    const std::size_t value = first_column + columns * i;
    text += fmt::format(
        "set ylabel '{0} in {1}' noenhanced\nplot {2} using 1:{3} with lines linecolor 2 title 'solution', \\\n  {2} "
        "using 1:{4} with lines linecolor 'black' title 'truth'\n",
        channel.name, channel.unit, data, value, value + 1);
    text += fmt::format(
        "set ylabel 'error {0}, {1}' noenhanced\nplot {2} using 1:(-${4}):(${4}) with filledcurves linecolor 1 "
        "title "
        "'1 sigma, as reported', \\\n  {2} using 1:{3} with lines linecolor 2 title 'error'\n",
        channel.error_name, channel.unit, data, value + 2, value + 3);
    if (i == 0) text += "unset key\n";
  }
  text += fmt::format(
      "set xlabel 'time in s'\nset ylabel 'error^2/sigma^2' noenhanced\nset logscale y\nplot {0} "
      "using 1:3 with lines linecolor 3, 1 with lines linecolor 'black'\nunset logscale\nset ylabel 'aids: 1 used, "
      "-1 "
      "rejected' noenhanced\nset yrange [-1.5:1.5]\nset key above noenhanced samplen 2\nplot ",
      data);
  // Lines of several aids do not cover one another.
  for (std::size_t i = 0; i < track.aids.size(); ++i)
    text += fmt::format("{}{} using 1:(0.9*${}+{}) with steps title '{}'", i > 0 ? ", " : "", data, first_aid + i,
                        0.05 * static_cast<double>(i), track.aids[i].name);
  text += track.aids.empty() ? "0 notitle\n" : "\n";
  return text + "unset multiplot\nunset output\n";
}

}  // namespace imud
