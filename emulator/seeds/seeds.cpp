#include "emulator/seeds/seeds.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <csignal>
#include <exception>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/numbers/number_text.hpp"
#include "emulator/config/scenario.hpp"
#include "emulator/drive/begun_faults.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/exit_code.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/plural.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/seed_arrays.hpp"
#include "emulator/seeds/seed_checks.hpp"
#include "emulator/seeds/seed_results.hpp"
#include "emulator/seeds/seed_run.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "emulator/truth/remark_text.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

using Json = nlohmann::ordered_json;

// The runs, and their shared data.
class Runs {
 public:
  Runs(const Config& config, const RunOptions& options, const SeedsOptions& seeds)
      : config_(config),
        options_(options),
        seeds_(seeds.seeds.value_or(SeedRange{config.seed, config.seed})),
        width_(fmt::formatted_size("{}", seeds_.last)),
        truths_(options.repeats ? std::nullopt : store_truths(config.truth)) {
    if (truths_) config_.truth.format = &truths_->format();
    if (!options.repeats) config_.control.faults = false;  // nobody controls these runs
    for (const ImuConfig& imu : config.imus) line_loads_.push_back(imu.load.percent);
    if (seeds.npy.empty()) return;
    const std::vector<FaultConfig> begun = options.repeats ? begun_faults(config_) : std::vector<FaultConfig>();
    arrays_ = std::make_unique<SeedArrays>(config_, seeds.npy, begun);
    arrays_->begin(config_, {seeds_.first, seeds_.size(), origin_of(config, options)}, run_for_arrays());
    for (std::uint64_t i = 0; i < seeds_.size(); ++i) done_ += arrays_->is_done(i) ? 1U : 0U;
    if (done_ > 0) spdlog::info("{} of {} runs are in the arrays already; the others follow", done_, seeds_.size());
  }

  // Divides the runs into items of work: seeds that run together, because they share the truth and the instants of
  // samples; or each imu of a seed, if `jobs` are more than the seeds.
  void divide(unsigned jobs) noexcept {
    constexpr std::size_t most_imus = 8;  // in an engine: 4 and 8 take the same time, 16 and 32 more
    constexpr std::uint64_t per_job = 4;  // items, so that all jobs end at about the same time
    const std::uint64_t most_together = std::max<std::size_t>(1, most_imus / config_.imus.size());
    together_ = std::clamp<std::uint64_t>(seeds_.size() / (per_job * jobs), 1, most_together);
    // The faults of the truth are drawn by the seed of the run.
    if (std::ranges::any_of(config_.faults, [](const FaultConfig& f) { return f.acts_on(fault_of_truth); }))
      together_ = 1;
    if (done_ > 0) together_ = 1;
    for (std::uint64_t i = 0; done_ > 0 && i < seeds_.size(); ++i)
      if (!arrays_->is_done(i)) missing_.push_back(seeds_.first + i);
    parts_ = seeds_.size() - done_ < jobs && options_.required.empty() && truths_ && truths_->ascend()
                 ? config_.imus.size()
                 : 1;
  }
  std::size_t items() const noexcept {
    return (done_ > 0 ? missing_.size() : (seeds_.size() + together_ - 1) / together_) * parts_;
  }
  std::uint64_t seeds() const noexcept { return seeds_.size(); }
  std::size_t runs() const noexcept { return (seeds_.size() - done_) * parts_; }
  std::size_t parts() const noexcept { return parts_; }
  std::size_t runs_of(std::size_t item) const noexcept { return seeds_of(item).size(); }

  // Called when the item is done and the arrays have its rows.
  void mark(std::size_t item) noexcept {
    const SeedRange seeds = seeds_of(item);
    const std::uint64_t before = seeds.first - seeds_.first;
    for (std::uint64_t i = 0; arrays_ && i < seeds.size(); ++i)
      for (std::size_t imu = 0; imu < config_.imus.size(); ++imu)
        if (parts_ == 1 || imu == item % parts_) arrays_->mark(imu, before + i);
  }
  void commit() {
    if (arrays_) arrays_->commit();
  }
  // Leaves the arrays behind, so that the same command can complete them later, and logs this.
  void keep() noexcept {
    const std::string left = arrays_ ? arrays_->keep() : std::string();
    if (!left.empty()) spdlog::warn("{} is incomplete: the same command does the runs that are missing", left);
  }

  // Runs an item. Returns the summaries of its runs as a JSON array in one line. Throws std::runtime_error; if a
  // port is at fault, the error names the seed.
  std::string work(std::size_t item) const;

 private:
  SeedRun seed_run() const {
    SeedRun run{.truths = truths_ ? &*truths_ : nullptr, .repeats = options_.repeats};
    if (options_.duration_s) run.limits.duration = nanoseconds(*options_.duration_s);
    return run;
  }
  SeedRange seeds_of(std::size_t item) const noexcept {
    if (done_ > 0) return {missing_[item / parts_], missing_[item / parts_]};
    const std::uint64_t before = item / parts_ * together_;
    return {seeds_.first + before, seeds_.first + std::min(before + together_, seeds_.size()) - 1};
  }
  // The runs of an item.
  struct Batch {
    Config config;  // of one seed
    std::vector<double> line_loads;
    std::vector<SeedArrays::Rows> rows;  // by seed, and by imu
    HostTime begin;
  };
  // Returns the measurements of each imu of the runs if faults change the measurements of an imu; otherwise an empty
  // list.
  std::vector<std::vector<MadeRow>> made_by(const Config& config, std::size_t part) const {
    bool any = false;
    for (std::size_t i = 0; arrays_ && i < config_.imus.size(); ++i)
      any = any || (arrays_->is_changed(i) && (parts_ == 1 || i == part));
    return any ? made_rows(config, run_for_arrays()) : std::vector<std::vector<MadeRow>>();
  }
  // Returns the truth at the measurements of each imu of the runs, and at the samples where faults change the
  // measurements, if the instants of an imu vary with the seed; otherwise an empty list. `of_seed`: the number of
  // imus of each seed.
  std::vector<RunTruth::OfImu> truths_by(const Config& config, std::size_t part, std::size_t of_seed) const {
    const auto wanders = [&](std::size_t i) { return arrays_ && arrays_->wanders(part + i % of_seed); };
    const auto keeps_samples = [&](std::size_t i) { return wanders(i) && arrays_->is_changed(part + i % of_seed); };
    bool any = false;
    for (std::size_t i = 0; i < of_seed; ++i) any = any || wanders(i);
    return any ? truth_of_run(config, run_for_arrays(), keeps_samples).imus : std::vector<RunTruth::OfImu>();
  }
  std::string end(Batch& batch, std::size_t run, Engine& engine, const std::string& difference,
                  std::size_t part) const;
  std::vector<FaultLabel> labels(const Batch& batch, std::size_t run, Engine& engine, std::size_t part) const;
  SeedArrays::Run run_for_arrays() const {
    return [this](const Config& config, const Ports& ports, const auto& awaits_truth) {
      const std::atomic<bool> no_stop = false;
      std::string cause;
      SeedRun of_arrays = seed_run();
      of_arrays.limits.awaits_truth = awaits_truth;
      of_arrays.run(config, ports, no_stop, [&](Engine& engine, const std::string&) {
        imud::commit(engine.channels());
        cause = fmt::format("{}", fmt::join(remarks(engine.intake().counters()), "; "));
      });
      return cause;
    };
  }

  Config config_;
  const RunOptions& options_;
  const SeedRange seeds_;
  const std::size_t width_;  // digits of a seed
  std::optional<StoredTruths> truths_;
  std::vector<double> line_loads_;
  std::unique_ptr<SeedArrays> arrays_;
  std::uint64_t together_ = 1;          // seeds of an item
  std::size_t parts_ = 1;               // of a seed
  std::uint64_t done_ = 0;              // seeds that the arrays have already
  std::vector<std::uint64_t> missing_;  // the seeds that the arrays do not have, if they have some
};

std::string Runs::work(std::size_t item) const {
  const SeedRange seeds = seeds_of(item);
  const std::size_t part = item % parts_;
  Batch batch{config_, line_loads_, {}, host_now()};
  if (parts_ > 1) {
    batch.config.imus = {config_.imus[part]};
    batch.line_loads = {line_loads_[part]};
  }
  const std::vector<ImuConfig>& imus = batch.config.imus;
  Config all = batch.config;
  all.seed = seeds.first;  // this seed draws the faults of the truth
  all.imus.clear();
  batch.rows.reserve(seeds.size() * imus.size());
  for (std::uint64_t i = 0; i < seeds.size() * imus.size(); ++i) {
    ImuConfig& imu = all.imus.emplace_back(imus[i % imus.size()]);
    imu.seed = seeds.first + i / imus.size();
  }
  auto made = made_by(all, part);
  auto truths = truths_by(all, part, imus.size());
  for (std::uint64_t i = 0; i < seeds.size() * imus.size(); ++i) {
    ImuConfig& imu = all.imus[i];
    if (arrays_) {
      batch.rows.emplace_back(*arrays_, part + i % imus.size(), *imu.seed - seeds_.first,
                              made.empty() ? std::vector<MadeRow>() : std::move(made[i]),
                              truths.empty() ? RunTruth::OfImu() : std::move(truths[i]));
      imu.also.clear();
    } else {
      const std::string seed = fmt::format("{:0{}}", *imu.seed, width_);
      boost::replace_all(imu.port, seed_placeholder, seed);
      boost::replace_all(imu.second_port, seed_placeholder, seed);
      for (std::string& copy : imu.also) boost::replace_all(copy, seed_placeholder, seed);
    }
  }
  const auto ports = [&](const PortUse& use) -> std::unique_ptr<Port> {
    if (arrays_)
      return use.of == PortUse::Of::line && use.number == 0 ? batch.rows[use.imu].port() : std::make_unique<NoPort>();
    try {
      return real_ports(use);
    } catch (const PortError& error) {
      throw std::runtime_error(fmt::format("seed {}: {}", *all.imus[use.imu].seed, error.what()));
    }
  };
  std::vector<std::string> summaries;
  std::string failure;
  seed_run().run(all, ports, workers_stop(), [&](Engine& engine, const std::string& difference) {
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      batch.config.seed = seeds.first + i;
      try {
        summaries.push_back(end(batch, i, engine, difference, part));
      } catch (const std::exception& error) {  // other seeds have their own runs
        if (failure.empty()) failure = fmt::format("seed {}: {}", batch.config.seed, error.what());
      }
    }
  });
  if (!failure.empty()) throw std::runtime_error(failure);
  return fmt::format("[{}]", fmt::join(summaries, ","));
}

// Ends the run number `run` of a batch, with its Batch::config; returns its summary.
std::string Runs::end(Batch& batch, std::size_t run, Engine& engine, const std::string& difference,
                      std::size_t part) const {
  const std::size_t imus = batch.config.imus.size();
  const auto channels = engine.channels().subspan(run * imus, imus);
  Summary summary = judge_run(engine,
                              {.config = batch.config,
                               .channels = channels,
                               .line_loads = batch.line_loads,
                               .begin = batch.begin,
                               .is_stopped = workers_stop(),
                               .required = options_.required,
                               .repeats = options_.repeats},
                              difference);
  Outcome& outcome = summary.whole->outcome;
  std::vector<FaultLabel> all = labels(batch, run, engine, part);
  std::vector<FaultOutcome> faults = fault_outcomes(engine.faults().configured(), all);
  if (parts_ == 1)
    outcome.judge_faults(std::move(faults), options_.repeats);
  else
    outcome.faults = std::move(faults);  // SeedResults judges the faults of all parts
  if (std::string lost = lost_text(all); !lost.empty() && !options_.labels_file.empty())
    outcome.shortfalls.push_back(std::move(lost));
  if (outcome.ended_by != EndedBy::failure) imud::commit(channels);
  if (arrays_)
    for (SeedArrays::Rows& rows : std::span(batch.rows).subspan(run * imus, imus))
      if (const std::string missing = rows.finish(); !missing.empty()) outcome.shortfalls.push_back(missing);
  const std::string text = json(summary, JsonLayout::line);
  if (options_.labels_file.empty()) return text;
  Json with_labels = Json::parse(text);
  add_never_begun(engine.faults().configured(), all);
  std::erase_if(all, [&](const FaultLabel& label) {
    const auto has_label = [&](const ImuConfig& imu) { return imu.name == label.imu; };
    return label.imu == fault_of_truth ? part > 0 : std::ranges::none_of(batch.config.imus, has_label);
  });
  const auto to_text = options_.labels_file.ends_with(".json") ? labels_json : labels_csv;
  with_labels["labels"] = {
      {"part", part}, {"text", to_text(all, drawn_labels(batch.config.imus, batch.config.seed), batch.config.seed)}};
  return with_labels.dump();
}

std::vector<FaultLabel> Runs::labels(const Batch& batch, std::size_t run, Engine& engine, std::size_t part) const {
  std::vector<std::string> names;
  for (const auto& channel : engine.channels()) names.push_back(channel->name);
  const std::size_t first = run * batch.config.imus.size(), end = first + batch.config.imus.size();
  std::vector<FaultLabel> all = fault_labels(engine.faults().all(), names, engine.faults().log());
  // Each part of a run has the faults of its truth.
  std::erase_if(all, [&](const FaultLabel& label) {
    return label.first.imu == truth_number ? part > 0 : label.first.imu < first || label.first.imu >= end;
  });
  return all;
}

// Writes a summary that names the failure, which is more important than another one of this write.
void write_failure(TextFile& summary_file, const std::exception& error) noexcept {
  try {
    const Json summary = {
        {"complete", false}, {"ended_by", "failure"}, {"exit_code", 1}, {"shortfalls", Json::array({error.what()})}};
    summary_file.replace(summary.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  } catch (const std::exception&) {
  }
}

}  // namespace

std::optional<SeedRange> SeedRange::parse(std::string_view text) noexcept {
  constexpr std::uint64_t most = 10'000'000;
  SeedRange range;
  if (const auto several = range_in<std::uint64_t>(text, ".."))
    range = {several->first, several->second};
  else if (const auto one = number_in<std::uint64_t>(text))
    range = {*one, *one};
  else
    return std::nullopt;
  if (range.last - range.first >= most) return std::nullopt;
  return range;
}

int replay_seeds(const Config& config, const RunOptions& options, const SeedsOptions& seeds) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  const HostTime begin = host_now();
  for (const std::string& warning : config.warnings) spdlog::warn("{}", warning);
  check_figures(options.required, config);
  check_begins_by_host(config, options.repeats);
  check_seed_ports(config, options.repeats, seeds.seeds && seeds.seeds->size() > 1, !seeds.npy.empty());
  check_seed_files(config, options, seeds.npy);
  TextFile summary_file(options.summary_file), labels_file(options.labels_file);
  std::optional<Runs> begun;
  try {
    begun.emplace(config, options, seeds);
  } catch (const OpenError&) {
    throw;  // it cannot begin, as below
  } catch (const PortError&) {
    throw;
  } catch (const ConfigError&) {
    throw;
  } catch (const std::runtime_error& error) {
    write_failure(summary_file, error);
    throw;
  }
  Runs& runs = *begun;
  const unsigned jobs = seeds.jobs > 0 ? seeds.jobs : usable_processors();
  runs.divide(jobs);
  // All is open. A command that cannot begin leaves the results of the command before as they are.
  if (summary_file.is_regular()) summary_file.replace("{\"complete\": false, \"ended_by\": null}\n");
  labels_file.replace("");
  bool is_whole = false;
  SeedResults results(!options.summary_file.empty(), runs.parts(), config.faults);
  ProgressLine progress(!seeds.quiet);
  std::size_t done = 0;
  try {
    is_whole = run_workers({.jobs = jobs,
                            .work = [&](std::size_t item) { return runs.work(item); },
                            .take =
                                [&](std::size_t item, const std::string& text) {
                                  if (!results.add(text)) return;
                                  done += runs.runs_of(item);
                                  runs.mark(item);
                                },
                            .tick = [&] { progress.show(done, runs.runs(), "runs"); }},
                           runs.items());
    progress.clear();
    is_whole ? runs.commit() : runs.keep();
  } catch (const std::exception& error) {
    runs.keep();
    write_failure(summary_file, error);
    throw;
  }

  const double duration_s = seconds(host_now() - begin);
  if (!is_whole) spdlog::error("incomplete: a signal ended it after {} of {} runs", done, runs.runs());
  // A result that cannot be written is a failure, but the other results are written.
  std::exception_ptr failure;
  Json failures = Json::array();
  const auto attempt = [&](const auto& write) {
    try {
      write();
    } catch (const std::exception& error) {
      if (!failure) failure = std::current_exception();
      failures.push_back(error.what());
    }
  };
  if (!options.labels_file.empty())
    attempt([&] { labels_file.replace(results.labels(options.labels_file.ends_with(".json"))); });
  const int exit_code_of_runs = worse_exit_code(results.exit_code(), is_whole ? 0 : 3);
  TextFile printed = options.summary_file == "-" ? TextFile::standard_error() : TextFile("-");
  attempt([&] {
    printed.write(fmt::format("ran      {:.3f} s, {} runs of {}, {} samples, {:.3g} samples/s\n", duration_s, done,
                              plural(runs.seeds(), "seed"), results.samples(),
                              static_cast<double>(results.samples()) / duration_s));
    printed.write(fmt::format("ended    by {}, {}\n", is_whole ? "end_of_capture" : "signal",
                              exit_code_of_runs == 0 && !failure ? "complete" : "incomplete or failed"));
  });
  // Last: it says that the runs are complete.
  const int exit_code = failure ? 1 : exit_code_of_runs;
  Json all = {{"duration_s", duration_s},
              {"exit_code", exit_code},
              {"complete", exit_code == 0},
              {"ended_by", is_whole ? "end_of_capture" : "signal"},
              {"version", IMUD_VERSION},
              {"config_sha256", config.sha256},
              {"jobs", jobs},
              {"seeds", Json::array()}};
  if (failure) all["shortfalls"] = failures;
  for (const auto& [seed, summary] : results.by_seed()) all["seeds"].push_back(summary);
  attempt([&] { summary_file.replace(all.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"); });
  if (failure) std::rethrow_exception(failure);
  return exit_code;
}

}  // namespace imud
