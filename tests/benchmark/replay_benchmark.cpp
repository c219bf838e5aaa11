// imud replay --fast as a whole process: samples per second and memory, whatever the capture's length.
#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

struct Usage {
  double cpu_s = 0;
  double peak_mb = 0;
};

// Runs a program, discards its output, and returns the resources that it used.
Usage run(const std::string& program, const std::vector<std::string>& arguments) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    const int null = ::open("/dev/null", O_WRONLY);
    ::dup2(null, STDOUT_FILENO);
    ::execv(program.c_str(), argv.data());
    ::_exit(127);
  }
  int status = 0;
  rusage used{};
  if (::wait4(child, &status, 0, &used) != child || status != 0) throw std::runtime_error(program + " failed");
  const auto s = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {s(used.ru_utime) + s(used.ru_stime), static_cast<double>(used.ru_maxrss) / 1024.0};
}

class Folder {
 public:
  Folder() {
    std::string name = std::filesystem::temp_directory_path() / "imud_benchmark_XXXXXX";
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

std::string config(const Folder& folder, bool every_effect) {
  const std::string path = folder / "config.toml";
  const std::string effects = every_effect ? R"(mounting.position_m = [1, 1, 2]
mounting.yaw_pitch_roll_deg = [45, 57, 6]
gyro.bias_rad_per_s = [0.01, 0.01, 0.01]
gyro.lsb_rad_per_s = 1e-5
gyro.walk_transition = [0.9, 0.9, 0.9]
gyro.walk_sqrt_cov = [0.001, 0.001, 0.001]
gyro.walk_bound = [1, 1, 1]
accelerometer.bias_m_per_s2 = [0.1, 0.1, 0.1]
accelerometer.lsb_m_per_s2 = 1e-4
accelerometer.walk_transition = [0, 0, 0]
accelerometer.walk_sqrt_cov = [0.01, 0.01, 0.01]
)"
                                           : "";
  std::ofstream(path) << R"(clock = "fast"
truth = { port = "udp:127.0.0.1:5140", format = "jsbsim" }
[[imu]]
rate_hz = 1000
protocol = "native"
port = "file:/dev/null"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
)" << effects;
  return path;
}

const std::string flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap?port=5140";
const std::string imud = IMUD_BIN_DIR "/imud";

// 10,001 samples at 1 kHz take little longer than starting the process; at 10 kHz the samples dominate.
void fast_replay(benchmark::State& state) {
  const Folder folder;
  const std::string c = config(folder, state.range(0) != 0);
  const std::string out = "imu.0.port=file:" + (folder / "out");
  double cpu_s = 0;
  double peak_mb = 0;
  for (auto _ : state) {
    const Usage used = run(imud, {"replay", c, flight, "--set", "imu.0.rate_hz=10000", "--set", out});
    state.SetIterationTime(used.cpu_s);
    cpu_s += used.cpu_s;
    peak_mb = std::max(peak_mb, used.peak_mb);
  }
  const auto samples = 100'001.0 * static_cast<double>(state.iterations());
  state.counters["samples/s"] = samples / cpu_s;
  state.counters["peak_MB"] = peak_mb;
}
BENCHMARK(fast_replay)->ArgName("every_effect")->Arg(0)->Arg(1)->UseManualTime()->Unit(benchmark::kMillisecond);

// The machine's own limit for the same bytes: a file of that size copied by read() and write() of 64 kB.
void bare_copy(benchmark::State& state) {
  const Folder folder;
  run(imud, {"replay", config(folder, false), flight, "--set", "imu.0.rate_hz=10000", "--set",
             "imu.0.port=file:" + (folder / "out")});
  for (auto _ : state) {
    const int in = ::open((folder / "out").c_str(), O_RDONLY);
    const int out = ::open((folder / "copy").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    std::array<char, 65536> buffer;
    for (ssize_t n = 0; (n = ::read(in, buffer.data(), buffer.size())) > 0;)
      if (::write(out, buffer.data(), static_cast<std::size_t>(n)) != n) std::abort();
    ::close(in);
    ::close(out);
  }
  state.counters["samples/s"] = benchmark::Counter(100'001.0, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(bare_copy)->Unit(benchmark::kMillisecond);

// Truth at 100 Hz for several durations; the peak memory must not depend on the duration.
void memory(benchmark::State& state) {
  const Folder folder;
  const std::string seconds = std::to_string(state.range(0));
  run(IMUD_BIN_DIR "/imu-truth", {"coning", "--csv", folder / "truth.csv", "--rate", "100", "--for", seconds});
  double peak_mb = 0;
  for (auto _ : state) {
    const Usage used = run(imud, {"replay", config(folder, true), folder / "truth.csv", "--set", "truth.format=csv",
                                  "--set", "imu.0.rate_hz=200"});
    state.SetIterationTime(used.cpu_s);
    peak_mb = std::max(peak_mb, used.peak_mb);
  }
  state.counters["peak_MB"] = peak_mb;
  state.counters["capture_MB"] = static_cast<double>(std::filesystem::file_size(folder / "truth.csv")) / 1048576.0;
}
BENCHMARK(memory)->ArgName("seconds")->Arg(10)->Arg(100)->Arg(1000)->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
