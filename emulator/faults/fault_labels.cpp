#include "emulator/faults/fault_labels.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "emulator/ground/plural.hpp"
#include "protocols/wire/csv_field.hpp"

namespace imud {
namespace {

std::string_view word(FaultLabel::State state) {
  switch (state) {
    case FaultLabel::State::acted:
      return "acted";
    case FaultLabel::State::passed_over:
      return "passed_over";
    case FaultLabel::State::lost:
      return "lost";
    case FaultLabel::State::never:
      break;
  }
  return "never";
}

// Returns the text of an error of a solution; empty if there is no error.
std::string size_text(double size) { return size < 0 ? std::string() : fmt::format("{}", size); }

std::uint64_t lost_by(const FaultLabel& label) {
  return label.state == FaultLabel::State::lost ? label.first.occurrence + label.last.occurrence : 0;
}

// Adds a label for each fault and imu of which occurrences are not in the log.
void add_lost(std::span<const FaultConfig> faults, std::span<const std::string> imus, const FaultLog& log,
              std::vector<FaultLabel>& labels) {
  for (std::size_t fault = 0; fault < faults.size(); ++fault)
    for (std::size_t imu = 0; imu <= imus.size(); ++imu) {
      const auto number = imu < imus.size() ? static_cast<std::uint16_t>(imu) : truth_number;
      const FaultLog::Lost lost = log.lost(fault, number);
      if (lost.acted + lost.passed_over == 0) continue;
      FaultEvent acted;
      acted.fault = static_cast<std::uint32_t>(fault);
      acted.imu = number;
      acted.occurrence = lost.acted;
      FaultEvent passed_over = acted;
      passed_over.occurrence = lost.passed_over;
      labels.push_back({&faults[fault], imu_of(acted, imus), acted, passed_over, true, FaultLabel::State::lost});
    }
}

}  // namespace

std::vector<FaultLabel> fault_labels(std::span<const FaultConfig> faults, std::span<const std::string> imus,
                                     const FaultLog& log) {
  std::vector<FaultLabel> labels;
  for (std::size_t i = 0; i < log.size(); ++i) {
    const FaultEvent& event = log[i];
    if (event.kind == FaultEvent::Kind::begun || event.kind == FaultEvent::Kind::passed_over) {
      const bool is_passed_over = event.kind == FaultEvent::Kind::passed_over;
      const auto state = is_passed_over ? FaultLabel::State::passed_over : FaultLabel::State::acted;
      labels.push_back({&faults[event.fault], imu_of(event, imus), event, event, is_passed_over, state});
      continue;
    }
    const bool is_end = event.kind == FaultEvent::Kind::ended;
    const auto begin = std::find_if(labels.rbegin(), labels.rend(), [&](const FaultLabel& label) {
      return label.first.fault == event.fault && label.first.imu == event.imu &&
             (is_end ? !label.has_ended : label.first.occurrence == event.occurrence);
    });
    if (begin == labels.rend()) continue;
    if (!is_end) {
      begin->effect = event.effect;
      continue;
    }
    begin->last = event;
    begin->has_ended = true;
  }
  if (log.lost() > 0) add_lost(faults, imus, log, labels);
  return labels;
}

std::string lost_text(std::span<const FaultLabel> labels) {
  std::uint64_t lost = 0;
  for (const FaultLabel& label : labels) lost += lost_by(label);
  return lost == 0
             ? std::string()
             : fmt::format("{} of faults without a label: the log of faults is full", plural(lost, "occurrence"));
}

void add_never_begun(std::span<const FaultConfig> faults, std::vector<FaultLabel>& labels) {
  const std::size_t count = labels.size();
  for (const FaultConfig& fault : faults)
    for (const std::string& imu : fault.imus) {
      const auto end = labels.begin() + static_cast<std::ptrdiff_t>(count);
      const bool has_one = std::any_of(labels.begin(), end, [&](const FaultLabel& label) {
        return label.fault->name == fault.name && label.imu == imu;
      });
      if (!has_one) labels.push_back({&fault, imu, {}, {}, true, FaultLabel::State::never});
    }
}

std::vector<FaultOutcome> fault_outcomes(std::span<const FaultConfig> faults, std::span<const FaultLabel> labels) {
  std::vector<FaultOutcome> all;
  for (const FaultConfig& fault : faults) {
    FaultOutcome& outcome = all.emplace_back(fault);
    for (const FaultLabel& label : labels) {
      if (label.fault->name != fault.name) continue;  // control may have begun it again
      if (label.state == FaultLabel::State::acted) ++outcome.occurrences;
      if (label.state == FaultLabel::State::passed_over) outcome.is_passed_over = true;
      if (label.state != FaultLabel::State::lost) continue;
      outcome.occurrences += label.first.occurrence;
      outcome.lost += label.first.occurrence;
      if (label.last.occurrence > 0) outcome.is_passed_over = true;
    }
  }
  return all;
}

std::string FaultOutcome::shortfall() const {
  if (has_begun() || may_fail_to_begin) return {};
  return fmt::format("fault {} {}", name, is_passed_over ? "was passed over" : "has never begun");
}

const std::string& imu_of(const FaultEvent& event, std::span<const std::string> imus) {
  static const std::string truth(fault_of_truth);
  return event.imu == truth_number ? truth : imus[event.imu];
}

std::string parameters_text(const FaultConfig& fault, const FaultEvent& event) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < fault.kind->parameters.size(); ++i)
    all.push_back(fmt::format("{}={}", fault.kind->parameters[i].key, event.parameters[i]));
  return fmt::format("{}", fmt::join(all, " "));
}

std::string event_text(const FaultConfig& fault, const std::string& imu, const FaultEvent& event) {
  if (event.kind == FaultEvent::Kind::effect)
    return fmt::format("{}: {}: largest errors of the solution until {:.6g} s{}{}{}", imu, fault.name, event.time_s,
                       event.effect.attitude < 0 ? "" : fmt::format(", {:.3g} rad", event.effect.attitude),
                       event.effect.velocity < 0 ? "" : fmt::format(", {:.3g} m/s", event.effect.velocity),
                       event.effect.position < 0 ? "" : fmt::format(", {:.3g} m", event.effect.position));
  if (event.kind == FaultEvent::Kind::passed_over)
    return fmt::format("{}: {}: {} of {} has not acted: the simulation's time has leapt over it, to {:.6g} s", imu,
                       fault.name, fault.kind->name, fault.target_text(), event.time_s);
  const bool has_begun = event.kind == FaultEvent::Kind::begun;
  const std::string numbers = has_begun ? parameters_text(fault, event) : std::string();
  return fmt::format("{}: {}: {} of {}{}{} {} sample {}, {:.6g} s {}", imu, fault.name, fault.kind->name,
                     fault.target_text(), numbers.empty() ? "" : ", ", numbers,
                     has_begun ? "begins with" : "ends with", event.sample, event.time_s,
                     event.run < 0 ? "since power on" : "after the begin of the run");
}

std::vector<DrawnLabel> drawn_labels(std::span<const ImuConfig> imus, std::uint64_t seed) {
  std::vector<DrawnLabel> all;
  for (const ImuConfig& imu : imus)
    for (DrawnTerms& drawn : drawn_terms(imu.model, imu.seed.value_or(seed), imu.name))
      all.push_back({imu.name, std::move(drawn)});
  return all;
}

std::string labels_csv(std::span<const FaultLabel> labels, std::span<const DrawnLabel> drawn,
                       std::optional<std::uint64_t> seed) {
  std::string text = seed ? "seed," : "";
  text +=
      "fault,imu,target,kind,occurrence,first_sample,last_sample,first_counter,last_counter,begin_s,end_s,"
      "first_time_ns,last_time_ns,parameters,run,state,attitude_error_rad,velocity_error_m_per_s,position_error_m\n";
  for (const FaultLabel& label : labels) {
    if (seed) text += fmt::format("{},", *seed);
    if (label.state == FaultLabel::State::never || label.state == FaultLabel::State::lost) {
      const std::uint64_t lost = lost_by(label);
      text += fmt::format("{},{},{},{},{},,,,,,,,,,,{},,,\n", csv_field(label.fault->name), csv_field(label.imu),
                          label.fault->target_text(), label.fault->kind->name,
                          lost > 0 ? fmt::to_string(lost) : std::string(), word(label.state));
      continue;
    }
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", csv_field(label.fault->name),
                        csv_field(label.imu), label.fault->target_text(), label.fault->kind->name,
                        label.first.occurrence, label.first.sample, label.last.sample, label.first.counter,
                        label.last.counter, label.first.time_s, label.last.time_s, label.first.device_time.ns,
                        label.last.device_time.ns, parameters_text(*label.fault, label.first), label.first.run,
                        word(label.state), size_text(label.effect.attitude), size_text(label.effect.velocity),
                        size_text(label.effect.position));
  }
  for (const auto& [imu, terms] : drawn) {
    if (seed) text += fmt::format("{},", *seed);
    text += fmt::format(",{},{},{},,,,,,,,,,{},,drawn,,,\n", csv_field(imu), terms.sensor, terms.layer,
                        csv_field(terms.text()));
  }
  return text;
}

std::string labels_json(std::span<const FaultLabel> labels, std::span<const DrawnLabel> drawn,
                        std::optional<std::uint64_t> seed) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const FaultLabel& label : labels) {
    nlohmann::ordered_json parameters = nlohmann::ordered_json::object();
    const std::uint64_t lost = lost_by(label);
    const bool has_samples = label.state != FaultLabel::State::never && lost == 0;
    for (std::size_t i = 0; i < label.fault->kind->parameters.size() && has_samples; ++i)
      parameters[std::string(label.fault->kind->parameters[i].key)] = label.first.parameters[i];
    nlohmann::ordered_json& one = all.emplace_back(nlohmann::ordered_json::object());
    if (seed) one["seed"] = *seed;
    one.update({{"fault", label.fault->name},
                {"imu", label.imu},
                {"target", label.fault->target_text()},
                {"kind", label.fault->kind->name}});
    if (!has_samples) {
      if (lost > 0) one["occurrence"] = lost;
      one["state"] = word(label.state);
      continue;
    }
    one.update({{"occurrence", label.first.occurrence},
                {"first_sample", label.first.sample},
                {"last_sample", label.last.sample},
                {"first_counter", label.first.counter},
                {"last_counter", label.last.counter},
                {"begin_s", label.first.time_s},
                {"end_s", label.last.time_s},
                {"first_time_ns", label.first.device_time.ns},
                {"last_time_ns", label.last.device_time.ns},
                {"parameters", std::move(parameters)},
                {"run", label.first.run},
                {"state", word(label.state)}});
    const auto add_error = [&](const char* key, double size) {
      if (size >= 0) one[key] = size;
    };
    add_error("attitude_error_rad", label.effect.attitude);
    add_error("velocity_error_m_per_s", label.effect.velocity);
    add_error("position_error_m", label.effect.position);
  }
  for (const auto& [imu, terms] : drawn) {
    nlohmann::ordered_json& one = all.emplace_back(nlohmann::ordered_json::object());
    if (seed) one["seed"] = *seed;
    one.update({{"fault", nullptr}, {"imu", imu}, {"target", terms.sensor}, {"kind", terms.layer}});
    for (const auto& [name, values] : terms.terms) one["parameters"][std::string(name)] = values;
    one["state"] = "drawn";
  }
  return all.dump(1) + "\n";
}

}  // namespace imud
