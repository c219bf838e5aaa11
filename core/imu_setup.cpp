// The parts of a sensor, and the changes between its samples: power, seed, bias, filters.

#include <algorithm>

#include "core/attitude.hpp"
#include "core/effects/drawn_errors.hpp"
#include "core/imu.hpp"

namespace imud {
namespace {
TriadErrors in_vibration(TriadErrors errors, const Vibration& vibration) {
  errors.vibration_mean_square = vibration.mean_square();
  return errors;
}

ImuModel drawn_model(ImuModel model, const Normals& normals) {
  model.current_field += drawn_current_field(model, normals);
  const Vector3 phi = drawn_alignment(model, normals);
  if (phi.isZero(0.0)) return model;
  model.dcm_PB = exp(phi).toRotationMatrix().transpose() * model.dcm_PB;
  return model;
}
}  // namespace

Vector3 drawn_alignment(const ImuModel& model, const Normals& normals) noexcept {
  if (model.alignment_sigma.isZero(0.0)) return Vector3::Zero();
  return model.alignment_sigma.cwiseProduct(normals(Quantity::attitude, Process::unit_draw, 0));
}

Vector3 drawn_current_field(const ImuModel& model, const Normals& normals) noexcept {
  if (model.current_field_sigma.isZero(0.0)) return Vector3::Zero();
  return model.current_field_sigma.cwiseProduct(
      normals(Quantity::magnetic_field, Process::unit_draw, current_field_draw));
}

Imu::Imu(const ImuModel& model, std::uint64_t seed, std::uint32_t stream)
    : model_(drawn_model(model, Normals(seed, stream))),
      dcm_PB_(model_.dcm_PB),
      q_BP_(Quaternion(model_.dcm_PB.transpose()).normalized()),
      normals_(seed, stream),
      unit_normals_(normals_),
      power_on_normals_(normals_),
      vibration_(model.vibration, normals_),
      gyro_(in_vibration(drawn_errors(model.gyro, Quantity::rate, normals_, normals_, 0, model.causes), vibration_),
            Quantity::rate, internal_period_s(model)),
      accelerometer_(in_vibration(drawn_errors(model.accelerometer, Quantity::specific_force, normals_, normals_, 0,
                                               model.causes),
                                  vibration_),
                     Quantity::specific_force, internal_period_s(model)),
      size_effect_(model.accelerometer_positions, model_.dcm_PB),
      earth_(model.earth),
      rest_(model.earth),
      magnetometer_(drawn_errors(model.magnetometer, Quantity::magnetic_field, normals_, normals_, 0, model.causes),
                    Quantity::magnetic_field, 1.0 / model.rate_hz),
      temperature_(model.temperature, model.temperature_c),
      barometer_(model.barometer, 1.0 / model.rate_hz),
      navigation_(model.navigation, 1.0 / model.rate_hz),
      is_disturbed_(vibration_.is_on() || size_effect_.is_on()),
      measures_slowly_(has_internal() || gyro_.has_rare() || accelerometer_.has_rare()),
      follows_truth_(temperature_.follows_truth() || vibration_.follows()),
      has_surroundings_(temperature_.is_on() || vibration_.follows()),
      period_s_(1.0 / model.rate_hz) {
  surroundings_.temperature_c = model.temperature_c;
  barometer_.draw(normals_);
  if (model.inclinometer)
    inclinometer_.emplace(
        in_vibration(drawn_errors(*model.inclinometer, Quantity::inclination, normals_, normals_, 0, model.causes),
                     vibration_),
        Quantity::inclination, internal_period_s(model));
}

// Takes the temperature of the surroundings, and the states that vibration follows, from the truth at `time`.
void Imu::follow_truth(const Timeline& timeline, TruthTime time) noexcept {
  if (temperature_.follows_truth()) surroundings_c_ = timeline.temperature_c(time);
  if (!vibration_.follows()) return;
  const std::optional<VehicleState> followed = vibration_.followed();
  vibration_.follow(time, followed ? timeline.vehicle(*followed, time) : std::nullopt,
                    timeline.vehicle(VehicleState::rotor_speed, time));
}

void Imu::update_surroundings() noexcept {
  if (temperature_.is_on()) temperature_.update(time_since_power_on(), surroundings_c_);
  surroundings_ = {temperature_.sensor_c(), temperature_.sensor_rate(), vibration_.power_factor()};
}

void Imu::seek(std::uint64_t k) noexcept {
  counter_ = k;
  internal_ = {.time = last_time_, .since_power_on = internal_.since_power_on};
  gyro_.seek(normals_, internal_number());
  accelerometer_.seek(normals_, internal_number());
  magnetometer_.seek(normals_, k);
  if (inclinometer_) inclinometer_->seek(normals_, internal_number());
  barometer_.seek(normals_, k);
  navigation_.seek(normals_, k);
}

void Imu::power_on(std::uint64_t number) noexcept {
  temperature_.power_on(time_since_power_on());
  powered_on_ = counter_;
  power_ons_ = number;
  power_on_normals_ = normals_;
  gyro_.power_on(number);
  accelerometer_.power_on(number);
  magnetometer_.power_on(number);
  if (inclinometer_) inclinometer_->power_on(number);
  draw_constants();
}

void Imu::draw_constants() noexcept {
  const auto draw = [this](Triad& triad, const TriadErrors& errors, Quantity quantity) {
    if (errors.unit_sigma.is_on() || errors.turn_on_sigma.is_on() || !model_.causes.empty())
      triad.set_constants(
          in_vibration(drawn_errors(errors, quantity, unit_normals_, power_on_normals_, power_ons_, model_.causes),
                       vibration_),
          quantity);
  };
  draw(gyro_, model_.gyro, Quantity::rate);
  draw(accelerometer_, model_.accelerometer, Quantity::specific_force);
  draw(magnetometer_, model_.magnetometer, Quantity::magnetic_field);
  if (inclinometer_) draw(*inclinometer_, *model_.inclinometer, Quantity::inclination);
}

void Imu::set_bias(Quantity quantity, const Vector3& bias) noexcept {
  const bool is_rate = quantity == Quantity::rate, is_force = quantity == Quantity::specific_force;
  TriadErrors& errors = is_rate ? model_.gyro : is_force ? model_.accelerometer : model_.magnetometer;
  errors.bias = bias;
  (is_rate    ? gyro_
   : is_force ? accelerometer_
              : magnetometer_)
      .set_bias(drawn_errors(errors, quantity, unit_normals_, power_on_normals_, power_ons_, model_.causes).bias);
}

const Vector3& Imu::bias(Quantity quantity) const noexcept {
  const bool is_rate = quantity == Quantity::rate, is_force = quantity == Quantity::specific_force;
  return (is_rate ? model_.gyro : is_force ? model_.accelerometer : model_.magnetometer).bias;
}

template <class Visit>
void Imu::each_sequence(Visit visit) noexcept {
  for (Triad* triad : {&gyro_, &accelerometer_, &magnetometer_}) triad->each_sequence(visit);
  if (inclinometer_) inclinometer_->each_sequence(visit);
  barometer_.each_sequence(visit);
  navigation_.each_sequence(visit);
}

void Imu::set_seed(std::uint64_t seed) noexcept {
  normals_.set_seed(seed);
  each_sequence([](NormalSequence& sequence, std::uint64_t = 1) { sequence.forget(); });
}

void Imu::take_numbers_from(std::deque<NormalStock>& stocks, std::size_t samples) {
  constexpr std::size_t most = 4096;  // with more internal samples a block lasts for fewer samples
  const std::size_t numbers = std::min(most, samples * static_cast<std::size_t>(model_.internal_samples));
  each_sequence([&](NormalSequence& sequence, std::uint64_t stride = 1) {
    sequence.take_from(stocks.emplace_back(numbers / stride + 1));
  });
}

void Imu::reserve_filters(int length) {
  for (Triad* triad : {&gyro_, &accelerometer_, &magnetometer_}) triad->reserve_filter(length);
  if (inclinometer_) inclinometer_->reserve_filter(length);
}

void Imu::set_filters(const SensorFilters& filters) noexcept {
  gyro_.set_filter(filters.gyro);
  accelerometer_.set_filter(filters.accelerometer);
  magnetometer_.set_filter(filters.magnetometer);
  if (inclinometer_) inclinometer_->set_filter(filters.inclinometer);
}

}  // namespace imud
