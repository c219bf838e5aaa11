#include "emulator/web/metrics.hpp"

#include <fmt/format.h>

#include <array>
#include <iterator>
#include <limits>
#include <set>

namespace imud {
namespace {

// Escapes a label's value or a help text: backslash, line feed and, unless `keeps_quotes`, quote (section 3.2.2).
std::string escaped(std::string_view text, bool keeps_quotes = false) {
  std::string out;
  for (const char c : text) {
    if (c == '\\' || (c == '"' && !keeps_quotes)) out += '\\';
    if (c == '\n')
      out += "\\n";
    else
      out += c;
  }
  return out;
}

// An upper limit of a histogram's bucket, with its canonical text (section 4.4.2).
struct Limit {
  double seconds;
  std::string_view text;
};
constexpr auto limits = std::to_array<Limit>({
    {1e-6, "1e-06"},
    {2e-6, "2e-06"},
    {5e-6, "5e-06"},
    {1e-5, "1e-05"},
    {2e-5, "2e-05"},
    {5e-5, "5e-05"},
    {1e-4, "0.0001"},
    {2e-4, "0.0002"},
    {5e-4, "0.0005"},
    {1e-3, "0.001"},
    {2e-3, "0.002"},
    {5e-3, "0.005"},
    {1e-2, "0.01"},
    {2e-2, "0.02"},
    {5e-2, "0.05"},
    {0.1, "0.1"},
    {0.2, "0.2"},
    {0.5, "0.5"},
    {1, "1.0"},
    {2, "2.0"},
    {5, "5.0"},
    {10, "10.0"},
    {std::numeric_limits<double>::infinity(), "+Inf"},
});
constexpr auto limits_s = [] {
  std::array<double, limits.size()> all{};
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = limits[i].seconds;
  return all;
}();

class Text {
 public:
  explicit Text(MetricsFormat format) : format_(format) {}
  // Begins a metric family. `unit` is a suffix of the name, or empty. The text format has neither units nor the
  // type info, and gives the family of a counter the name of its values.
  void family(std::string_view family_name, std::string_view type, std::string_view help,
              std::string_view unit = {}) {
    const bool is_open = format_ == MetricsFormat::open_metrics;
    const std::string name = fmt::format("{}{}", family_name,
                                         is_open             ? ""
                                         : type == "counter" ? "_total"
                                         : type == "info"    ? "_info"
                                                             : "");
    fmt::format_to(std::back_inserter(out_), "# TYPE {} {}\n", name, !is_open && type == "info" ? "gauge" : type);
    if (is_open && !unit.empty()) fmt::format_to(std::back_inserter(out_), "# UNIT {} {}\n", name, unit);
    const bool keeps_quotes = !is_open;
    fmt::format_to(std::back_inserter(out_), "# HELP {} {}\n", name, escaped(help, keeps_quotes));
  }
  // `labels` is empty, or has each label as name="value", separated by commas.
  template <class Number>
  void value(std::string_view name, std::string_view labels, Number number) {
    if (labels.empty())
      fmt::format_to(std::back_inserter(out_), "{} {}\n", name, number);
    else
      fmt::format_to(std::back_inserter(out_), "{}{{{}}} {}\n", name, labels, number);
  }
  template <class Number>
  void gauge(const std::string& name, Number number, std::string_view help, std::string_view unit = {}) {
    family(name, "gauge", help, unit);
    value(name, "", number);
  }
  std::string finish() { return std::move(out_) + (format_ == MetricsFormat::open_metrics ? "# EOF\n" : ""); }

 private:
  const MetricsFormat format_;
  std::string out_;
};

// The figures of a group with the labels of its owner.
struct Labelled {
  std::string labels;
  const SnapshotValues* values;
};

// Returns the name of a figure in SI units: "lateness_us" becomes a name in seconds.
std::string si_name(std::string_view key) {
  constexpr std::string_view microseconds = "_us";
  if (!key.ends_with(microseconds)) return std::string(key);
  key.remove_suffix(microseconds.size());
  return std::string(key) + "_seconds";
}
std::string help_of(std::string_view key) { return fmt::format("{} of the summary, in SI", key); }
std::string_view unit_of(std::string_view name) { return name.ends_with("_seconds") ? "seconds" : ""; }

void add_counters(Text& text, const std::string& prefix, const CounterGroup& declared,
                  const std::vector<Labelled>& owners) {
  for (std::size_t i = 0; i < declared.counters.size(); ++i) {
    const CounterInfo& info = declared.counters[i]->info;
    const std::string name = prefix + std::string(info.key);
    text.family(name, info.may_fall ? "gauge" : "counter", info.words);
    for (const Labelled& owner : owners)
      text.value(info.may_fall ? name : name + "_total", owner.labels, owner.values->counts[i]);
  }
}

void add_levels(Text& text, const std::string& prefix, const CounterGroup& declared,
                const std::vector<Labelled>& owners) {
  for (std::size_t i = 0; i < declared.levels.size(); ++i) {
    const std::string name = prefix + si_name(declared.levels[i]->key);
    text.family(name, "gauge", help_of(declared.levels[i]->key), unit_of(name));
    for (const Labelled& owner : owners) text.value(name, owner.labels, owner.values->levels[i]);
  }
}

void add_histogram(Text& text, const std::string& name, const std::string& labels,
                   const DurationHistogram& durations) {
  const std::vector<std::uint64_t> counts = durations.counts_up_to(limits_s);
  for (std::size_t k = 0; k < limits.size(); ++k)
    text.value(name + "_bucket", fmt::format("{}{}le=\"{}\"", labels, labels.empty() ? "" : ",", limits[k].text),
               counts[k]);
  text.value(name + "_sum", labels, durations.sum());
  text.value(name + "_count", labels, counts.back());
}

void add_histograms(Text& text, const std::string& prefix, const CounterGroup& declared,
                    const std::vector<Labelled>& owners) {
  for (std::size_t i = 0; i < declared.durations.size(); ++i) {
    const std::string name = prefix + si_name(declared.durations[i]->key);
    text.family(name, "histogram", help_of(declared.durations[i]->key), unit_of(name));
    for (const Labelled& owner : owners) add_histogram(text, name, owner.labels, owner.values->durations[i]);
  }
}

// The figures that products declare: an imu has its product's figures only.
void add_device_counters(Text& text, const std::string& prefix, const Summary& summary) {
  std::set<std::string_view> done;
  for (const Summary::Imu& first : summary.imus)
    for (const DeviceCount& declared : first.device) {
      if (!done.insert(declared.key).second) continue;
      const std::string name = prefix + std::string(declared.key);
      text.family(name, "counter", declared.words);
      for (const Summary::Imu& imu : summary.imus)
        for (const DeviceCount& figure : imu.device)
          if (figure.key == declared.key)
            text.value(name + "_total", fmt::format("imu=\"{}\"", escaped(imu.name)), figure.count);
    }
}

void add_imus(Text& text, const Summary& summary) {
  const std::string prefix = "imud_imu_";
  std::vector<Labelled> imus;
  for (const Summary::Imu& imu : summary.imus)
    imus.push_back({fmt::format("imu=\"{}\"", escaped(imu.name)), &imu.counters});
  const ImuCounters& declared = Snapshot<ImuCounters>::declared();
  add_counters(text, prefix, declared, imus);
  add_device_counters(text, prefix, summary);
  add_levels(text, prefix, declared, imus);
  add_histograms(text, prefix, declared, imus);
  text.family(prefix + "line_load_ratio", "gauge",
              "share of its line or bus that the imu occupies, if that has a rate", "ratio");
  for (std::size_t i = 0; i < imus.size(); ++i)
    if (const double percent = summary.imus[i].line_load_percent; percent > 0)
      text.value(prefix + "line_load_ratio", imus[i].labels, percent / 100);
}

}  // namespace

MetricsFormat metrics_format(std::string_view accept) noexcept {
  return accept.find("application/openmetrics-text") != accept.npos ? MetricsFormat::open_metrics
                                                                    : MetricsFormat::text;
}

std::string_view media_type(MetricsFormat format) noexcept {
  return format == MetricsFormat::open_metrics ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
                                               : "text/plain; version=0.0.4; charset=utf-8";
}

std::string metrics(const Summary& summary, MetricsFormat format) {
  Text text(format);
  text.family("imud", "info", "the program");
  text.value("imud_info", "version=\"" IMUD_VERSION "\"", 1);
  text.gauge("imud_run_seconds", summary.duration_s, "host time since the run began", "seconds");
  text.gauge("imud_simulated_seconds", summary.simulated_s, "simulation time that truth has covered", "seconds");

  const Summary::Truth& truth = summary.truth;
  const std::string prefix = "imud_truth_";
  add_counters(text, prefix, truth.counters.declared(), {{"", &truth.counters}});
  text.family(prefix + "refused", "counter", "truths refused, by cause");
  const auto& causes = truth.refused.declared().counters;
  for (std::size_t i = 0; i < causes.size(); ++i)
    text.value(prefix + "refused_total", fmt::format("cause=\"{}\"", causes[i]->info.key), truth.refused.counts[i]);
  add_counters(text, prefix, truth.quality.declared(), {{"", &truth.quality}});
  if (truth.has_clock) {
    add_levels(text, prefix, truth.quality.declared(), {{"", &truth.quality}});
    add_histograms(text, prefix, truth.quality.declared(), {{"", &truth.quality}});
  }
  text.gauge(prefix + "rate_hertz", truth.rate_hz, "truths accepted in a second, by their arrivals", "hertz");
  if (truth.since_newest_s)
    text.gauge(prefix + "since_newest_seconds", *truth.since_newest_s,
               "host time since the newest accepted truth arrived", "seconds");
  text.gauge(prefix + "longest_gap_seconds", truth.longest_gap_s, "the longest step of truth's time that was a gap",
             "seconds");
  if (truth.progress)
    text.gauge(prefix + "progress_ratio", *truth.progress, "how much of the capture has been read", "ratio");

  add_imus(text, summary);
  if (const auto& clock = summary.clock) {
    add_counters(text, "imud_clock_", clock->counters.declared(), {{"", &clock->counters}});
    add_levels(text, "imud_clock_", clock->counters.declared(), {{"", &clock->counters}});
    if (clock->state) {
      text.gauge("imud_clock_synchronised", clock->state->is_synchronised ? 1 : 0,
                 "1: the epoch's clock is synchronised");
      if (clock->state->error == 0)
        text.gauge("imud_clock_error_seconds", 1e-6 * static_cast<double>(clock->state->error_us),
                   "estimated error of the epoch's clock", "seconds");
    }
  }
  if (summary.has_record) add_counters(text, "imud_record_", summary.record.declared(), {{"", &summary.record}});
  if (summary.has_control) add_counters(text, "imud_control_", summary.control.declared(), {{"", &summary.control}});
  return text.finish();
}

}  // namespace imud
