#include "emulator/commands/selftest.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <thread>

#include "core/numbers/duration_histogram.hpp"
#include "emulator/commands/machine.hpp"
#include "emulator/commands/rack.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/drive/realtime_thread.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/progress_line.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr double us = 1e6;  // microseconds in a second

void print_row(const std::string& what, const DurationHistogram& h) {
  fmt::print("  {:<34} p50 {:8.1f}  p99 {:8.1f}  p99.9 {:8.1f}  max {:8.1f}\n", what, us * h.percentile(50),
             us * h.percentile(99), us * h.percentile(99.9), us * h.max());
  std::fflush(stdout);
}

// Calls `act` at the instants of a grid, in a thread set up by `realtime`. Returns the lateness of the calls, and in
// `shortfalls` the steps of the set-up that were not permitted.
template <class Act>
DurationHistogram loop(const RealtimeConfig& realtime, double rate_hz, double duration_s,
                       std::vector<std::string>& shortfalls, Act&& act) {
  DurationHistogram late;
  std::thread thread([&] {
    shortfalls = make_thread_realtime(realtime);
    MonotonicHost host;
    const Grid grid(rate_hz);
    const HostTime start = host.now() + std::chrono::milliseconds(10);
    for (std::uint64_t k = 0; seconds(grid.offset(k)) < duration_s; ++k) {
      const HostTime due = start + grid.offset(k);
      late.add(std::max(0.0, seconds(host.sleep_until(due, realtime.spin) - due)));
      act(host);
    }
  });
  thread.join();
  return late;
}

// A temporary folder with private copies of ports, and a thread that reads from them.
class Bench {
 public:
  Bench() {
    std::string name = std::filesystem::temp_directory_path() / "imud_selftest_XXXXXX";
    if (::mkdtemp(name.data()) == nullptr) throw PortError("no temporary folder");
    folder_ = name;
  }
  ~Bench() {
    reader_ = {};
    std::filesystem::remove_all(folder_);
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  const std::string& folder() const noexcept { return folder_; }
  // Opens the port, or a private copy of the port if the transport has private copies.
  std::unique_ptr<Port> open(const std::string& port, const PortSettings& settings) {
    const PortSpec spec = PortSpec::parse(port);
    const Transport* transport = find_transport(spec.scheme);
    if (transport == nullptr || !transport->has_private_copy) return open_port(port, settings);
    const std::string copy = fmt::format("{}:{}/port", spec.scheme, folder_);
    const std::size_t options = port.find('?');
    auto opened = open_port(copy + (options == std::string::npos ? "" : port.substr(options)), settings);
    if (!transport->ends) read(open_port(copy, Role::listener));
    return opened;
  }

 private:
  void read(std::unique_ptr<Port> port) {
    reader_ = std::jthread([port = std::move(port)](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        pollfd ready{port->descriptor(), POLLIN, 0};
        if (::poll(&ready, 1, 20) > 0 && !port->receive()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
  std::string folder_;
  std::jthread reader_;
};

DurationHistogram measure_writes(const RealtimeConfig& realtime, const ImuConfig& imu, double duration_s,
                                 PortCounters& counters) {
  Bench bench;
  const std::unique_ptr<Port> port = bench.open(imu.port, imu.port_settings);
  const std::unique_ptr<Device> device = imu.protocol->make(imu.settings);
  FrameBuffer frames;
  Sample sample = typical_sample();
  DurationHistogram took;
  std::vector<std::string> shortfalls;  // not used: the caller has reported them
  loop(realtime, imu.rate_hz, duration_s, shortfalls, [&](Host& host) {
    frames.clear();
    ++sample.counter;
    device->sample(sample, frames);
    const HostTime begin = host.now();
    port->send(frames.frames());
    took.add(std::max(0.0, seconds(host.now() - begin)));
    while (port->receive()) {
    }
  });
  counters = port->counters();
  return took;
}

}  // namespace

Config selftest_config() {
  Config config;
  ImuConfig& imu = config.imus.emplace_back();
  imu.name = "imu";
  imu.rate_hz = 1000;
  imu.grid = Grid(imu.rate_hz);
  imu.protocol = find_protocol("native");
  imu.settings = Settings();
  imu.port = "pty:imu";
  return config;
}

int selftest_timing(const Config& config, const SelftestOptions& options) {
  double rate_hz = 0;
  std::vector<std::string> serial;
  for (const ImuConfig& imu : config.imus) {
    rate_hz = std::max(rate_hz, imu.rate_hz);
    const PortSpec spec = PortSpec::parse(imu.port);
    if (const Transport* transport = find_transport(spec.scheme);
        transport != nullptr && transport->uart == Uart::real)
      serial.push_back(spec.address);
  }
  const RealtimeProcess process(config.realtime);
  const Machine machine = inspect_machine("", config.realtime.spin.count() > 0, serial);
  fmt::print("the machine\n");
  for (const std::string& fact : machine.facts) fmt::print("  {}\n", fact);

  constexpr std::size_t many = 16;
  constexpr std::array<std::size_t, 2> racks = {1, many};
  const std::size_t all = (config.realtime.priority > 0 ? 3 : 2) + config.imus.size() + racks.size();
  ProgressLine progress;
  std::size_t done = 0;
  const auto measure = [&](auto&& work) {
    progress.show(done++, all, "measurements");
    auto figures = work();
    progress.clear();
    return figures;
  };
  const auto nothing = [](Host&) {};
  RealtimeConfig kind = config.realtime;
  fmt::print("lateness of a bare loop, {} Hz, {} s each, us\n", rate_hz, options.measure_s);
  std::vector<std::string> advice;
  kind.priority = 0;
  kind.spin = {};
  const auto wake = [&] { return loop(kind, rate_hz, options.measure_s, advice, nothing); };
  DurationHistogram plain = measure(wake);
  print_row("ordinary thread", plain);
  kind.priority = config.realtime.priority;
  const std::string as = kind.priority > 0 ? fmt::format("priority {}", kind.priority) : "ordinary thread";
  if (kind.priority > 0) {
    plain = measure(wake);
    print_row(as + (advice.empty() ? "" : " (if permitted: see below)"), plain);
  }
  kind.spin = config.realtime.spin.count() > 0 ? config.realtime.spin : Nanoseconds(std::chrono::microseconds(100));
  const DurationHistogram spun = measure(wake);
  print_row(fmt::format("{}, spin_us = {:g}", as, us * seconds(kind.spin)), spun);
  advice.insert(advice.end(), machine.advice.begin(), machine.advice.end());

  fmt::print("duration of a write, us\n");
  double all_p50 = 0, all_p999 = 0;  // sums over all imus, which may write at the same instant
  for (const ImuConfig& imu : config.imus) {
    PortCounters counters;
    const DurationHistogram took =
        measure([&] { return measure_writes(config.realtime, imu, options.measure_s, counters); });
    print_row(fmt::format("{} to {}", imu.name, imu.port), took);
    if (counters.dropped > 0)
      advice.push_back(
          fmt::format("{}: {} of {} frames were not accepted by {}: is its other end open, and the line fast enough?",
                      imu.name, counters.dropped, counters.dropped + counters.sent, imu.port));
    all_p50 += took.percentile(50);
    all_p999 += took.percentile(99.9);
  }

  fmt::print("lateness of many sensors at {} Hz on one thread, apart, each on a pty that is read, us\n", rate_hz);
  double processor_s = 0;  // for each sample of many
  for (const std::size_t count : racks) {
    const Bench bench;
    const RackFigures rack =
        measure([&] { return measure_rack(config.realtime, count, rate_hz, options.measure_s, bench.folder()); });
    print_row(fmt::format("{} native", count), rack.lateness);
    processor_s = rack.processor_s;
  }

  const DurationHistogram& wakes = config.realtime.spin.count() > 0 ? spun : plain;
  const auto row = [&](const DurationHistogram& h) {
    return fmt::format("p50 {:.1f}, p99 {:.1f}, p99.9 {:.1f} us late", us * h.percentile(50), us * h.percentile(99),
                       us * h.percentile(99.9));
  };
  const double busy_s = wakes.percentile(99.9) + all_p999;
  const double best_hz = std::min(Grid::max_rate_hz, 1 / std::max(busy_s, 1e-6));
  fmt::print("to expect\n  samples start to leave with {}; with spin_us = {:g}: {}\n", row(plain),
             us * seconds(kind.spin), row(spun));
  if (config.imus.size() > 1)
    fmt::print("  the last of {} imus at one instant {:.1f} us after the first; phase_us sets them apart\n",
               config.imus.size(), us * all_p50);
  fmt::print("  up to {:.0f} Hz, 99.9 % of them have left before the next is due; {} Hz is {}\n", best_hz, rate_hz,
             rate_hz <= best_hz ? "within that" : "beyond that");
  constexpr double used = 0.7;  // share of a processor; with more, it takes long to catch up after a hold-up
  fmt::print(
      "  up to {:.0f} sensors at {} Hz, whose samples take {:.1f} us of a processor each, use {:.0f} % of one\n",
      std::max(1.0, std::floor(used / (processor_s * rate_hz))), rate_hz, us * processor_s, 100 * used);
  fmt::print("to improve\n");
  if (advice.empty()) fmt::print("  nothing\n");
  for (const std::string& line : advice) fmt::print("  - {}\n", line);
  return 0;
}

}  // namespace imud
