#include "emulator/commands/demo.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <boost/algorithm/string/classification.hpp>
#include <boost/algorithm/string/split.hpp>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/init/data_folders.hpp"
#include "emulator/plan/number_check.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

volatile std::sig_atomic_t ended_by = 0;  // a signal
extern "C" void note_signal(int signal) { ended_by = signal; }

constexpr std::string_view flight = "tests/captures/jsbsim_c172_10s.pcap", configuration = "tools/demo.toml";

// A temporary folder of the demonstration, which the destructor removes.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "imud-demo.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw OpenError(fmt::format("{}: {}", name, std::strerror(errno)));
    path_ = name;
  }
  ~Folder() {
    std::error_code none;
    fs::remove_all(path_, none);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(std::string_view name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

// A running program, with its redirected outputs.
class Child {
 public:
  Child(const std::vector<std::string>& words, int output, const std::string& errors) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int error = ::posix_spawn(&id_, arguments.front(), &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw OpenError(fmt::format("{}: {}", words.front(), std::strerror(error)));
  }
  ~Child() {
    if (id_ <= 0) return;
    ::kill(id_, SIGTERM);
    wait();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool runs() {
    if (id_ > 0 && ::waitpid(id_, &status_, WNOHANG) == id_) id_ = 0;
    return id_ > 0;
  }
  // Waits for the end of the program. Returns the exit code; -1 if a signal has ended the program.
  int wait() {
    if (id_ > 0) ::waitpid(id_, &status_, 0);
    id_ = 0;
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1;
  }

 private:
  pid_t id_ = 0;
  int status_ = 0;
};

// Returns the folder that has the files.
fs::path data_folder() {
  const std::array<fs::path, 2> places = data_folders();
  for (const fs::path& place : places)
    if (fs::exists(place / flight) && fs::exists(place / configuration)) return place;
  throw OpenError(
      fmt::format("there is no captured flight, {}, in {} or {}", flight, places[0].string(), places[1].string()));
}

// Returns the port that makes a pseudo-terminal with that link.
std::string pty_at(const std::string& link) {
  const auto is_pty = [](const Transport* one) { return one->makes_link && one->uart == Uart::emulated; };
  return fmt::format("{}:{}", (*std::ranges::find_if(transports(), is_pty))->name, link);
}

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

void print_indented(const std::string& text) {
  std::vector<std::string> lines;
  boost::split(lines, text, boost::is_any_of("\n"));
  for (const std::string& line : lines)
    if (!line.empty()) fmt::print("  {}\n", line);
}

// Prints the measurements that a decoder writes as CSV, a row each half second of the sensor's time.
void print_rows(int descriptor) {
  constexpr double interval_s = 0.5;
  constexpr std::array<std::string_view, 7> wanted = {"time_ns", "gyro_x",  "gyro_y", "gyro_z",
                                                      "accel_x", "accel_y", "accel_z"};
  std::FILE* file = ::fdopen(descriptor, "r");
  char* line = nullptr;
  std::size_t room = 0;
  std::array<std::size_t, wanted.size()> columns{};
  bool has_header = false;
  double next_s = 0;
  std::vector<std::string> cells;
  fmt::print("\n{:>8}  {:^29}  {:^29}\n", "time, s", "rate, deg/s", "specific force, m/s^2");
  while (ended_by == 0 && ::getline(&line, &room, file) > 0) {
    std::string text(line);
    text.erase(text.find_last_not_of("\r\n") + 1);
    boost::split(cells, text, boost::is_any_of(","));
    if (!std::exchange(has_header, true)) {
      for (std::size_t i = 0; i < wanted.size(); ++i)
        for (std::size_t k = 0; k < cells.size(); ++k)
          if (cells[k] == wanted.at(i)) columns.at(i) = k;
      continue;
    }
    const auto number = [&](std::size_t i) {
      return columns.at(i) < cells.size() ? std::strtod(cells[columns.at(i)].c_str(), nullptr) : 0.0;
    };
    const double time_s = 1e-9 * number(0);
    if (time_s < next_s) continue;
    next_s = time_s - std::fmod(time_s, interval_s) + interval_s;
    fmt::print("{:8.3f}  {:9.3f} {:9.3f} {:9.3f}  {:9.3f} {:9.3f} {:9.3f}\n", time_s, number(1) / units::degree,
               number(2) / units::degree, number(3) / units::degree, number(4), number(5), number(6));
    std::fflush(stdout);
  }
  std::free(line);
  std::fclose(file);
}

}  // namespace

const CLI::App* add_demo_command(CLI::App& app, DemoOptions& options) {
  CLI::App* command = app.add_subcommand(
      "demo", "Show a captured flight of a Cessna 172 becoming IMU packets on a pty, with a decoder beside it");
  command->add_option("--for", options.duration_s, "End after this many seconds (the whole flight, 10)")
      ->type_name("SECONDS")
      ->check(number_check(0.1, 1e9));
  return command;
}

int demo(const DemoOptions& options) {
  using namespace std::chrono_literals;
  const fs::path program = fs::read_symlink("/proc/self/exe");
  const std::string decoder = program.parent_path() / "imu-decode";
  const fs::path data = data_folder();
  const Folder folder;
  const std::string port = pty_at(folder / "imu1");
  const std::string summary = folder / "summary", log = folder / "log", report = folder / "report";

  // Both programs get a Ctrl-C from the terminal and end. After other signals this process ends them. The folder
  // is removed in each case.
  struct sigaction action = {};
  action.sa_handler = note_signal;  // without SA_RESTART: a wait returns
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) ::sigaction(signal, &action, nullptr);
  const FileDescriptor output(::open(summary.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  fmt::print("$ imud run {}    # with the flight {}\n", (data / configuration).string(), (data / flight).string());
  std::vector<std::string> words = {program,
                                    "run",
                                    data / configuration,
                                    "--quiet",
                                    "--wait-for-reader",
                                    "--set",
                                    fmt::format("truth.port={}?port=5140", capture_port((data / flight).string())),
                                    "--set",
                                    fmt::format("imu.0.port={}", port),
                                    "--set",
                                    "control.socket=none"};
  if (options.duration_s) words.insert(words.end(), {"--for", fmt::format("{}", *options.duration_s)});
  Child running(words, output.get(), log);
  while (ended_by == 0 && running.runs() && !fs::is_symlink(folder / "imu1")) std::this_thread::sleep_for(10ms);
  std::array<int, 2> rows{};
  if (::pipe2(rows.data(), O_CLOEXEC) != 0) throw OpenError(std::strerror(errno));
  fmt::print("$ imu-decode native {}\n", port);
  Child decoding({decoder, "native", port}, rows[1], report);
  ::close(rows[1]);
  print_rows(rows[0]);
  if (ended_by != 0 && ended_by != SIGINT) return 128 + ended_by;

  constexpr int incomplete = 3;  // the flight was shortened
  const int decoded = decoding.wait(), ran = running.wait();
  fmt::print("\nthe report of imu-decode:\n");
  print_indented(text_of(report));
  fmt::print("the summary of imud:\n");
  print_indented(text_of(summary));
  if (ended_by == SIGINT) return 128 + SIGINT;
  if (decoded == 0 && (ran == 0 || (ran == incomplete && options.duration_s))) return 0;
  std::fflush(stdout);
  fmt::print(stderr, "{}imud: the demonstration has failed\n", text_of(log));
  return 1;
}

}  // namespace imud
