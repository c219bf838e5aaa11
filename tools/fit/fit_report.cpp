#include "tools/fit/fit_report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "core/units.hpp"
#include "emulator/ground/plural.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

constexpr double deg_per_hr = units::degree / 3600, g = units::standard_gravity, mg = 1e-3 * g;

// A term of one axis, with name and unit for people.
struct Shown {
  std::string name;
  const char* key;  // in JSON
  double nominal = 0, unit = 1;
  const char* unit_name = "";
};

Shown shown(FitTerm term, int axis, bool is_rate) {
  const auto number = static_cast<std::size_t>(term);
  const double bias_unit = is_rate ? deg_per_hr : mg;
  switch (term) {
    case FitTerm::bias:
      return {"bias", "bias", 0, bias_unit, is_rate ? "deg/h" : "mg"};
    case FitTerm::x:
    case FitTerm::y:
    case FitTerm::z: {
      constexpr const char* keys[] = {"input_x", "input_y", "input_z"};
      const auto column = static_cast<int>(number) - 1;
      if (column == axis) return {"scale factor", keys[column], 1, 1e-6, "ppm"};
      return {fmt::format("misalignment {}", "xyz"[column]), keys[column], 0, 1e-3, "mrad"};
    }
    case FitTerm::g_x:
    case FitTerm::g_y:
    case FitTerm::g_z: {
      constexpr const char* keys[] = {"g_sensitivity_x", "g_sensitivity_y", "g_sensitivity_z"};
      return {fmt::format("bias by force {}", "xyz"[number - 4]), keys[number - 4], 0, deg_per_hr / g, "deg/h/g"};
    }
    case FitTerm::bias_by_temperature:
      return {"bias by temperature", "bias_by_temperature", 0, bias_unit, is_rate ? "deg/h/C" : "mg/C"};
    case FitTerm::scale_by_temperature:
      break;
  }
  return {"scale by temperature", "scale_by_temperature", 0, 1e-6, "ppm/C"};
}

// Returns a text about the dwells that would determine a term.
std::string_view remedy(FitTerm term, int axis) {
  switch (term) {
    case FitTerm::bias:
      return "a dwell with another input";
    case FitTerm::x:
    case FitTerm::y:
    case FitTerm::z:
      return static_cast<int>(term) - 1 == axis
                 ? "turns both ways, or at two rates, about that axis; both directions up"
                 : "an input along that axis";
    case FitTerm::g_x:
    case FitTerm::g_y:
    case FitTerm::g_z:
      return "dwells with that axis up and down, and the Earth's rate in the rates that are stated";
    case FitTerm::bias_by_temperature:
      return "dwells at two temperatures";
    case FitTerm::scale_by_temperature:
      break;
  }
  return "inputs along that axis at two temperatures";
}

bool belongs(FitTerm term, bool is_rate) {
  return is_rate || (term != FitTerm::g_x && term != FitTerm::g_y && term != FitTerm::g_z);
}

template <class Act>
void for_each_term(bool is_rate, Act&& act) {
  for (std::size_t t = 0; t < fit_terms; ++t)
    if (const auto term = static_cast<FitTerm>(t); belongs(term, is_rate)) act(term);
}

std::string axis_text(const FitReport::Sensor& sensor, int axis, bool is_rate) {
  const AxisFit& fit = sensor.axes[static_cast<std::size_t>(axis)];
  std::string out = fmt::format("{} {}\n", is_rate ? "gyro" : "accelerometer", "xyz"[axis]);
  for_each_term(is_rate, [&](FitTerm term) {
    const Shown name = shown(term, axis, is_rate);
    const AxisFit::Parameter& parameter = fit[term];
    if (parameter.sigma)
      out += fmt::format("  {:<22}{:>12.5g} +- {:<9.2g} {}\n", name.name,
                         (parameter.value - name.nominal) / name.unit, *parameter.sigma / name.unit, name.unit_name);
    else
      out += fmt::format("  {:<22} not shown: it takes {}\n", name.name, remedy(term, axis));
  });
  out += fmt::format(
      "  {} of {} varied terms are independent, condition {:.3g}; residuals {:.3g} for {} degrees of freedom\n",
      fit.rank, fit.wanted, fit.condition, fit.chi_square, fit.degrees);
  if (fit.error_factor > 1)
    out += fmt::format(
        "  WARNING: the noise does not explain the residuals; the errors above are enlarged {:.3g} times. Look for "
        "motion, a wrong plan, or noise that --noise lacks\n",
        fit.error_factor);
  return out;
}

nlohmann::ordered_json axis_json(const FitReport::Sensor& sensor, int axis, bool is_rate) {
  const AxisFit& fit = sensor.axes[static_cast<std::size_t>(axis)];
  nlohmann::ordered_json json;
  for_each_term(is_rate, [&](FitTerm term) {
    const AxisFit::Parameter& parameter = fit[term];
    nlohmann::ordered_json& one = json[shown(term, axis, is_rate).key];
    one["si"] = parameter.sigma ? nlohmann::ordered_json(parameter.value) : nlohmann::ordered_json(nullptr);
    one["si_error"] = parameter.sigma ? nlohmann::ordered_json(*parameter.sigma) : nlohmann::ordered_json(nullptr);
  });
  json["rank"] = fit.rank;
  json["condition"] = fit.condition;
  json["chi_square"] = fit.chi_square;
  json["degrees_of_freedom"] = fit.degrees;
  json["error_factor"] = fit.error_factor;
  return json;
}

// A line of three numbers, one for each axis, and their standard errors.
std::string line(const FitReport::Sensor& sensor, std::string_view key, FitTerm term, double offset, double unit,
                 std::string_view absent) {
  std::array<double, 3> values{};
  std::array<std::string, 3> errors;
  bool is_shown = false;
  for (std::size_t i = 0; i < 3; ++i) {
    const FitTerm of_axis = term == FitTerm::x ? static_cast<FitTerm>(i + 1) : term;
    const AxisFit::Parameter& parameter = sensor.axes[i][of_axis];
    values[i] = (parameter.value - offset) / unit;
    errors[i] = parameter.sigma ? fmt::format("{:.2g}", *parameter.sigma / unit) : "not shown";
    is_shown = is_shown || parameter.sigma;
  }
  if (!is_shown) return fmt::format("# {}: {}\n", key, absent);
  return fmt::format("{} = [{:.8g}]  # +- {}\n", key, fmt::join(values, ", "), fmt::join(errors, ", "));
}

// The rows of a matrix of which imud has the rows of `of` of every axis.
template <class Element>
std::string matrix(std::string_view key, Element&& element) {
  std::string rows;
  for (int i = 0; i < 3; ++i)
    rows +=
        fmt::format("{}[{:.8g}, {:.8g}, {:.8g}]", i == 0 ? "" : ", ", element(i, 0), element(i, 1), element(i, 2));
  return fmt::format("{} = [{}]\n", key, rows);
}

std::string sensor_preset(const std::optional<FitReport::Sensor>& sensor, bool is_rate, double reference_c) {
  std::string out = fmt::format("\n[imu.{}]\n{} = 1e6  # dwells do not show the range: give the data sheet's\n",
                                is_rate ? "gyro" : "accelerometer", is_rate ? "max_deg_per_s" : "max_g");
  if (!sensor) return out + "# was not fitted\n";
  const std::string_view absent = "not shown by these dwells";
  out += line(*sensor, is_rate ? "bias_deg_per_hr" : "bias_mg", FitTerm::bias, 0, is_rate ? deg_per_hr : mg, absent);
  out += line(*sensor, "scale_factor", FitTerm::x, 0, 1, absent);
  // imud turns the input first: row i of its matrix has 1 on the diagonal.
  const auto input = [&](int i, int j) {
    return sensor->axes[static_cast<std::size_t>(i)].parameters[static_cast<std::size_t>(1 + j)].value;
  };
  out += matrix("misalignment", [&](int i, int j) { return i == j ? 1 : input(i, j) / input(i, i); });
  if (is_rate)
    out += matrix("g_sensitivity_deg_per_hr_per_g", [&](int i, int j) {
      return sensor->axes[static_cast<std::size_t>(i)].parameters[static_cast<std::size_t>(4 + j)].value * g /
             deg_per_hr;
    });
  out += fmt::format("reference_temperature_c = {:.6g}\n", reference_c);
  out += line(*sensor, is_rate ? "temperature_bias_deg_per_hr_per_c" : "temperature_bias_mg_per_c",
              FitTerm::bias_by_temperature, 0, is_rate ? deg_per_hr : mg, absent);
  out += line(*sensor, "temperature_scale_ppm_per_c", FitTerm::scale_by_temperature, 0, 1e-6, absent);
  return out + "# noise: imu-allan --to-config, from a recording at rest\n";
}

}  // namespace

std::string FitReport::text() const {
  std::string out = fmt::format("recording  {} samples at {:.6g} Hz, {}, {:.4g} degrees Celsius in the mean\n",
                                samples, rate_hz, plural(dwells, "dwell"), reference_c);
  for (const bool is_rate : {true, false}) {
    const std::optional<Sensor>& sensor = is_rate ? gyro : accelerometer;
    if (!sensor) {
      out += fmt::format("{}: not fitted; it takes its channels, and dwells that state the {}\n",
                         is_rate ? "gyro" : "accelerometer", is_rate ? "rate, with the Earth's" : "specific force");
      continue;
    }
    for (int axis = 0; axis < 3; ++axis) out += axis_text(*sensor, axis, is_rate);
  }
  return out + "Misalignments are relative to the fixture's axes.\n";
}

std::string FitReport::json() const {
  nlohmann::ordered_json all = {{"protocol", protocol},
                                {"port", port},
                                {"plan", plan},
                                {"samples", samples},
                                {"dwells", dwells},
                                {"rate_hz", rate_hz},
                                {"reference_temperature_c", reference_c}};
  for (const bool is_rate : {true, false})
    if (const std::optional<Sensor>& sensor = is_rate ? gyro : accelerometer)
      for (int axis = 0; axis < 3; ++axis)
        all["axes"][fmt::format("{}_{}", is_rate ? "gyro" : "accel", "xyz"[axis])] =
            axis_json(*sensor, axis, is_rate);
  return all.dump(2) + "\n";
}

std::string FitReport::preset() const {
  return fmt::format("# {} at {}, by the dwells of {}\n# imu-fit, {} dwells\n", on_one_line(protocol),
                     on_one_line(port), on_one_line(plan), dwells) +
         sensor_preset(gyro, true, reference_c) + sensor_preset(accelerometer, false, reference_c);
}

}  // namespace imud
