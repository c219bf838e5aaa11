#include "tools/truth/captured_truths.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "tools/setting_texts.hpp"
#include "tools/stop_signal.hpp"

namespace imud {
namespace {

const TruthFormat& format_of(const std::string& name) {
  if (const TruthFormat* format = find_truth_format(name)) return *format;
  std::vector<std::string_view> known;
  for (const TruthFormat* format : truth_formats()) known.push_back(format->name);
  for (const TruthLog* log : truth_logs()) known.push_back(log->name);
  throw std::invalid_argument(
      fmt::format("there is no truth format '{}'; right would be one of {}", name, fmt::join(known, ", ")));
}

}  // namespace

CapturedTruths::CapturedTruths(const Options& options) : stream_(options.stream) {
  bool derives = true;
  if (const TruthLog* log = find_truth_log(options.format)) {
    log_.emplace(log->read(options.capture, settings_from(log->settings, options.settings)));
    if (const std::uint64_t count = log_->log().without_position; count > 0) refused_["without position"] = count;
  } else {
    open_capture(options);
    derives = format_of(options.format).derives;
  }
  if (derives)
    derivation_.reset(new Derivation{PoseFit({.widest = 8, .gravitation = options.gravitation}),
                                     Timeline({.gap_begins_run = true})});
}

void CapturedTruths::open_capture(const Options& options) {
  const TruthFormat& format = format_of(options.format);
  decoder_ = format.make(settings_from(format.settings, options.settings));
  const std::string from = capture_port(options.capture);
  if (const Transport* transport = transport_of(from)) {
    const auto is_right = [&](const Transport& t) {
      return t.ends && t.brings_truth && (t.keeps_datagrams || format.delimits_itself);
    };
    if (!is_right(*transport))
      throw std::invalid_argument(fmt::format("{}: has no {} truth; right would be {}", options.capture, format.name,
                                              fmt::join(port_examples(is_right), " or ")));
    port_ = open_port(from, Role::listener);
    if (!port_->keeps_datagrams().value_or(transport->keeps_datagrams)) input_ = TruthInput::stream;
  } else {
    port_ = open_port(from, Role::listener);  // which throws
  }
}

std::optional<Truth> CapturedTruths::next() {
  Truth truth;
  while (!stop_requested()) {
    if (take_derived(truth)) return truth;
    const auto result = next_record(truth);
    if (!result) {
      if (feed_next()) continue;
      if (derivation_ == nullptr) break;
      derivation_->fit.finish();
      if (!take_derived(truth)) break;
      return truth;
    } else if (*result == TruthResult::ok) {
      if (stream_.value_or(truth.stream) != truth.stream) {
        ++of_other_vehicles_;
        continue;
      }
      stream_ = truth.stream;
      if (derivation_ == nullptr) return truth;
      derive(truth);
    } else if (*result != TruthResult::no_state) {
      refuse(*result);
    }
  }
  return std::nullopt;
}

std::optional<TruthResult> CapturedTruths::next_record(Truth& truth) {
  return log_ ? log_->next(truth) : decoder_->next(truth);
}

// Counts a refused record, and keeps the remark on the first one of its cause.
void CapturedTruths::refuse(TruthResult result) {
  ++refused_[cause(result)];
  if (decoder_ == nullptr || first_.contains(cause(result))) return;
  std::array<char, 1024> text;
  first_[cause(result)].assign(text.data(), decoder_->describe(result, text));
}

// Gives a truth to the fit, unless it is late.
void CapturedTruths::derive(Truth& truth) {
  const Admission admission = derivation_->order.push(truth);
  if (admission != Admission::accepted && admission != Admission::new_run) {
    ++refused_["late or repeated"];
    return;
  }
  truth.new_run = admission == Admission::new_run;
  const std::uint64_t outliers = derivation_->fit.outliers().count;
  derivation_->fit.push(truth);
  if (derivation_->fit.outliers().count != outliers) ++refused_["outlier"];
}

// Takes a truth from the fit. Returns false if the fit needs further truths first.
bool CapturedTruths::take_derived(Truth& truth) {
  while (derivation_ != nullptr && derivation_->fit.next(truth)) {
    if (is_finite(truth) && is_in_range(truth)) return true;
    ++refused_[cause(TruthResult::out_of_range)];
  }
  return false;
}

// Returns false at the end of the capture.
bool CapturedTruths::feed_next() {
  if (log_) return false;
  while (!stop_requested()) {
    if (const auto received = port_->receive()) {
      if (std::exchange(streams_, port_->counters().lost_count) != port_->counters().lost_count) decoder_->finish();
      decoder_->feed(received->frame.bytes, received->is_piece ? TruthInput::stream : input_, received->time);
      return true;
    }
    if (port_->at_end()) break;
    pollfd ready{port_->descriptor(), POLLIN, 0};
    if (ready.fd >= 0) ::poll(&ready, 1, 100);
  }
  if (!std::exchange(has_ended_, true) && input_ == TruthInput::stream) {
    decoder_->end_of_file();
    return true;
  }
  decoder_->finish();
  return false;
}

double CapturedTruths::progress() const noexcept { return log_ ? log_->progress() : port_->progress().value_or(0); }

std::string CapturedTruths::refused() const {
  std::string text;
  const auto add = [&](std::uint64_t count, std::string_view cause) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, cause);
  };
  for (const auto& [cause, count] : refused_) add(count, cause);
  if (decoder_ == nullptr) return text;
  add(decoder_->losses().too_long, "too long");
  add(decoder_->losses().cut_short, "cut short");
  for (const auto& [cause, remark] : first_)
    if (!remark.empty()) text += fmt::format("; the first {}: {}", cause, remark);
  return text;
}

std::string CapturedTruths::damage() const {
  if (log_) return log_->log().damage;
  std::string text(port_->end_warning());
  if (const std::uint64_t count = port_->counters().truncated; count > 0)
    text += fmt::format("{}{} truncated datagrams", text.empty() ? "" : ", ", count);
  return text;
}

}  // namespace imud
