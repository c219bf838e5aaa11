#include "emulator/ground/drawn_terms.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/effects/drawn_errors.hpp"

namespace imud {
namespace {

std::vector<double> numbers(const Vector3& v) { return {v[0], v[1], v[2]}; }
std::vector<double> numbers(const Matrix3& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)};
}

void append(std::vector<DrawnTerms>& all, DrawnTerms drawn) {
  if (!drawn.terms.empty()) all.push_back(std::move(drawn));
}

DrawnTerms terms_of(std::string_view sensor, std::string_view layer, const ConstantErrors& drawn) {
  DrawnTerms all = {sensor, layer, {}};
  std::size_t i = 0;
  const auto add = [&](const auto& term) {
    const std::string_view name = constant_error_names[i++];
    if (!term.isZero(0.0)) all.terms.emplace_back(name, numbers(term));
  };
  for_each_constant(add, drawn);
  return all;
}

}  // namespace

std::string DrawnTerms::text() const {
  std::vector<std::string> parts;
  for (const auto& [name, values] : terms) parts.push_back(fmt::format("{}={}", name, fmt::join(values, ",")));
  return fmt::format("{}", fmt::join(parts, " "));
}

std::vector<DrawnTerms> drawn_terms(const ImuModel& model, std::uint64_t seed, std::string_view imu_name) {
  const Normals normals(seed, stream_id(imu_name));
  std::vector<DrawnTerms> all;
  if (const Vector3 phi = drawn_alignment(model, normals); !phi.isZero(0.0))
    append(all, {"mounting", "unit", {{"rotation", numbers(phi)}}});
  const auto add = [&](std::string_view sensor, const TriadErrors& errors, Quantity quantity,
                       const Vector3& current_field = Vector3::Zero()) {
    DrawnTerms unit = terms_of(sensor, "unit", drawn_for_unit(errors, quantity, normals, model.causes));
    if (!current_field.isZero(0.0)) unit.terms.emplace_back("current_field", numbers(current_field));
    append(all, std::move(unit));
    ConstantErrors turn_on = drawn_at_power_on(errors, quantity, normals, 0, model.causes);
    const Vector3 own = drawn_errors(errors, quantity, normals, normals, 0, model.causes).turn_on_bias;
    turn_on.bias += own.cwiseProduct(normals(quantity, Process::turn_on_bias, 0));
    append(all, terms_of(sensor, "turn_on", turn_on));
  };
  add("gyro", model.gyro, Quantity::rate);
  add("accelerometer", model.accelerometer, Quantity::specific_force);
  add("magnetometer", model.magnetometer, Quantity::magnetic_field, drawn_current_field(model, normals));
  if (model.inclinometer) add("inclinometer", *model.inclinometer, Quantity::inclination);
  DrawnTerms barometer = {"barometer", "unit", {}};
  const Barometer::Drawn drawn = Barometer::drawn(model.barometer, normals);
  if (drawn.bias != 0) barometer.terms.emplace_back("bias", std::vector{drawn.bias});
  if (drawn.port != 0) barometer.terms.emplace_back("port", std::vector{drawn.port});
  append(all, std::move(barometer));
  for (const DrawnLayer layer : {DrawnLayer::unit, DrawnLayer::turn_on}) {
    DrawnTerms causes = {"cause", layer == DrawnLayer::unit ? "unit" : "turn_on", {}};
    for (const Cause& cause : model.causes) {
      if (cause.layer != layer) continue;
      const Vector3 deviates = cause.drawn(normals, 0);
      causes.terms.emplace_back(cause.name, cause.is_per_axis ? numbers(deviates) : std::vector{deviates.x()});
    }
    append(all, std::move(causes));
  }
  return all;
}

}  // namespace imud
