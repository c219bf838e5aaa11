// Prints CAN frames, one a line, for dbc_test.py: {"dbc": FILE, "frame": "ID#HEX" as candump writes it ("ID##FLAGS"
// for FD), ...}. Frames of native-can have "values", the decoded values of the sample to which the frame belongs.
// Frames of products whose messages are tables have "sample", all measured quantities of the sample that was encoded,
// SI.
#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "core/attitude.hpp"
#include "protocols/measurements/measured_quantities.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

void print(const char* dbc, const Frame& frame, const Sample& sample) {
  std::printf("{\"dbc\": \"%s\", \"frame\": \"%s\", \"values\": {\"time_ns\": %lld, \"counter\": %llu", dbc,
              can_text(frame).c_str(), static_cast<long long>(sample.time.ns),
              static_cast<unsigned long long>(sample.counter));
  const auto vector = [](const char* name, const Vector3& v) {
    for (int i = 0; i < 3; ++i) std::printf(", \"%s_%c\": %.17g", name, "xyz"[i], v[i]);
  };
  vector("gyro", sample.rate);
  vector("accel", sample.specific_force);
  vector("dtheta", sample.delta_angle);
  vector("dvel", sample.delta_velocity);
  std::printf(", \"temperature\": %.17g, \"status\": %u}}\n", sample.temperature_c, sample.status);
}

void dump(bool fd, const char* dbc) {
  const Protocol& protocol = protocol_named("native-can");
  Settings settings(protocol.settings);
  settings.set("fd", fd);
  Line line(protocol, settings);
  std::mt19937_64 random(3);
  std::vector<Sample> samples = random_samples(200, protocol, random);
  samples[1].rate = Vector3::Constant(-1e9);  // the ends of the ranges
  samples[1].delta_angle = Vector3::Constant(1e9);
  samples[1].temperature_c = -1e9;
  for (const Sample& sample : samples) {
    const std::span<const Frame> frames = line.encode(sample);
    Recording recording;
    for (const Frame& frame : frames) line.decoder->feed(frame, recording);
    for (const Frame& frame : frames) print(dbc, frame, recording.measurements.at(0).sample);
  }
}

// A sample of a vehicle on the Earth, all of whose numbers are in the range of most products.
Sample random_flight(std::uint64_t k, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&](double range) {
    return Vector3(range * uniform(random), range * uniform(random), range * uniform(random));
  };
  Sample sample;
  sample.time.ns = static_cast<std::int64_t>(k) * 10'000'000 + 1'000'000'000;
  sample.counter = k;
  sample.rate = vector(2.8);
  sample.specific_force = vector(40);
  sample.delta_angle = vector(0.02);
  sample.delta_velocity = vector(0.5);
  sample.temperature_c = 40 * uniform(random);
  sample.q_LP = exp(vector(3));
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = 1'420'000'000'000'000'000 + static_cast<std::int64_t>(1e15 * uniform(random));
  sample.navigation.latitude = 1.5 * uniform(random);
  sample.navigation.longitude = 3 * uniform(random);
  sample.navigation.height = 9000 * uniform(random);
  sample.navigation.v_L = vector(100);
  sample.navigation.satellites = static_cast<std::uint8_t>(4 + k % 30);
  sample.navigation.accuracy_factor = 1 + 0.25F * static_cast<float>(k % 8);
  sample.magnetic_field = vector(60e-6);
  sample.pressure = 80e3 + 20e3 * uniform(random);
  sample.status = static_cast<std::uint32_t>(random()) & 0x3FU;
  if (k % 3 != 0)
    sample.navigation.antennas = {.direction_L = sample.q_LP * Vector3::UnitX(),
                                  .sigma = 0.001 * static_cast<double>(k % 7 + 1)};
  return sample;
}

// Gives a sample the solution of a unit's own filter: aligning, coasting, aided or levelled, by `k`.
void solve(Sample& sample, std::uint64_t k, std::mt19937_64& random) {
  const auto some = [&](double most) {
    std::uniform_real_distribution<float> uniform(0, static_cast<float>(most));
    return Eigen::Vector3f(uniform(random), uniform(random), uniform(random));
  };
  Solution& solution = sample.solution.emplace();
  solution.state = static_cast<Solution::State>(k % 4);
  solution.since_fix_s = some(6).x();
  solution.attitude = some(0.02);
  solution.velocity = some(2);
  solution.position = some(12);
  constexpr unsigned all_aids[] = {aid::position | aid::velocity, aid::magnetic_heading, aid::antennas_heading,
                                   aid::pressure};
  for (const unsigned aids : all_aids)
    if (random() % 2 == 0) solution.used = static_cast<std::uint16_t>(solution.used | aids);
  if (random() % 2 == 0) sample.magnetic_field.setZero();
  if (k % 8 < 5) {
    solution.receiver = sample.navigation;
    solution.receiver.latitude += 0.01;
    solution.receiver.longitude -= 0.02;
    solution.receiver.height += 30;
    solution.receiver.v_L += Vector3(4, -5, 6);
  }
  const bool has_place = solution.state == Solution::State::coasting || solution.state == Solution::State::aided;
  if (!has_place) sample.navigation = {};
}

void go_beyond_all_ranges(Sample& sample) {
  for (Vector3* const vector :
       {&sample.rate, &sample.specific_force, &sample.delta_velocity, &sample.magnetic_field, &sample.navigation.v_L})
    *vector *= 1e9;
  for (double* const number : {&sample.temperature_c, &sample.navigation.height}) *number *= 1e9;
  sample.pressure *= sample.counter % 2 == 0 ? 1e9 : -1e9;
}

void dump_tables(const char* name, const char* settings_text, const char* dbc) {
  const Protocol& protocol = protocol_named(name);
  Line line(protocol, settings_of(protocol, settings_text));
  std::mt19937_64 random(4);
  OwnFigures figures;
  figures.position = {1.5, 2.5, 300};
  figures.velocity = {0.02, 0.3, 4};
  line.device->set_figures(figures);
  for (std::uint64_t k = 0; k < 150; ++k) {
    Sample sample = random_flight(k, random);
    if (k >= 100 && k < 110) go_beyond_all_ranges(sample);
    if (k >= 110) solve(sample, k, random);
    const Reading reading{
        sample, sample.delta_angle, sample.delta_velocity, exp(sample.delta_angle), k == 0 ? 0 : 0.01, &figures};
    std::string values;
    for (const MeasuredQuantity& quantity : measured_quantities()) {
      if (quantity.kind != MeasuredQuantity::Kind::number) continue;
      char text[80];
      std::snprintf(text, sizeof text, "\"%.40s\": %.17g, ", std::string(quantity.name).c_str(),
                    quantity.get(reading));
      values += text;
    }
    for (const Frame& frame : line.encode(sample))
      std::printf(
          "{\"dbc\": \"%s\", \"frame\": \"%s\", \"sample\": {%s\"time_ns\": %lld, \"counter\": %llu, \"status\": "
          "%u}}\n",
          dbc, can_text(frame).c_str(), values.c_str(), static_cast<long long>(sample.time.ns),
          static_cast<unsigned long long>(sample.counter), sample.status);
  }
}

}  // namespace
}  // namespace imud

int main() {
  imud::dump(false, "native_can.dbc");
  imud::dump(true, "native_can_fd.dbc");
  imud::dump_tables(
      "sbg-can",
      "output_rate_hz=100 "
      "messages=status_01,status_02,status_03,utc_0,utc_1,imu_info,imu_accel,imu_gyro,imu_delta_vel,imu_delta_angle,"
      "ekf_info,ekf_quat,ekf_euler,ekf_orientation_acc,ekf_pos,ekf_altitude,ekf_pos_acc,ekf_vel_ned,ekf_vel_ned_acc,"
      "ekf_vel_body,mag_0,mag_1,air_data_info,air_data_altitude,gps1_vel_info,gps1_vel,gps1_vel_acc,gps1_course,"
      "gps1_pos_info,gps1_pos,gps1_pos_alt,gps1_pos_acc,gps1_hdt_info,gps1_hdt",
      "sbg_can.dbc");
  imud::dump_tables("bosch-mm7", "", "bosch_mm7.dbc");
  imud::dump_tables("bosch-mm5", "", "bosch_mm5.dbc");
  imud::dump_tables(
      "xsens-can",
      "messages=sample_time,group_counter,utc,status_word,quaternion,euler,delta_v,rate_of_turn,delta_q,"
      "acceleration,free_acceleration,magnetic_field,temperature,pressure,rate_of_turn_hr,"
      "acceleration_hr,position,altitude,velocity",
      "xsens_can.dbc");
}
