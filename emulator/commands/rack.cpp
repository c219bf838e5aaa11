#include "emulator/commands/rack.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <time.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "emulator/drive/assembly.hpp"
#include "emulator/drive/realtime_thread.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {

namespace {

// Returns the transport that emulates a serial line without hardware.
const Transport& emulated_line() {
  for (const Transport* transport : transports())
    if (transport->has_private_copy && transport->uart == Uart::emulated) return *transport;
  throw PortError("no transport emulates a serial line");
}

Config rack_of(const RealtimeConfig& realtime, std::size_t count, double rate_hz, const std::string& folder) {
  Config config;
  config.realtime = realtime;
  config.truth.format = find_truth_format("native");
  for (std::size_t i = 0; i < count; ++i) {
    ImuConfig& imu = config.imus.emplace_back();
    imu.name = fmt::format("i{}", i);
    imu.rate_hz = imu.model.rate_hz = rate_hz;
    imu.grid = Grid(rate_hz, 0.0, nanoseconds(static_cast<double>(i) / static_cast<double>(count) / rate_hz));
    imu.protocol = find_protocol("native");
    imu.port = fmt::format("{}:{}/{}", emulated_line().name, folder, i);
    imu.before_first = BeforeFirst::rest;
  }
  return config;
}

// Starts a thread that reads all ptys, in place of the sensors' hosts.
std::jthread readers(const Config& config) {
  std::vector<std::unique_ptr<Port>> ports;
  for (const ImuConfig& imu : config.imus) ports.push_back(open_port(imu.port, Role::listener));
  return std::jthread([ports = std::move(ports)](const std::stop_token& stop) {
    std::vector<pollfd> ready;
    for (const auto& port : ports) ready.push_back({port->descriptor(), POLLIN, 0});
    while (!stop.stop_requested()) {
      ::poll(ready.data(), ready.size(), 20);
      for (std::size_t i = 0; i < ports.size(); ++i)
        while ((ready[i].revents & POLLIN) != 0 && ports[i]->receive()) {
        }
    }
  });
}

double thread_s() noexcept {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

RackFigures measure_rack(const RealtimeConfig& realtime, std::size_t count, double rate_hz, double duration_s,
                         const std::string& folder) {
  const Config config = rack_of(realtime, count, rate_hz, folder);
  Assembly rack(config,
                [](const PortUse& use) { return use.of == PortUse::Of::truth ? no_ports(use) : real_ports(use); });
  const std::jthread reader = readers(config);
  std::atomic<bool> stop = false;
  RackFigures figures;
  double took_s = 0;
  std::thread thread([&] {
    make_thread_realtime(realtime);
    MonotonicHost host;
    const double begin_s = thread_s();
    rack.run(host, stop);
    took_s = thread_s() - begin_s;
  });
  std::this_thread::sleep_for(std::chrono::duration<double>(duration_s));
  stop = true;
  thread.join();
  for (const auto& channel : rack.engine().channels()) {
    const ImuCounters& counters = channel->counters;
    figures.samples += counters.samples;
    const DurationHistogram& lateness = counters.lateness;
    if (lateness.percentile(99) > figures.lateness.percentile(99)) figures.lateness = lateness;
  }
  figures.processor_s = took_s / static_cast<double>(std::max<std::uint64_t>(1, figures.samples));
  return figures;
}

}  // namespace imud
