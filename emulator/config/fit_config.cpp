// The keys of [truth] for the fit of poses, and for the point whose motion truth gives.
#include "emulator/config/config_parts.hpp"
#include "emulator/config/recorded_config.hpp"

namespace imud {
namespace {

using Source = PoseFit::Source;

GravitationModel read_gravitation(TableReader& table) {
  using Kind = GravitationModel::Kind;
  GravitationModel gravitation;
  if (table.has("gravity_m_per_s2")) {
    gravitation.kind = Kind::constant;
    gravitation.constant = table.real("gravity_m_per_s2", gravitation.constant, -1000.0, 1000.0);
    if (table.has("gravity")) table.fault("gravity", "give either this or gravity_m_per_s2, not both");
    return gravitation;
  }
  gravitation.kind = table.choice<Kind>(
      "gravity", {{Kind::automatic, "auto"}, {Kind::wgs84, "wgs84"}, {Kind::j2, "j2"}, {Kind::none, "none"}},
      Kind::automatic);
  return gravitation;
}

std::string_view word(Source source, bool is_force) {
  if (source == Source::given) return is_force ? "given, or 0" : "given";
  return source == Source::derived ? "derived" : "derived unless given";
}

std::string text(const GravitationModel& gravitation) {
  switch (gravitation.kind) {
    case GravitationModel::Kind::automatic:
      return "the normal gravitation of WGS 84, or 9.80665 m/s^2 along N's z if N is a local level";
    case GravitationModel::Kind::wgs84:
      return "the normal gravitation of WGS 84";
    case GravitationModel::Kind::j2:
      return "central gravitation with J2";
    case GravitationModel::Kind::constant:
      return fmt::format("{} m/s^2 along N's z", gravitation.constant);
    case GravitationModel::Kind::none:
    default:
      return "no gravitation";
  }
}

}  // namespace

bool was_recorded_without(const std::string& port, std::string_view text) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || transport->is_record == nullptr) return false;
  try {
    const auto recorded = recorded_config(PortSpec::parse(port).address);
    return !recorded || recorded->find(text) == std::string::npos;
  } catch (const PortError&) {
    return true;
  }
}

void read_fit(TableReader& table, ClockMode clock, TruthConfig& truth) {
  // In lockstep the simulator waits for the answer to each truth. A derived quantity would delay the answer until the
  // next truths.
  const bool waits = clock == ClockMode::lockstep && !is_capture(truth.port);
  const auto source_of = [&](std::string_view key, Source choice) {
    if (choice == Source::derived && waits)
      table.fault(key,
                  "\"derived\" needs the truths that follow, but in lockstep the simulator waits for an answer to "
                  "each; send the quantity, or give clock = \"realtime\"");
    const bool is_derived = truth.format != nullptr && truth.format->derives && !waits;
    return choice == Source::automatic && !is_derived ? Source::given : choice;
  };
  PoseFit::Options fit;
  fit.rate = source_of(
      "rate", table.choice<Source>(
                  "rate", {{Source::automatic, "auto"}, {Source::given, "given"}, {Source::derived, "derived"}},
                  Source::automatic));
  if (waits && !truth.frame.has_rate && fit.rate == Source::given)
    table.fault("format",
                fmt::format("{} truth has no rate by these settings, and in lockstep none can be derived, as the "
                            "simulator waits for an answer to each truth; send the rate, or give clock = "
                            "\"realtime\"",
                            truth.format->name));
  using Force = std::optional<Source>;
  const Force force = table.choice<Force>(
      "specific_force",
      {{Source::automatic, "auto"}, {Source::given, "given"}, {Source::derived, "derived"}, {std::nullopt, "none"}},
      Source::automatic);
  fit.specific_force = source_of("specific_force", force.value_or(Source::given));
  truth.ignores_force = !force;
  const bool derives = fit.rate != Source::given || fit.specific_force != Source::given;
  // The choice uses the truths of the next second, which are available at once in a capture.
  const bool is_chosen_by_default =
      derives && is_capture(truth.port) && !was_recorded_without(truth.port, "\nfit_delay_ms = \"auto\"");
  if (is_text(table, "fit_delay_ms") || (!table.has("fit_delay_ms") && is_chosen_by_default)) {
    fit.widest = 8;
    if (table.text("fit_delay_ms", "auto") != "auto")
      table.fault("fit_delay_ms", "give milliseconds from 1 to 500, or \"auto\"");
    else if (!is_capture(truth.port))
      table.fault("fit_delay_ms",
                  "\"auto\" needs a capture, as it uses truths of a second ahead; give milliseconds, by which the "
                  "sensors then sample later");
  } else {
    fit.delay = nanoseconds(1e-3 * table.real("fit_delay_ms", 30.0, 1.0, 500.0));
  }
  fit.gravitation = truth.gravitation = read_gravitation(table);
  if (derives) truth.fit = fit;
  truth.r_RB_B = table.vector3("r_RB_B_m", truth.r_RB_B);
}

std::string fit_text(const TruthConfig& truth) {
  if (!truth.fit) return {};
  const PoseFit::Options& fit = *truth.fit;
  const bool derives_force = fit.specific_force != Source::given && !truth.ignores_force;
  const double delay_ms = 1e3 * seconds(fit.delay);
  const std::string window =
      fit.widest == 0
          ? fmt::format("{:.6g} ms of delay, to {:.3g} Hz", delay_ms, PoseFit::bandwidth_hz(fit.delay))
          : fmt::format(
                "{:.6g} to {:.6g} ms on either side, chosen by the noise of the poses, to {:.3g} Hz "
                "at most",
                delay_ms, delay_ms * PoseFit::widest_factor(fit.widest), PoseFit::bandwidth_hz(fit.delay));
  return fmt::format("rate {}, specific force {}{}; derived with {}", word(fit.rate, false),
                     truth.ignores_force ? "0" : word(fit.specific_force, true),
                     derives_force ? fmt::format(", less {}", text(fit.gravitation)) : "", window);
}

}  // namespace imud
