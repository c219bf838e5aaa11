#include "emulator/truth/capture_check.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/timeline.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/recorded_config.hpp"
#include "emulator/truth/place_watch.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

// Decodes the truths of a capture, except other vehicles' truths.
class Truths {
 public:
  explicit Truths(const TruthConfig& config)
      : port_(open_port(config.port, config.port_settings)),
        decoder_(config.format->make(config.settings)),
        stream_(config.stream) {
    const bool keeps_datagrams = port_->keeps_datagrams().value_or(transport_of(config.port)->keeps_datagrams);
    input_ = keeps_datagrams ? TruthInput::datagram : TruthInput::stream;
  }
  // Returns the next truth; nullopt at the end.
  std::optional<Truth> next() {
    for (Truth truth;;) {
      if (const auto result = decoder_->next(truth)) {
        if (*result != TruthResult::ok && *result != TruthResult::no_state) keep_refusal(*result);
        if (*result != TruthResult::ok) continue;
        if (!stream_) stream_ = truth.stream;
        if (truth.stream == *stream_) return truth;
      } else if (const auto received = port_->receive()) {
        decoder_->feed(received->frame.bytes, received->is_piece ? TruthInput::stream : input_, received->time);
      } else if (!port_->at_end()) {
        if (pollfd ready{port_->descriptor(), POLLIN, 0}; ready.fd >= 0) ::poll(&ready, 1, 100);
      } else if (!std::exchange(has_ended_, true)) {
        if (input_ == TruthInput::stream) decoder_->end_of_file();
      } else {
        return std::nullopt;
      }
    }
  }
  // Returns a colon and what the capture has in place of truth, after next() has returned nullopt; or an empty text.
  std::string found_instead() const {
    if (const std::string_view content = port_->other_content(); !content.empty())
      return fmt::format(": {}", content);
    return refusal_.empty() ? refusal_ : ": " + refusal_;
  }

 private:
  // Keeps the remark on the first record that is refused.
  void keep_refusal(TruthResult result) {
    std::array<char, 1024> text;
    if (refusal_.empty()) refusal_.assign(text.data(), decoder_->describe(result, text));
  }

  std::unique_ptr<Port> port_;
  std::unique_ptr<TruthDecoder> decoder_;
  std::optional<std::uint32_t> stream_;
  TruthInput input_ = TruthInput::stream;
  bool has_ended_ = false;
  std::string refusal_;
};

// Returns the earliest begin that can be drawn, in s after a run's begin; 0 if there is no such bound.
double earliest_begin_s(const FaultConfig& fault) {
  const bool is_bounded = fault.begin_s.law != FaultNumber::Law::normal && !fault.begin_sample;
  return is_bounded && !fault.is_optional ? fault.begin_s.a : 0;
}

void compare_place(const TruthConfig& config, const Truth& first, std::vector<std::string>& warnings) {
  const PlaceWatch watch(config);
  std::array<char, 1000> text;
  if (const std::size_t size = watch.describe_place(first, text); size > 0)
    warnings.push_back(fmt::format("truth: {}", std::string_view(text.data(), size)));
  if (const std::size_t size = watch.describe_date(first, text); size > 0)
    warnings.push_back(fmt::format("truth: {}", std::string_view(text.data(), size)));
}

// Returns whether the truth can be read now and again.
bool is_file(const std::string& port) { return is_capture(port) && !file_of(port).empty(); }

bool is_folder(const std::string& port) {
  std::error_code none;
  return is_capture(port) && std::filesystem::is_directory(path_of(port), none);
}

}  // namespace

CapturePort::CapturePort(const std::string& capture, const std::string& config) {
  if (capture == "-" && config == "-")
    throw PortError("standard input is the configuration already; give a file as the capture");
  port = capture == "-" || capture.empty() ? capture : capture_port(capture);
  const Transport* transport = transport_of(port);
  repeats = port != capture && transport != nullptr && transport->is_record != nullptr &&
            port.find('?') == std::string::npos;
}

CaptureFindings check_capture(const Config& config) {
  CaptureFindings findings;
  if (!is_file(config.truth.port) && !is_folder(config.truth.port)) return findings;
  double last_begin_s = 0;
  for (const FaultConfig& fault : config.faults) last_begin_s = std::max(last_begin_s, earliest_begin_s(fault));
  try {
    Truths truths(config.truth);
    std::optional<Truth> truth = truths.next();
    if (!truth) {
      findings.no_truth =
          fmt::format("truth: {} has no truth of the format {}{}; give another capture, or another truth.format",
                      config.truth.port, config.truth.format->name, truths.found_instead());
      return findings;
    }
    compare_place(config.truth, *truth, findings.warnings);
    TruthTime earliest = truth->time, latest = truth->time;
    const auto length_s = [&] { return seconds(latest - earliest); };
    for (std::size_t i = 1; truth && length_s() < last_begin_s; ++i) {
      if (i == most_truths_ahead) return findings;
      truth = truths.next();
      if (!truth) break;
      earliest = std::min(earliest, truth->time);
      latest = std::max(latest, truth->time);
    }
    for (const FaultConfig& fault : config.faults)
      if (const double begin_s = earliest_begin_s(fault); begin_s > length_s())
        findings.faults.push_back(
            fmt::format("fault {}: at_s = {:g} is after the end of the capture {}, which has {:.6g} s of truth; give "
                        "an earlier time, or optional = true",
                        fault.name, begin_s, config.truth.port, length_s()));
  } catch (const PortError& error) {  // who opens it for a run reports it
    findings.no_truth = fmt::format("truth: {}; give the path of a capture", error.what());
  }
  return findings;
}

CaptureLength capture_length(const Config& config) {
  constexpr Nanoseconds out_of_order = std::chrono::seconds(1);
  CaptureLength length;
  Nanoseconds sum{0};
  if (!is_file(config.truth.port)) return length;
  try {
    Truths truths(config.truth);
    std::optional<TruthTime> newest;
    for (std::size_t i = 0; const std::optional<Truth> truth = truths.next(); ++i) {
      if (i == most_truths_ahead) {
        length.is_whole = false;
        break;
      }
      const Nanoseconds step = newest ? truth->time - *newest : Nanoseconds{0};
      if (newest && step <= Nanoseconds{0} && step >= -out_of_order) continue;
      if (step > Nanoseconds{0} && step <= Timeline::Limits().max_gap) sum += step;
      newest = truth->time;
    }
  } catch (const PortError&) {  // who opens it for a run reports it
  }
  length.length_s = seconds(sum);
  return length;
}

void refuse_late_faults(const Config& config) {
  const auto is_late = [](const FaultConfig& fault) { return earliest_begin_s(fault) > 0; };
  if (std::none_of(config.faults.begin(), config.faults.end(), is_late)) return;
  if (const CaptureFindings findings = check_capture(config); !findings.faults.empty())
    throw ConfigError(findings.faults);
}

ReplayConfig load_replay(const std::string& path, std::span<const std::string> overrides, const std::string& capture,
                         std::span<const std::string> scenarios) {
  const CapturePort port(capture, path);
  ReplayConfig replay{load_config(path, overrides, port.port, scenarios), port.repeats};
  if (!replay.repeats) {
    refuse_late_faults(replay.config);
  } else if (!recorded_config(capture).value_or(std::string()).empty()) {
    std::vector<std::string> all = differences(replay.config, load_config(capture, overrides, port.port));
    for (std::string& difference : all)
      difference = fmt::format("{}: {}; give the same, or another by --set, or record:FILE for the truth alone",
                               capture, difference);
    if (!all.empty()) throw ConfigError(all);
  }
  return replay;
}

}  // namespace imud
