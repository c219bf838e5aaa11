// Not a test: `cmake --build build/release --target timing` prints imud's timing beside the machine's own limit. On a
// machine with nothing else to do the ratios are what matters; figures in us follow the machine.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "tests/timing/bare_loop.hpp"
#include "tests/timing/relay.hpp"
#include "tests/timing/rig.hpp"

namespace imud::timing {
namespace {

int not_met = 0;

void print_criterion(const std::string& what, bool met, const std::string& figures) {
  if (!met) ++not_met;
  fmt::print("  {:<4} {:<44} {}\n", met ? "ok" : "NOT", what, figures);
  std::fflush(stdout);
}

void row(const std::string& name, const Percentiles& p) {
  fmt::print("  {:<34} p50 {:8.1f}   p99 {:8.1f}   p99.9 {:8.1f}   max {:8.1f}\n", name, p.p50, p.p99, p.p999, p.max);
  std::fflush(stdout);
}

double ratio(double a, double b) { return a / std::max(b, 0.1); }

std::string pty(const Folder& folder) { return "port = \"pty:" + (folder / "imu{0}") + "\"\n"; }

std::vector<std::string> links(const Folder& folder, int n) {
  std::vector<std::string> all;
  for (int i = 0; i < n; ++i) all.push_back(folder / fmt::format("imu{}", i));
  return all;
}

void against_cyclictest(const Folder& folder, int rounds, double s) {
  fmt::print(
      "\nLateness of the write against cyclictest's wake-ups, 1 kHz, one pty; us, medians of {} rounds of {} s "
      "each\n",
      rounds, s);
  const int port = free_udp_port();
  std::vector<Percentiles> bare, writes, plain, spin;
  std::vector<double> cpu_writes, cpu, cpu_spin;
  for (int i = 0; i < rounds; ++i) {
    bare.push_back(cyclictest(s));
    const BareRun loop = bare_loop(folder, 1, false, s);
    writes.push_back(loop.lateness);
    cpu_writes.push_back(loop.cpu_s / s);
    const Run without =
        run_imud(folder, config(port, "", 1, "rate_hz = 1000\n" + pty(folder)), port, s, links(folder, 1));
    plain.push_back(without.lateness());
    cpu.push_back(without.cpu_s / s);
    const Run with = run_imud(folder, config(port, "spin_us = 100", 1, "rate_hz = 1000\n" + pty(folder)), port, s,
                              links(folder, 1));
    spin.push_back(with.lateness());
    cpu_spin.push_back(with.cpu_s / s);
  }
  row("cyclictest", median(bare));
  row("a loop that writes, and no more", median(writes));
  row("imud", median(plain));
  row("imud, spin_us = 100", median(spin));
  const auto p99 = [](const std::vector<Percentiles>& a) { return median(a).p99; };
  print_criterion("without spin: p99 at most 1.5 x cyclictest's", ratio(p99(plain), p99(bare)) <= 1.5,
                  fmt::format("{:.2f} x", ratio(p99(plain), p99(bare))));
  print_criterion("with spin: p99 at most 0.25 x cyclictest's", ratio(p99(spin), p99(bare)) <= 0.25,
                  fmt::format("{:.2f} x", ratio(p99(spin), p99(bare))));
  print_criterion("processor without spin: under 3 % of a core", median(cpu) < 0.03,
                  fmt::format("{:.2f} % (with spin {:.1f} %, of the loop that writes {:.2f} %)", 100 * median(cpu),
                              100 * median(cpu_spin), 100 * median(cpu_writes)));
}

void many_imus(const Folder& folder, int rounds, double s) {
  fmt::print("\nMany imus and high rates, ptys, {} rounds of {} s each; us, medians of the worst imu's\n", rounds, s);
  struct Case {
    const char* name;
    int imus;
    double rate_hz;
    const char* keys;
    std::vector<Percentiles> late = {}, bare = {};  // `bare`: of a loop that writes, and no more
    std::uint64_t missed = 0, dropped = 0;
    double cpu_s = 0, bare_cpu_s = 0;
  };
  std::vector<Case> cases = {{"1 imu, 1 kHz", 1, 1000, ""},
                             {"16 imus, 1 kHz", 16, 1000, ""},
                             {"16 imus, 1 kHz, phases apart", 16, 1000, "phase_us = {1}\n"},
                             {"32 imus, 1 kHz, phases apart", 32, 1000, "phase_us = {1}\n"},
                             {"1 imu, 4 kHz", 1, 4000, ""}};
  std::vector<Percentiles> bare;
  std::uint64_t bare_missed = 0;
  for (int i = 0; i < rounds; ++i) {
    bare.push_back(cyclictest(s, &bare_missed));
    for (Case& c : cases) {
      const int port = free_udp_port();
      const Run run =
          run_imud(folder, config(port, "", c.imus, fmt::format("rate_hz = {}\n{}", c.rate_hz, c.keys) + pty(folder)),
                   port, s, links(folder, c.imus));
      c.late.push_back(run.lateness());
      c.missed += run.count("missed");
      c.dropped += run.count("dropped");
      c.cpu_s += run.cpu_s;
      if (c.rate_hz != 1000) continue;
      const BareRun loop = bare_loop(folder, c.imus, *c.keys != '\0', s);
      c.bare.push_back(loop.lateness);
      c.bare_cpu_s += loop.cpu_s;
    }
  }
  row("cyclictest, 1 kHz", median(bare));
  fmt::print("       a period late {}\n", bare_missed);
  const double one = median(cases[0].late).p99;
  for (const Case& c : cases) {
    const Percentiles late = median(c.late);
    row(c.name, late);
    if (!c.bare.empty()) {
      row("  a loop that writes, and no more", median(c.bare));
      fmt::print("       {:.2f} x its loop's of one, {:.1f} % of a core\n",
                 ratio(median(c.bare).p99, median(cases[0].bare).p99), 100 * c.bare_cpu_s / (rounds * s));
    }
    const double times = ratio(late.p99, one);
    print_criterion(fmt::format("p99 {:.2f} x one imu's, at most 2", times), times <= 2,
                    fmt::format("a period late {}, not taken by the reader {}, {:.1f} % of a core", c.missed,
                                c.dropped, 100 * c.cpu_s / (rounds * s)));
  }
}

// Control, web server and record without a client, then a client that sends changes as fast as they are taken,
// against runs without any of them.
void under_control(const Folder& folder, int rounds, double s) {
  fmt::print("\nControl, web server and record, 1 kHz, one pty, {} rounds of {} s each, by turns; us, medians\n",
             rounds, s);
  std::vector<Percentiles> alone, again, idle, flooded;
  std::atomic<std::uint64_t> answers = 0;
  const std::string socket = folder / "control";
  const std::string all = fmt::format("\n[control]\nsocket = \"{}\"\n[web]\nlisten = \"127.0.0.1:0\"\n", socket);
  for (int i = 0; i < rounds; ++i) {
    const auto run = [&](const std::string& tables, const std::vector<std::string>& arguments) {
      const int port = free_udp_port();
      return run_imud(folder, config(port, tables, 1, "rate_hz = 1000\n" + pty(folder)), port, s, links(folder, 1),
                      arguments)
          .lateness();
    };
    const std::vector<std::string> record = {"--record", folder / fmt::format("{}.pcapng", i)};
    const std::string none = "\n[control]\nsocket = \"none\"\n";
    alone.push_back(run(none, {}));
    idle.push_back(run(all, record));
    std::filesystem::remove(record.back());
    again.push_back(run(none, {}));
    const ControlFlood flood(socket, answers);
    flooded.push_back(run(all, record));
    std::filesystem::remove(record.back());
  }
  row("without", median(alone));
  row("without, again: the noise", median(again));
  row("with, no client", median(idle));
  row("with, a flood", median(flooded));
  const double without = std::max(median(alone).p99, median(again).p99);
  const double idle_times = ratio(median(idle).p99, without), times = ratio(median(flooded).p99, without);
  print_criterion("without clients: p99 at most 1.1 x that without", idle_times <= 1.1,
                  fmt::format("{:.2f} x", idle_times));
  print_criterion(
      "a flood: p99 at most 1.2 x that without", times <= 1.2,
      fmt::format("{:.2f} x, {:.0f} changes a second", times, static_cast<double>(answers) / (rounds * s)));
}

// Returns the slope of the line as the median of the slopes between samples half the run apart, which a hold-up of
// some ms changes less than a least-squares fit. `at_once`: number of samples sent at each instant.
double fitted_step(const std::vector<double>& t, std::size_t at_once) {
  std::size_t half = t.size() / 2;
  half -= half % at_once;
  std::vector<double> slopes;
  for (std::size_t i = 0; i + half < t.size(); ++i)
    slopes.push_back((t[i + half] - t[i]) / static_cast<double>(half));
  return median(slopes);
}

void rates(const Folder& folder, double s) {
  fmt::print("\nRate over {} s, from the times of datagrams sent, by the kernel\n", s);
  struct Case {
    int imus;
    double rate_hz, error_ppm;
  };
  for (const Case& c : {Case{1, 1000, 0}, Case{1, 1000, 200}, Case{16, 1000, -35}, Case{1, 4000, 0}}) {
    DatagramTimes times;
    const int port = free_udp_port();
    const Run run = run_imud(folder,
                             config(port, "", c.imus,
                                    fmt::format("rate_hz = {}\nclock_error_ppm = {}\nport = \"udp:127.0.0.1:{}\"\n",
                                                c.rate_hz, c.error_ppm, times.port())),
                             port, s);
    const std::vector<double> all = times.take();
    const double each_hz = c.rate_hz * (1 + 1e-6 * c.error_ppm);
    const double step_s = fitted_step(all, static_cast<std::size_t>(c.imus));
    const double off_ppm = 1e6 * (1 / (step_s * each_hz * c.imus) - 1);
    const double wanted = ((all.back() - all.front()) * each_hz + 1) * c.imus;
    print_criterion(fmt::format("{} x {} Hz, clock_error_ppm = {}", c.imus, c.rate_hz, c.error_ppm),
                    std::abs(off_ppm) < 1 && std::abs(wanted - static_cast<double>(all.size())) < c.imus &&
                        all.size() == run.count("samples"),
                    fmt::format("{:.6f} Hz, {:+.3f} ppm off; {} samples, rate x time {:.1f}", 1 / (step_s * c.imus),
                                off_ppm, all.size(), wanted));
  }
}

void latency(const Folder& folder, int steps) {
  fmt::print("\nLockstep: from a truth's datagram to the first byte on the pty, {} each, by turns; us\n", steps);
  Latencies all = measure_latency(folder, steps);
  const auto of = [](std::vector<double>& v) {
    return Percentiles{percentile(v, 50), percentile(v, 99), percentile(v, 99.9), percentile(v, 100)};
  };
  const Percentiles relay = of(all.relay), imud = of(all.imud), spinning = of(all.spinning);
  row("bare relay", relay);
  row("relay with ppoll", of(all.polling));
  row("relay with ppoll and the model", of(all.sampling));
  row("imud", imud);
  row("imud, spin_us = 1000", spinning);
  const auto at_most = [&](std::string_view which, double limit, double p50) {
    print_criterion(fmt::format("p50{} at most {} x the relay's", which, limit), ratio(p50, relay.p50) <= limit,
                    fmt::format("{:.2f} x", ratio(p50, relay.p50)));
  };
  at_most("", 1.5, imud.p50);
  at_most(" with spin_us", 1.1, spinning.p50);
}

struct Part {
  std::string_view name;
  void (*run)(const Folder& folder, double s);
};
constexpr Part parts[] = {
    {"latency", [](const Folder& folder, double) { latency(folder, 4000); }},
    {"lateness", [](const Folder& folder, double s) { against_cyclictest(folder, 5, std::max(2.0, s / 12)); }},
    {"rates", rates},
    {"control", [](const Folder& folder, double s) { under_control(folder, 6, std::max(2.0, s / 6)); }},
    {"imus", [](const Folder& folder, double s) { many_imus(folder, 6, std::max(2.0, s / 6)); }},
};

}  // namespace
}  // namespace imud::timing

int main(int argc, char** argv) {
  using namespace imud::timing;
  // Arguments: the duration of the long runs, s (in shorter runs the rate is not known to 1 ppm), then the parts to
  // run; default: all.
  const double s = argc > 1 ? std::atof(argv[1]) : 60;
  const std::vector<std::string_view> wanted(argv + std::min(argc, 2), argv + argc);
  const auto is_part = [](std::string_view name) {
    return std::ranges::find(parts, name, &Part::name) != std::end(parts);
  };
  if (!(s > 0) || !std::ranges::all_of(wanted, is_part)) {
    fmt::print(stderr, "timing: give a duration, s, then some of these parts, or none for all:");
    for (const Part& part : parts) fmt::print(stderr, " {}", part.name);
    fmt::print(stderr, "\n");
    return 1;
  }
  try {
    const Folder folder;
    for (const Part& part : parts)
      if (wanted.empty() || std::ranges::find(wanted, part.name) != wanted.end()) part.run(folder, s);
  } catch (const std::exception& error) {
    fmt::print(stderr, "timing: {}\n", error.what());
    return 1;
  }
  fmt::print("\n{} not met\n", not_met);
}
