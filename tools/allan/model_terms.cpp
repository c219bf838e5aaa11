#include "tools/allan/model_terms.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

#include "core/effects/bandwidth.hpp"
#include "core/effects/rare/fir_filter.hpp"
#include "core/imu.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/ground/error_text.hpp"
#include "tools/setting_texts.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

// Returns the response of the sensor's filters to a value of 1 in one of its own samples.
std::vector<Vector3> impulse_response(const TriadErrors& errors, double rate_hz) {
  constexpr std::size_t most = 1U << 14U, quiet = 64;
  constexpr double least = 1e-9;
  FirFilter taps(errors, Quantity::rate, 1 / rate_hz);
  Bandwidth filter(errors, Quantity::rate, 1 / rate_hz);
  const Normals normals(0, 0);
  const Vector3 none = Vector3::Zero();
  const auto next = [&](double value, bool begins_run) {
    TriadStep step = {.normals = normals,
                      .k = 0,
                      .dt = 0,
                      .since_power_on = 0,
                      .specific_force = none,
                      .delta_velocity = none,
                      .value = all_lanes(value),
                      .increment = lanes(none),
                      .begins_run = begins_run};
    if (taps.is_on()) taps.apply(step);
    if (filter.is_on()) filter.apply(step);
    return vector_of(step.value);
  };
  next(0, true);
  const std::size_t taps_and_boxcars = (errors.fir_taps ? errors.fir_taps->size() : 0) +
                                       static_cast<std::size_t>(errors.filter.length * errors.filter.stages);
  std::vector<Vector3> response = {next(1, false)};
  for (std::size_t small = 0; response.size() < most && (small < quiet || response.size() < taps_and_boxcars);) {
    response.push_back(next(0, false));
    small = response.back().cwiseAbs().maxCoeff() < least ? small + 1 : 0;
  }
  return response;
}

// The autocovariance of noise with the lags 0 and 1.
struct Lags {
  double zero = 0, one = 0;
  // Adds white noise of the variance v, and the difference of two successive numbers of it.
  void add_white(double v) noexcept { zero += v; }
  void add_difference(double v) noexcept {
    zero += 2 * v;
    one -= v;
  }
};

SampleNoise sample_noise(const TriadErrors& errors, const AllanTerms& terms, int axis, double rate_hz,
                         std::size_t decimation, const std::vector<Vector3>& response) {
  Lags input, rounding, increments;
  input.add_white(terms.N * terms.N * rate_hz);
  input.add_difference(std::pow(errors.quantization_noise[axis] * rate_hz, 2));
  const double of_lsb = errors.lsb * errors.lsb / 12;
  errors.carry ? rounding.add_difference(of_lsb) : rounding.add_white(of_lsb);
  // Increments have an LSB of their own, or the rounding of the values.
  if (errors.increment_lsb > 0)
    increments.add_difference(std::pow(errors.increment_lsb * rate_hz, 2) / 12);
  else
    increments = rounding;

  SampleNoise noise{.of_values = {},
                    .of_rates = {input.zero + increments.zero, input.one + increments.one},
                    .decimation = decimation};
  const auto product = [&](std::size_t lag) {
    double sum = 0;
    for (std::size_t i = 0; i + lag < response.size(); ++i) sum += response[i][axis] * response[i + lag][axis];
    return sum;
  };
  for (std::size_t lag = 0; lag <= response.size(); lag += decimation) {
    double r = input.zero * product(lag);
    if (input.one != 0) r += input.one * (product(lag > 0 ? lag - 1 : 1) + product(lag + 1));
    noise.of_values.push_back(r + (lag == 0 ? rounding.zero : lag == 1 ? rounding.one : 0));
  }
  return noise;
}

// Returns the sensor of a product with these settings and this model; nullopt if the product cannot have the
// model.
std::optional<ImuModel> product_model(const std::string& model, const DecodeOptions& source) {
  const Protocol* protocol = find_protocol(source.protocol);
  if (protocol == nullptr || protocol->product == nullptr) return std::nullopt;
  const auto in_json = [](const std::string& text) { return nlohmann::json(text).dump(); };
  const bool is_can = protocol->link == Link::can;
  std::string text =
      fmt::format("[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = {}\nport = {}\nmodel = {}\n",
                  in_json(source.protocol), in_json(standard_input_port(is_can, is_can)), in_json(model));
  const Settings settings = settings_from(protocol->settings, source.settings);
  for (const Setting& setting : protocol->settings) {
    const auto value =
        std::visit([](const auto& of) { return nlohmann::json(of).dump(); }, settings.value(setting.key));
    text += fmt::format("device.{} = {}\n", setting.key, value);
  }
  try {
    return config_of_text(text).imus.at(0).model;
  } catch (const ConfigError&) {
    return std::nullopt;
  }
}

// Returns the sensor whose samples have this rate; nullopt if the sensor cannot have the rate.
std::optional<ImuModel> sender(const std::string& model, double rate_hz, const DecodeOptions& source) {
  if (auto product = product_model(model, source)) return product;
  try {
    return model_named(model, rate_hz);
  } catch (const ConfigError&) {
    return std::nullopt;
  }
}

void add_noise(const ImuModel& imu, double rate_hz, ModelTerms& terms) {
  const double own_hz = 1 / internal_period_s(imu), ratio = std::round(own_hz / rate_hz);
  constexpr double clock_error = 0.01;
  const bool is_multiple = ratio >= 1 && std::abs(own_hz / ratio / rate_hz - 1) < clock_error;
  const std::size_t decimation = is_multiple ? static_cast<std::size_t>(ratio) : 1;
  const auto sensors = triad_terms(imu);
  for (std::size_t first = 0; first < terms.noise.size(); first += channels_per_sensor) {
    const TriadErrors& errors = first == 0 ? imu.gyro : imu.accelerometer;
    const auto response = impulse_response(errors, own_hz);
    for (std::size_t axis = 0; axis < channels_per_sensor; ++axis)
      terms.noise[first + axis] = sample_noise(errors, sensors.at(first / channels_per_sensor).axes[axis],
                                               static_cast<int>(axis), own_hz, decimation, response);
  }
}

// Returns the autocovariance at lag k of m values in sequence, or of the averages of m such sums, with weights of 1.
double spread(AllanKind kind, double m, double k) noexcept {
  k = std::abs(k);
  if (kind != AllanKind::modified) return std::max(m - k, 0.0);
  // The cubic spline of four boxcars: binomial coefficients of the powers of (1 - z^m)^4/(1 - z)^4.
  double sum = 0;
  constexpr double binomial[] = {1, -4, 6, -4};
  for (int j = 0; j < 4; ++j) {
    const double n = 2 * (m - 1) - k - j * m;
    if (n >= 0) sum += binomial[j] * (n + 1) * (n + 2) * (n + 3) / 6;
  }
  return sum;
}

}  // namespace

// The variance of a weighted sum is the sum over the lags of the autocovariances of noise and weights. The weights
// are differences of the sums of m values, (-1, 1) or (1, -2, 1).
double SampleNoise::variance(AllanKind kind, std::size_t factor, bool is_increment) const noexcept {
  const std::vector<double>& noise = is_increment ? of_rates : of_values;
  const auto m = static_cast<double>(is_increment ? factor * decimation : factor);
  const auto weights = [&](double k) {
    const auto at = [&](double blocks) { return spread(kind, m, k - blocks * m) + spread(kind, m, k + blocks * m); };
    return is_hadamard(kind) ? 3 * at(0) - 4 * at(1) + at(2) : at(0) - at(1);
  };
  double sum = 0;
  for (std::size_t k = 0; k < noise.size(); ++k) sum += (k == 0 ? 1 : 2) * noise[k] * weights(static_cast<double>(k));
  const double divisor = is_hadamard(kind) ? 6 : 2;
  return std::max(sum, 0.0) / (divisor * m * m * (kind == AllanKind::modified ? m * m : 1));
}

double ModelTerms::deviation(AllanKind kind, std::size_t channel, const AveragingTime& time,
                             bool is_increment) const {
  AllanTerms terms = of[channel];
  if (noise[channel].of_values.empty()) return expected_deviation(kind, terms, time, flicker_from_s[channel]);
  terms.N = terms.Q = 0;
  const double others = expected_deviation(kind, terms, time, flicker_from_s[channel]);
  return std::sqrt(others * others + noise[channel].variance(kind, time.factor, is_increment));
}

ModelTerms model_terms(const std::string& model, double rate_hz, const DecodeOptions* source) {
  // A rate at which every preset is possible; averaging a recording does not change the densities.
  const double least_rate_hz = 100, greatest_rate_hz = 10'000;
  try {
    const ImuModel imu = model_named(model, std::clamp(rate_hz, least_rate_hz, greatest_rate_hz));
    const auto sensors = triad_terms(imu);
    ModelTerms terms{model, {}, {}, {}};
    for (std::size_t i = 0; i < terms.of.size(); ++i) {
      terms.of[i] = sensors.at(i / channels_per_sensor).axes[i % channels_per_sensor];
      terms.flicker_from_s[i] = (i < channels_per_sensor ? imu.gyro : imu.accelerometer).flicker_from_s;
    }
    if (source != nullptr)
      if (const auto sending = sender(model, rate_hz, *source)) add_noise(*sending, rate_hz, terms);
    return terms;
  } catch (const ConfigError& error) {
    const std::string& fault = error.faults.front();
    const std::size_t key = fault.find(".model: ");
    throw std::invalid_argument(key == std::string::npos ? fault : fault.substr(key + 8));
  }
}

}  // namespace imud
