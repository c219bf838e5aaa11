// The environment of imud in the timing benchmark: a simulator that sends truth, readers, and the bare loop of
// cyclictest.
#pragma once

#include <atomic>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "core/truth.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud::timing {

// us.
struct Percentiles {
  double p50 = 0, p99 = 0, p999 = 0, max = 0;
};
// The median of each percentile.
Percentiles median(const std::vector<Percentiles>& rounds);
double median(std::vector<double> values);
// Returns percentile `p`, 0 to 100; sorts the values.
double percentile(std::vector<double>& values, double p);

// The tumbling body's truth at `time`: rates and forces that change.
Truth tumbling(TruthTime time);

class Folder {
 public:
  Folder();
  ~Folder();
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

// A native measurement has about as many bytes.
constexpr std::size_t frame_size = 112;

void sleep_until(HostTime time);

// Returns the master of a new raw pty, whose slave has the name `link`; and a slave of such a name, as soon as it
// exists.
FileDescriptor open_pty(const std::string& link);
FileDescriptor open_link(const std::string& link);

// UDP on loopback: connected to imud's truth port, or bound to a port of its own.
FileDescriptor truth_socket(int port);
FileDescriptor bound_socket(int& port);
int free_udp_port();

// Sends truth at 100 Hz until it is destroyed.
class Simulator {
 public:
  explicit Simulator(int port);

 private:
  std::jthread thread_;
};

// Reads from the ptys behind these links as soon as they exist, as a flight computer does; discards the bytes.
class PtyReaders {
 public:
  explicit PtyReaders(std::vector<std::string> links);

 private:
  std::jthread thread_;
};

// Connects to the control socket as soon as it exists, and sends changes as fast as they are taken. Counts the
// answers.
class ControlFlood {
 public:
  ControlFlood(std::string socket, std::atomic<std::uint64_t>& answers);

 private:
  std::jthread thread_;
};

// Records when each datagram to it was sent: the kernel's receive time stamp, which on loopback is taken during the
// sender's call.
class DatagramTimes {
 public:
  DatagramTimes();
  int port() const { return port_; }
  // Stops receiving. Returns the times since the first datagram, s.
  std::vector<double> take();

 private:
  FileDescriptor socket_;
  int port_;
  std::vector<double> times_s_;
  std::jthread thread_;
};

// Returns a configuration with `imus` imus. `realtime`: keys of the first table; `imu`: keys of each imu, in which
// "{0}" stands for the number of the imu, and "{1}" for 1000 / imus times this number.
std::string config(int truth_port, const std::string& realtime, int imus, const std::string& imu);

struct Run {
  nlohmann::json summary;
  double cpu_s = 0;
  // Returns the lateness of the worst imu.
  Percentiles lateness() const;
  std::uint64_t count(const std::string& key) const;  // summed
};
// Runs `imud run` for `duration_s` with a simulator, and with readers of `links`. `arguments`: further arguments of
// imud.
Run run_imud(const Folder& folder, const std::string& config, int truth_port, double duration_s,
             std::vector<std::string> links = {}, const std::vector<std::string>& arguments = {});

// The latencies of the bare loop's wake-ups, at 1 kHz with imud's priority. Adds the number of wake-ups that are a
// period late to `missed`.
Percentiles cyclictest(double duration_s, std::uint64_t* missed = nullptr);

}  // namespace imud::timing
