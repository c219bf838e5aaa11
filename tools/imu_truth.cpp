// imu-truth: sends truth over UDP: analytic motions, or the datagrams of a capture.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/duration_text.hpp"
#include "tools/program.hpp"
#include "tools/stop_signal.hpp"
#include "tools/text_output.hpp"
#include "tools/truth/captured_truths.hpp"
#include "tools/truth/datagram_sender.hpp"
#include "tools/truth/motion.hpp"
#include "tools/truth/truth_csv.hpp"
#include "tools/truth/truth_logs.hpp"
#include "tools/truth/truth_source.hpp"
#include "transports/file/files_in_use.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr int incomplete = 3;

struct Options {
  std::string what;  // a motion, "capture" or "list"
  std::string capture;
  std::vector<std::string> settings;  // of the capture's truth format
  std::string to = "udp:127.0.0.1:9810";
  std::string csv_path, stamp;
  std::string format = "native";
  MotionTruths::Options motion;
  DatagramSender::Options sender;
  bool fast = false;
  bool lockstep = false;
  bool no_new_run = false;
};

constexpr struct {
  const char* option;
  double MotionParameters::*parameter;
  const char* help;
} motion_options[] = {
    {"--rate-rad-per-s", &MotionParameters::rate_rad_per_s, "angular rate, rad/s"},
    {"--half-angle-rad", &MotionParameters::half_angle_rad, "half-angle of the cone, rad"},
    {"--frequency-hz", &MotionParameters::frequency_hz, "frequency of the coning, Hz"},
    {"--acceleration-m-per-s2", &MotionParameters::acceleration_m_per_s2, "acceleration, m/s^2"},
    {"--jerk-m-per-s3", &MotionParameters::jerk_m_per_s3, "jerk, m/s^3"},
    {"--gravity-m-per-s2", &MotionParameters::gravity_m_per_s2,
     "gravity along +z of N (down), m/s^2; for the poses of a capture the default is that of WGS 84"},
};

std::string known_motions() {
  std::string text = "Motions:\n";
  for (const Motion& motion : motions()) text += fmt::format("  {:<12} {}\n", motion.name, motion.summary);
  return text +
         "  capture FILE the UDP datagrams of a capture, byte for byte: FILE.pcap, FILE.pcap?port=9810, "
         "FILE.pcap.gz;\n"
         "               with --csv its truths, or those of a file such as poses.tum, of any format, as truth CSV;\n"
         "               FLIGHT.ulg (PX4) and FLIGHT.mcap (ROS 2) are --format ulog and mcap\n";
}

// Returns true if the motion depends on the parameter.
bool uses(const Motion& motion, double MotionParameters::*parameter) {
  const TruthTime time{700'000'000};
  MotionParameters other;
  other.*parameter = 1.5 * other.*parameter + 0.1;
  return truth_csv_row(motion.at(time, {})) != truth_csv_row(motion.at(time, other));
}

void refuse_unused(const CLI::App& app, std::string_view why, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (app.get_option(name)->count() > 0) throw std::invalid_argument(fmt::format("{}: {}", name, why));
}

// Finds options that exclude one another, which CLI11 does not check.
void check(const CLI::App& app, Options& options) {
  const bool is_capture = options.what == "capture";
  if (is_capture) {
    if (options.capture.empty())
      throw std::invalid_argument("capture: no file is given; right would be capture FILE.pcap?port=N");
    refuse_unused(app, "a capture is sent as it is", {"--rate", "--start", "--no-new-run", "--lockstep", "--stamp"});
    if (options.csv_path.empty())
      refuse_unused(app, "a capture is sent as it is", {"--stream", "--format", "--set"});
    else
      refuse_unused(app, "with --csv a capture is converted whole", {"--for"});
    for (const auto& entry : motion_options)
      if (options.csv_path.empty() || entry.parameter != &MotionParameters::gravity_m_per_s2)
        refuse_unused(app, "a capture is sent as it is", {entry.option});
  } else {
    options.motion.motion = find_motion(options.what);
    if (options.motion.motion == nullptr)
      throw std::invalid_argument(fmt::format("there is no motion '{}'\n{}", options.what, known_motions()));
    refuse_unused(app, "only for the truths of a capture", {"--set"});
    if (options.format != "native" && options.format != "csv")
      throw std::invalid_argument(fmt::format("--format {}: a motion is sent as native or csv", options.format));
    if (!options.capture.empty())
      throw std::invalid_argument(options.capture + ": only 'capture' is followed by a file");
    for (const auto& entry : motion_options)
      if (app.get_option(entry.option)->count() > 0 && !uses(*options.motion.motion, entry.parameter))
        throw std::invalid_argument(fmt::format("{}: {} has no such parameter: {}", entry.option, options.what,
                                                options.motion.motion->summary));
  }
  if (!options.csv_path.empty())
    refuse_unused(app, "not with --csv, which sends nothing",
                  {"--to", "--fast", "--lockstep", "--no-new-run", "--drop", "--duplicate", "--reorder", "--jitter",
                   "--corrupt", "--stamp"});
  if (!options.csv_path.empty() && !is_capture)
    refuse_unused(app, "not with --csv, which sends nothing", {"--format", "--stream"});
  if (options.lockstep) {
    refuse_unused(app, "not in lockstep, where each datagram waits for the answer to the one before",
                  {"--reorder", "--stamp"});
    if (options.format != "native") throw std::invalid_argument("--lockstep: only native datagrams are answered");
  } else {
    refuse_unused(app, "only with --lockstep", {"--resend"});
  }
  if (options.format == "csv" && !is_capture)
    refuse_unused(app, "only for native datagrams", {"--stream", "--no-new-run", "--stamp"});
  if (options.fast) refuse_unused(app, "not with --fast, which sends without pacing", {"--jitter", "--stamp"});
  if (!options.stamp.empty()) static_cast<void>(clock_stamp(options.stamp, host_now()));
  if (!is_capture && !options.motion.for_s && ((options.fast && !options.lockstep) || !options.csv_path.empty()))
    throw std::invalid_argument("--for: must be given with --fast or --csv, as a motion has no end");

  if (const TruthLog* log = is_capture ? truth_log_of_file(options.capture) : nullptr;
      log != nullptr && app.get_option("--format")->count() == 0)
    options.format = log->name;
  options.motion.acknowledge = options.lockstep;
  options.motion.new_run = !options.no_new_run;
}

void print_line(std::string_view subject, std::string_view what) { fmt::print(stderr, "{:<12} {}\n", subject, what); }

// Flushes the CSV; throws std::runtime_error if it could not be written, unless its reader has gone.
void finish_csv(TextOutput& csv, const Options& options, std::uint64_t rows) {
  csv.flush();
  if (!csv.is_open() && csv.error() != EPIPE)
    throw std::runtime_error(fmt::format("{}: {}", options.csv_path, std::strerror(csv.error())));
  print_line("written", fmt::format("{} truths", rows));
}

int write_csv(const Options& options, bool& running) {
  TextOutput csv(options.csv_path);
  running = true;
  csv.write(truth_csv_header());
  MotionTruths truths(options.motion);
  std::uint64_t rows = 0;
  ProgressLine progress(!csv.is_terminal());
  while (!stop_requested() && csv.is_open()) {
    const auto truth = truths.next();
    if (!truth) break;
    csv.write(truth_csv_row(*truth));
    ++rows;
    if (progress.is_due()) progress.show(seconds(truths.offset()) / *options.motion.for_s, "the motion");
  }
  progress.clear();
  finish_csv(csv, options, rows);
  return 0;
}

// Writes the truths of a capture. The first truth decides on the columns.
int write_capture_csv(const CLI::App& app, const Options& options, bool& running) {
  GravitationModel gravitation;
  if (app.get_option("--gravity-m-per-s2")->count() > 0)
    gravitation = {.kind = GravitationModel::Kind::constant, .constant = options.motion.parameters.gravity_m_per_s2};
  CapturedTruths truths(
      {options.capture, options.format, options.settings,
       app.get_option("--stream")->count() > 0 ? std::optional(options.motion.stream) : std::nullopt, gravitation});
  FilesInUse files;
  files.add_input(options.capture, "the capture");
  if (const std::string fault = files.claim(options.csv_path, "the file of --csv"); !fault.empty())
    throw std::runtime_error(fault);
  TextOutput csv(options.csv_path);
  running = true;
  std::optional<Truth> first;
  unsigned parts = 0, left_out = 0, lacking = 0;
  std::uint64_t rows = 0, without = 0;
  ProgressLine progress(!csv.is_terminal());
  while (csv.is_open()) {
    const auto truth = truths.next();
    if (!truth) break;
    if (!first) {
      first = truth;
      parts = writable_parts_of(*first);
      csv.write(truth_csv_header(parts));
    }
    left_out |= parts_of(*truth) & ~parts;
    if (const bool fits =
            (parts & ~parts_of(*truth)) == 0 &&
            (first->accumulated_dv == AccumulatedDv::none || truth->accumulated_dv == first->accumulated_dv) &&
            ((parts & TruthParts::date) == 0 || truth->start_gps_ns == first->start_gps_ns);
        !fits) {
      ++without;
      lacking |= parts & ~parts_of(*truth);
      continue;
    }
    csv.write(truth_csv_row(*truth, parts));
    ++rows;
    if (progress.is_due()) progress.show(truths.progress(), options.capture);
  }
  progress.clear();
  finish_csv(csv, options, rows);
  if (first && first->accumulated_dv == AccumulatedDv::body_sum)
    print_line("note", "replay it with truth.accumulated_dv = \"body_sum\"");
  if (left_out != 0)
    print_line("warning", fmt::format("the CSV lacks parts of the truths: {}", names_of_parts(left_out)));
  if (!truths.note().empty()) print_line("note", truths.note());
  if (const auto others = truths.of_other_vehicles(); others > 0)
    print_line("left out", fmt::format("{} truths of other vehicles; --stream chooses one", others));
  if (without > 0)
    print_line("left out", fmt::format("{} truths that lack columns of the first one{}{}", without,
                                       lacking != 0 ? ": " : "", names_of_parts(lacking)));
  if (!truths.refused().empty()) print_line("refused", truths.refused());
  if (!truths.damage().empty()) print_line("capture", truths.damage());
  if (rows == 0) throw std::runtime_error(fmt::format("{}: no {} truth in it", options.capture, options.format));
  const bool is_complete = without == 0 && truths.refused().empty() && truths.damage().empty() && !stop_requested();
  return is_complete ? 0 : incomplete;
}

// The results of lockstep.
struct Answers {
  std::uint64_t count = 0;
  NativeAcknowledgement last;
};

void print_report(const DatagramSender& sender, const Answers& answers, bool lockstep, double elapsed_s) {
  const auto line = print_line;
  const DatagramSender::Counters& counters = sender.counters();
  const double hz = counters.sent > 1 ? static_cast<double>(counters.sent - 1) / elapsed_s : 0;
  line("sent", fmt::format("{} datagrams, {} bytes in {:.3f} s ({:.3f} per second)", counters.sent, counters.bytes,
                           elapsed_s, hz));
  if (sender.lateness().count() > 0) line("pace", percentiles_text(sender.lateness()) + " late");
  if (lockstep) {
    line("acknowledged", fmt::format("{}, {} sent again; round trip {}", answers.count, counters.resent,
                                     percentiles_text(sender.round_trip())));
    line("receiver", fmt::format("reached {:.9f} s, {} samples emitted", seconds(answers.last.time - TruthTime{}),
                                 answers.last.samples));
  }
  if (counters.dropped + counters.duplicated + counters.reordered + counters.corrupted > 0)
    line("faults", fmt::format("{} dropped, {} sent twice, {} swapped with the next, {} corrupted", counters.dropped,
                               counters.duplicated, counters.reordered, counters.corrupted));
  if (counters.refused > 0) line("refused", fmt::format("{} by the network", counters.refused));
  if (counters.unheard > 0)
    line("unheard", fmt::format("{} times the answer was that nobody listens at that port", counters.unheard));
}

int send(const Options& options, bool& running) {
  const auto takes_truth = [](const Transport& t) { return t.brings_truth && t.serves_device && !t.ends; };
  if (const Transport* to = transport_of(options.to); to != nullptr && !takes_truth(*to))
    throw std::invalid_argument(
        fmt::format("--to {}: right would be {}", options.to, fmt::join(port_examples(takes_truth), " or ")));
  const auto port = open_port(options.to, Role::device);
  const HostTime start = host_now();
  MotionTruths::Options motion = options.motion;
  if (!options.stamp.empty()) motion.first_stamp = clock_stamp(options.stamp, start);
  std::unique_ptr<Port> capture;
  TruthSource source;
  if (options.motion.motion == nullptr) {
    if (find_truth_log(options.format) != nullptr)
      throw std::invalid_argument(options.capture +
                                  ": is a log, which --csv FILE converts to what imud replay reads");
    const std::string from = capture_port(options.capture);
    const auto has_datagrams = [](const Transport& t) { return t.ends && t.keeps_datagrams; };
    if (const Transport* transport = transport_of(from); transport != nullptr && !has_datagrams(*transport))
      throw std::invalid_argument(
          fmt::format("{}: has no datagrams to be sent; right would be {}. imud replay reads it as it is, and --csv "
                      "FILE converts it",
                      options.capture, fmt::join(port_examples(has_datagrams), " or ")));
    capture = open_port(from, Role::listener);
    source = capture_source(*capture, options.motion.for_s);
  } else {
    source = options.format == "csv" ? csv_source(motion) : native_source(motion);
  }

  running = true;
  DatagramSender sender(*port, options.sender);
  Answers answers;
  std::string failure;
  std::uint64_t datagrams = 0;
  while (!stop_requested() && failure.empty()) {
    const auto datagram = source();
    if (!datagram) break;
    ++datagrams;
    const auto due = options.fast ? std::nullopt : std::optional(start + datagram->offset);
    if (!options.lockstep) {
      sender.send(datagram->bytes, due);
    } else if (const auto answer = sender.send_and_wait(datagram->bytes, due, datagram->stream, datagram->sequence)) {
      ++answers.count;
      answers.last = *answer;
    } else if (!stop_requested()) {
      failure = fmt::format(
          "no answer to sequence {} from {}, sent {} times; is imud running there with clock = \"lockstep\"?",
          datagram->sequence, options.to, options.sender.resend_at_most + 1);
    }
  }
  sender.finish();

  print_report(sender, answers, options.lockstep, seconds(host_now() - start));
  if (capture != nullptr && !capture->end_warning().empty()) print_line("capture", capture->end_warning());
  if (!failure.empty()) throw std::runtime_error(failure);
  if (datagrams == 0 && !stop_requested())
    throw std::runtime_error(fmt::format("{}: no datagram in it{}", options.capture,
                                         capture->counters().not_ours > 0 ? " for that port" : ""));
  return sender.counters().refused > 0 ? incomplete : 0;
}

void define(CLI::App& app, Options& options) {
  app.set_version_flag("--version", "imu-truth " IMUD_VERSION);
  app.add_option("MOTION", options.what, "a motion, 'capture', or 'list'; see below")->required()->type_name("");
  app.add_option("FILE", options.capture, "the capture")->type_name("");
  const auto add = [&app](const char* name, auto& value, const char* unit, const char* help) {
    return app.add_option(name, value, help)->type_name(unit);
  };
  add("--to", options.to, "PORT", "destination, udp:ADDR:PORT")->capture_default_str();
  add("--rate", options.motion.rate_hz, "HZ", "truths per second")
      ->check(number_check(Grid::min_rate_hz, Grid::max_rate_hz))
      ->capture_default_str();
  add("--for", options.motion.for_s, "SECONDS",
      "duration of the motion or capture, with the truth at its end; default: until interrupted")
      ->check(number_check(0, 1e9));
  add("--start", options.motion.start_s, "SECONDS", "simulation time and motion time of the first truth")
      ->check(number_check(-1e9, 1e9))
      ->capture_default_str();
  add("--stream", options.motion.stream, "N", "number of the vehicle")->capture_default_str();
  add("--format", options.format, "FORMAT",
      "native, or csv: a row per datagram, the header row first; of a capture with --csv: its truth format")
      ->capture_default_str();
  add("--csv", options.csv_path, "FILE", "writes truth CSV to FILE and sends nothing; - is standard output");
  add("--set", options.settings, "KEY=VALUE", "capture with --csv: a setting of its truth format; may be repeated")
      ->allow_extra_args(false);
  add("--stamp", options.stamp, "CLOCK",
      "stamps each datagram with the time at which it is due: tai, utc or monotonic, as realtime.epoch of the "
      "receivers");
  app.add_flag("--no-new-run", options.no_new_run, "does not mark the first datagram as the beginning of a run");
  app.add_flag("--fast", options.fast, "sends without pacing; may outrun the receiver, except with --lockstep");
  app.add_flag("--lockstep", options.lockstep, "waits for the acknowledgement of each datagram before the next one");
  add("--resend", options.sender.resend_at_most, "N",
      "lockstep: how often a datagram not answered within 200 ms is sent again")
      ->capture_default_str();

  for (const auto& entry : motion_options)
    add(entry.option, options.motion.parameters.*entry.parameter, "X", entry.help)
        ->check(number_check(-1e6, 1e6))
        ->capture_default_str()
        ->group("Parameters of the motion");

  DatagramFaults::Rates& faults = options.sender.faults;
  constexpr auto fault_group = "Network faults, to test a receiver";
  const auto add_fault = [&](const char* name, double& percent, const char* help) {
    add(name, percent, "PERCENT", help)->check(number_check(0, 100))->group(fault_group);
  };
  add_fault("--drop", faults.drop_percent, "are not sent");
  add_fault("--duplicate", faults.duplicate_percent, "are sent twice");
  add_fault("--reorder", faults.reorder_percent, "are sent after the next one");
  add_fault("--corrupt", faults.corrupt_percent, "have one random bit flipped");
  add("--jitter", faults.jitter_ms, "MS", "delays each datagram by a random time up to this; the order is kept")
      ->check(number_check(0, 60'000))
      ->group(fault_group);
  add("--seed", faults.seed, "N", "seed of the faults; the same seed gives the same faults")
      ->capture_default_str()
      ->group(fault_group);
  app.footer(
      fmt::format("\n{}\nExit codes: 0 done, 1 failed while running or not answered, 2 the command line is wrong, 3 "
                  "done, but the "
                  "capture is damaged, or truths were refused, by their format or by the network.\n"
                  "Example: imu-truth coning --half-angle-rad 0.1 --to udp:127.0.0.1:9810 --rate 100 --for 10",
                  known_motions()));
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app("Sends truth over UDP: motions whose derivatives are known in closed form, or a capture.",
               "imu-truth");
  Options options;
  define(app, options);
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;
  if (options.what == "list") {
    std::fputs(known_motions().c_str(), stdout);
    return 0;
  }

  catch_stop_signals();
  check(app, options);
  if (options.csv_path.empty()) return send(options, running);
  return options.motion.motion == nullptr ? write_capture_csv(app, options, running) : write_csv(options, running);
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-truth", imud::execute, argc, argv); }
