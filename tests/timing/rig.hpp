// What the timing benchmark puts around imud: a simulator that sends truth, readers, and the bare loop of cyclictest.
#pragma once

#include <atomic>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "core/truth.hpp"
#include "transports/file_descriptor.hpp"

namespace imud::timing {

// us.
struct Percentiles {
  double p50 = 0, p99 = 0, p999 = 0, max = 0;
};
// Of each percentile the median.
Percentiles median(const std::vector<Percentiles>& rounds);
double median(std::vector<double> values);
// p: 0 to 100. Sorts.
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

// UDP on loopback: connected to imud's truth port, or bound to a port of its own.
FileDescriptor truth_socket(int port);
FileDescriptor bound_socket(int& port);
int free_udp_port();

// Sends truth at 100 Hz as long as it lives.
class Simulator {
 public:
  explicit Simulator(int port);

 private:
  std::jthread thread_;
};

// Reads from the ptys behind these links, as soon as they are there, as a flight computer does; throws the bytes
// away.
class PtyReaders {
 public:
  explicit PtyReaders(std::vector<std::string> links);

 private:
  std::jthread thread_;
};

// Notes when each datagram to it was sent: the kernel's receive time stamp, which on loopback the sender's call
// makes.
class DatagramTimes {
 public:
  DatagramTimes();
  int port() const { return port_; }
  // Ends the listening. s, from the first on.
  std::vector<double> take();

 private:
  FileDescriptor socket_;
  int port_;
  std::vector<double> times_s_;
  std::jthread thread_;
};

// The configuration of `imus` imus; keys of the first table and of each imu ("{0}": its number; "{1}": 62.5 times
// that).
std::string config(int truth_port, const std::string& realtime, int imus, const std::string& imu);

struct Run {
  nlohmann::json summary;
  double cpu_s = 0;
  // Of all imus the worst.
  Percentiles lateness() const;
  std::uint64_t count(const std::string& key) const;  // summed
};
// `imud run` for so long with a simulator and readers of those links, cut off if it fails.
Run run_imud(const Folder& folder, const std::string& config, int truth_port, double duration_s,
             std::vector<std::string> links = {});

// The wake-ups of the bare loop, 1 kHz, at imud's priority. Adds to `missed` those a period late.
Percentiles cyclictest(double duration_s, std::uint64_t* missed = nullptr);

}  // namespace imud::timing
