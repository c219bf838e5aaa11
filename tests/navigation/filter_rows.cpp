// filter_rows < IN > OUT: runs an InertialFilter by increments and aids, and writes its estimates. All numbers are
// doubles of the machine, SI, in the frames of inertial_filter.hpp; quaternions are w, x, y, z. Exits with 2 where
// IN is not whole.
//
// IN: gravitation (GravitationModel::Kind), the four of InertialNoise, dt, runs, steps, steps between aids, steps
// between epochs, rows of the attitude's aid (0, 1: the azimuth of the x axis about N's z axis, 3), standard
// deviations of the aids (3 position, 3 velocity, 1 attitude, 1 height along N's -z, 0: there is none); of the aids'
// errors the first variance, rate and growth (AidError), of 3 of position, 3 of velocity, 1 of height; the
// standard deviations of the scale factors of gyros and accelerometers (0: they are not estimated); then each run:
// its first q_NP, v_N, r_N, gyro and accelerometer bias, 15 standard deviations; each step: delta-angle (rotation
// vector), delta-velocity (integral), and at an aid position, velocity, q_NP, height.
//
// OUT: at each aid, before it: estimates, the innovations, less the aids' errors, in the order of the aids as rows of
// 12, and the four normalised squares; after the last step of each epoch, and after its aid: estimates. Estimates are
// the state, the added states (InertialFilter::Added), and the covariances of the states (15 x 15), of the states
// with the added ones (13 columns of 15), and of the added ones (13 x 13).
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "core/attitude.hpp"
#include "core/navigation/azimuth.hpp"
#include "core/navigation/inertial_filter.hpp"

namespace {

using namespace imud;
using Filter = InertialFilter;

template <std::size_t N>
std::array<double, N> read() {
  std::array<double, N> numbers;
  if (std::fread(numbers.data(), sizeof(double), N, stdin) != N) std::exit(2);
  return numbers;
}
Vector3 read_vector() {
  const auto [x, y, z] = read<3>();
  return {x, y, z};
}
Quaternion read_quaternion() {
  const auto [w, x, y, z] = read<4>();
  return {w, x, y, z};
}

void write(const double* numbers, std::size_t count) {
  if (std::fwrite(numbers, sizeof(double), count, stdout) != count) std::exit(1);
}
void write(const Vector3& v) { write(v.data(), 3); }
void write(const Filter& filter) {
  const InertialState& motion = filter.motion();
  const std::array<double, 4> q = {motion.q_NP.w(), motion.q_NP.x(), motion.q_NP.y(), motion.q_NP.z()};
  write(q.data(), 4);
  write(motion.v_N);
  write(motion.r_N);
  write(filter.gyro_bias_P());
  write(filter.accelerometer_bias_P());
  write(filter.added().estimates.data(), Filter::most_added);
  write(filter.covariance().data(), Filter::states * Filter::states);
  write(filter.added().cross_covariance.data(), Filter::states * Filter::most_added);
  write(filter.added().covariance.data(), Filter::most_added * Filter::most_added);
}

struct Settings {
  GravitationModel gravitation;
  InertialNoise noise;
  double dt = 0;
  std::uint64_t runs = 0, steps = 0, steps_of_aid = 0, steps_of_epoch = 0;
  int attitude_rows = 0;
  Vector3 position, velocity;  // standard deviations
  double attitude = 0, height = 0;
  std::vector<Filter::AidError> errors;  // none where all are 0
  Filter::ScaleSigmas scale;
  int error_of(int first) const { return errors.empty() ? -1 : first; }
};

Settings read_settings() {
  Settings settings;
  settings.gravitation.kind = static_cast<GravitationModel::Kind>(read<1>()[0]);
  const auto [gyro, accelerometer, gyro_walk, accelerometer_walk] = read<4>();
  settings.noise = {gyro, accelerometer, gyro_walk, accelerometer_walk};
  const auto [dt, runs, steps, steps_of_aid, steps_of_epoch, rows] = read<6>();
  settings.dt = dt;
  settings.runs = static_cast<std::uint64_t>(runs);
  settings.steps = static_cast<std::uint64_t>(steps);
  settings.steps_of_aid = static_cast<std::uint64_t>(steps_of_aid);
  settings.steps_of_epoch = static_cast<std::uint64_t>(steps_of_epoch);
  settings.attitude_rows = static_cast<int>(rows);
  settings.position = read_vector();
  settings.velocity = read_vector();
  settings.attitude = read<1>()[0];
  settings.height = read<1>()[0];
  bool has_errors = false;
  for (int i = 0; i < Filter::most_aid_errors; ++i) {
    const auto [variance, rate, growth] = read<3>();
    settings.errors.push_back({variance, rate, growth});
    has_errors = has_errors || variance > 0 || growth > 0;
  }
  if (!has_errors) settings.errors.clear();
  const auto [gyro_scale, accelerometer_scale] = read<2>();
  settings.scale = {gyro_scale, accelerometer_scale};
  return settings;
}

void begin(Filter& filter) {
  const Quaternion q_NP = read_quaternion();
  const Vector3 v_N = read_vector(), r_N = read_vector(), gyro = read_vector(), accelerometer = read_vector();
  const auto sigmas = read<Filter::states>();
  const Filter::State sigma = Eigen::Map<const Filter::State>(sigmas.data());
  filter.begin({q_NP, v_N, r_N}, gyro, accelerometer, sigma.cwiseProduct(sigma).asDiagonal());
}

void take_aid(Filter& filter, const Settings& settings) {
  const Vector3 r_N = read_vector(), v_N = read_vector();
  const Quaternion q_NP = read_quaternion();
  const double height = read<1>()[0];
  filter.propagate();
  write(filter);
  const auto update = [&](const Filter::Measurement& measurement) {
    Vector3 innovation = measurement.innovation;
    if (measurement.error >= 0)
      innovation.head(measurement.rows) -= filter.added().estimates.segment(measurement.error, measurement.rows);
    write(innovation);
    const double square = measurement.rows > 0 ? filter.normalized_square(measurement) : 0;
    if (measurement.rows > 0) filter.update(measurement);
    return square;
  };
  const auto squared = [](const Vector3& sigma) { return Vector3(sigma.cwiseProduct(sigma)); };
  std::array<double, 4> squares;
  squares[0] = update({.first = Filter::position,
                       .innovation = r_N - filter.motion().r_N,
                       .variance = squared(settings.position),
                       .error = settings.error_of(0)});
  squares[1] = update({.first = Filter::velocity,
                       .innovation = v_N - filter.motion().v_N,
                       .variance = squared(settings.velocity),
                       .error = settings.error_of(3)});
  Filter::Measurement attitude = {.first = Filter::phi,
                                  .rows = settings.attitude_rows,
                                  .innovation = log(q_NP * filter.motion().q_NP.conjugate()),
                                  .variance = squared(Vector3::Constant(settings.attitude))};
  if (settings.attitude_rows == 1)
    attitude = azimuth_measurement(q_NP * Vector3::UnitX(), filter.motion().q_NP * Vector3::UnitX(),
                                   Quaternion::Identity(), settings.attitude);
  squares[2] = update(attitude);
  Filter::Measurement up = {.first = Filter::position, .rows = settings.height > 0 ? 1 : 0};
  up.axes_N.row(0) = -Vector3::UnitZ().transpose();
  up.innovation = {height + filter.motion().r_N.z(), 0, 0};
  up.variance = squared(Vector3::Constant(settings.height));
  up.error = settings.error_of(6);
  squares[3] = update(up);
  write(squares.data(), squares.size());
}

}  // namespace

int main() {
  const Settings settings = read_settings();
  for (std::uint64_t run = 0; run < settings.runs; ++run) {
    Filter filter(settings.gravitation, {}, settings.noise, settings.errors);
    filter.estimate_scale_factors(settings.scale);
    begin(filter);
    for (std::uint64_t k = 1; k <= settings.steps; ++k) {
      const Vector3 delta_angle = read_vector(), delta_velocity = read_vector();
      filter.advance(delta_angle, delta_velocity, settings.dt);
      if (k % settings.steps_of_aid == 0) take_aid(filter, settings);
      if (k % settings.steps_of_epoch != 0) continue;
      filter.propagate();
      write(filter);
    }
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}
