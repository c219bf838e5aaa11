// Reads the keys of a sensor's surroundings: vibration, temperature, instants, clock.
#include <algorithm>
#include <utility>

#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"

namespace imud {
namespace {

constexpr double g = units::standard_gravity, deg = units::degree;
constexpr double least_hz = 1e-3, most_hz = 1e6;

// Returns true if the list has one value for each of `count` frequencies. Adds a fault of `key` if it has another
// number of values. An empty list counts as absent.
template <class List>
bool fits(TableReader& table, std::string_view key, const List& list, std::string_view of, std::size_t count) {
  if (list.empty() || list.size() == count) return !list.empty();
  table.fault(key, fmt::format("has {} elements; give one for each of the {} of {}", list.size(), count, of));
  return false;
}

bool ascends(const std::vector<double>& list) {
  return std::adjacent_find(list.begin(), list.end(), [](double a, double b) { return a >= b; }) == list.end();
}

// Reads the waves whose frequencies or orders are `of_key`. The keys of their amplitudes and phases begin with
// `stem`.
template <class Wave>
std::vector<Wave> read_waves(TableReader& table, std::string_view of_key, double min, double max,
                             std::string_view stem) {
  const std::string force_key = fmt::format("{}_g", stem), rate_key = fmt::format("{}_deg_per_s", stem),
                    phase_key = fmt::format("{}_phase_deg", stem);
  const std::vector<double> of = table.numbers(of_key, min, max);
  const std::vector<Vector3> force = rows(table, force_key), rate = rows(table, rate_key);
  const std::vector<double> phase = table.numbers(phase_key, -360, 360);
  const bool has_force = fits(table, force_key, force, of_key, of.size());
  const bool has_rate = fits(table, rate_key, rate, of_key, of.size());
  const bool has_phase = fits(table, phase_key, phase, of_key, of.size());
  if (!of.empty() && force.empty() && rate.empty())
    table.fault(of_key, fmt::format("has no amplitudes; give {} or {}", force_key, rate_key));
  std::vector<Wave> waves;
  for (std::size_t i = 0; i < of.size(); ++i) {
    Wave& wave = waves.emplace_back(Wave{of[i]});
    if (has_force) wave.force = g * force[i];
    if (has_rate) wave.rate = deg * rate[i];
    if (has_phase) wave.phase = deg * phase[i];
  }
  return waves;
}

void read_spectrum(TableReader& table, VibrationModel::Spectrum& spectrum) {
  constexpr double least = 1e-30, most = 1e9;
  spectrum.frequency_hz = table.numbers("random_hz", least_hz, most_hz);
  spectrum.force = table.numbers("random_g2_per_hz", least, most);
  spectrum.rate = table.numbers("random_deg2_per_s2_per_hz", least, most);
  spectrum.axes = table.per_axis("random_axes", spectrum.axes, 0, 1e6);
  spectrum.lines = table.unsigned_integer("random_lines", spectrum.lines, 4096);
  const std::size_t count = spectrum.frequency_hz.size();
  if (count == 1 || !ascends(spectrum.frequency_hz))
    table.fault("random_hz", "give at least two frequencies, in ascending order");
  if (count > 0 && spectrum.force.empty() && spectrum.rate.empty())
    table.fault("random_hz", "has no densities; give random_g2_per_hz or random_deg2_per_s2_per_hz");
  if (!fits(table, "random_g2_per_hz", spectrum.force, "random_hz", count)) spectrum.force.clear();
  if (!fits(table, "random_deg2_per_s2_per_hz", spectrum.rate, "random_hz", count)) spectrum.rate.clear();
  for (double& density : spectrum.force) density *= g * g;
  for (double& density : spectrum.rate) density *= deg * deg;
}

// The truth's state that the amplitude follows, and the unit of the points.
struct Follows {
  std::optional<VehicleState> state;
  double unit;
};

void read_envelope(TableReader& table, VibrationModel::Envelope& envelope) {
  constexpr double rpm = 2 * units::pi / 60;
  constexpr std::string_view words[] = {"none",     "time_s",           "rotor_speed_rpm",
                                        "throttle", "airspeed_m_per_s", "dynamic_pressure_pa"};
  constexpr Follows kinds[] = {
      {std::nullopt, 1},           {std::nullopt, 1},           {VehicleState::rotor_speed, rpm},
      {VehicleState::throttle, 1}, {VehicleState::airspeed, 1}, {VehicleState::dynamic_pressure, 1}};
  const std::size_t kind = table.choice("follows", words, 0);
  envelope.at = table.numbers("follows_at", -1e9, 1e9);
  envelope.factor = table.numbers("follows_factor", 0, 1e6);
  envelope.of = kinds[kind].state;
  const bool has_points = fits(table, "follows_factor", envelope.factor, "follows_at", envelope.at.size());
  if (!ascends(envelope.at)) table.fault("follows_at", "give numbers in ascending order");
  if (kind > 0 && !has_points)
    table.fault("follows", "has no curve; give follows_at, and as many factors in follows_factor");
  if (kind == 0 && !envelope.at.empty())
    table.fault("follows_at", fmt::format("belongs to a quantity; give follows = \"{}\"", words[2]));
  for (double& at : envelope.at) at *= kinds[kind].unit;
}

}  // namespace

VibrationModel read_vibration(TableReader table) {
  VibrationModel model;
  model.sines = read_waves<VibrationModel::Sine>(table, "sine_hz", least_hz, most_hz, "sine");
  read_spectrum(table, model.spectrum);
  model.harmonics = read_waves<VibrationModel::Harmonic>(table, "harmonic", 1e-3, 1e3, "harmonic");
  read_envelope(table, model.envelope);
  table.finish();
  return model;
}

void read_instants(TableReader& table, ImuConfig& imu) {
  constexpr double largest = 0.9;  // share of the period, so that samples stay in order with any clock error
  const double jitter_us = table.real("sampling_jitter_us", 0, 0, 1e9);
  const double most_us = largest * 1e6 * seconds(imu.grid.period());
  imu.model.sampling_jitter = nanoseconds(1e-6 * jitter_us);
  imu.model.sampling_delay = nanoseconds(1e-6 * table.real("sampling_delay_us", 0, 0, 1e5));
  if (jitter_us > most_us)
    table.fault("sampling_jitter_us", fmt::format("give at most {:.6g}, nine tenths of the sample period", most_us));
  constexpr double largest_stamp = 0.05;  // of the period: stamps stay in order, as the largest deviates are 8.3
  const double most_stamp_us = std::min(1e5, largest_stamp * 1e6 / imu.rate_hz);
  StampErrorModel& stamp = imu.model.stamp_error;
  stamp.offset_s = 1e-6 * table.real("stamp_offset_us", 0, -1e6, 1e6);
  stamp.jitter_s = 1e-6 * table.real("stamp_jitter_us", 0, 0, 1e5);
  if (stamp.jitter_s > 1e-6 * most_stamp_us)
    table.fault("stamp_jitter_us",
                fmt::format("give at most {:.6g}, a twentieth of the sample period", most_stamp_us));
  if (imu.protocol == nullptr || (stamp.offset_s == 0 && stamp.jitter_s == 0) || carries_stamp(imu)) return;
  for (const auto& [key, value] :
       {std::pair{"stamp_offset_us", stamp.offset_s}, std::pair{"stamp_jitter_us", stamp.jitter_s}})
    if (value != 0)
      table.warn(key, fmt::format("has no effect: {} sends no time with these settings; sampling_delay_us makes its "
                                  "samples late",
                                  imu.protocol->name));
}

OscillatorModel read_oscillator(TableReader table) {
  constexpr double ppm = 1e-6, ns = 1e-9, rt_hr = 60;
  OscillatorModel model;
  model.phase_random_walk = ns * table.real("phase_random_walk_ns_per_rt_s", 0, 0, 1e5);
  model.frequency_random_walk = ppm / rt_hr * table.real("frequency_random_walk_ppm_per_rt_hr", 0, 0, 1e4);
  model.temperature_linear = ppm * table.real("temperature_ppm_per_c", 0, -1000, 1000);
  model.temperature_quadratic = ppm * table.real("temperature_ppm_per_c2", 0, -1000, 1000);
  model.reference_c = table.real("reference_temperature_c", model.reference_c, -273.15, 1e4);
  table.finish();
  return model;
}

TemperatureModel read_temperature(TableReader table) {
  constexpr double least = -273.15, most = 1e4;
  TemperatureModel model;
  model.profile_s = table.numbers("profile_s", 0, 1e9);
  model.profile_c = table.numbers("profile_c", least, most);
  if (!ascends(model.profile_s)) table.fault("profile_s", "give times in ascending order");
  const std::size_t count = model.profile_s.size();
  if (!fits(table, "profile_c", model.profile_c, "profile_s", count) && count > 0 && model.profile_c.empty())
    table.fault("profile_s", "has no temperatures; give profile_c");
  model.from_truth = table.flag("from_truth", model.from_truth);
  model.warm_up_c = table.real("warm_up_c", model.warm_up_c, -1000, 1000);
  model.warm_up_s = table.real("warm_up_s", model.warm_up_s, 1e-3, 1e9);
  model.cool_down_s = table.real("cool_down_s", model.cool_down_s, 0, 1e9);
  model.offset_c = table.real("offset_c", model.offset_c, -1000, 1000);
  model.lsb_c = table.real("lsb_c", model.lsb_c, 0, 1000);
  model.rate_hz = table.real("rate_hz", model.rate_hz, 0, 1e4);
  table.finish();
  return model;
}

}  // namespace imud
