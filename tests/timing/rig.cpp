#include "tests/timing/rig.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/net_tstamp.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "emulator/control/socket_path.hpp"
#include "protocols/native_truth.hpp"
#include "tests/tools/run_program.hpp"
#include "transports/host_clock.hpp"

namespace imud::timing {

double median(std::vector<double> values) { return percentile(values, 50); }

double percentile(std::vector<double>& values, double p) {
  if (values.empty()) throw std::runtime_error("nothing was measured");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(p / 100 * static_cast<double>(values.size() - 1) + 0.5)];
}

Percentiles median(const std::vector<Percentiles>& rounds) {
  const auto of = [&](double Percentiles::*member) {
    std::vector<double> values;
    for (const Percentiles& round : rounds) values.push_back(round.*member);
    return median(values);
  };
  return {of(&Percentiles::p50), of(&Percentiles::p99), of(&Percentiles::p999), of(&Percentiles::max)};
}

Truth tumbling(TruthTime time) {
  const double t = seconds(time - TruthTime{});
  Truth truth;
  truth.time = time;
  truth.q_NB = Quaternion(Eigen::AngleAxisd(t, Vector3::UnitZ()));
  truth.omega_BN_B = {0, 0, 1};
  truth.has_specific_force = true;
  truth.specific_force_B = {std::cos(t), -std::sin(t), 9.8};
  return truth;
}

Folder::Folder() {
  std::string name = std::filesystem::temp_directory_path() / "imud_timing_XXXXXX";
  path_ = ::mkdtemp(name.data());
}
Folder::~Folder() { std::filesystem::remove_all(path_); }

namespace {

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

void make_raw(int fd) {
  termios raw{};
  ::tcgetattr(fd, &raw);
  ::cfmakeraw(&raw);
  ::tcsetattr(fd, TCSANOW, &raw);
}

}  // namespace

void sleep_until(HostTime time) {
  const timespec at{time.ns / 1'000'000'000, time.ns % 1'000'000'000};
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

FileDescriptor open_pty(const std::string& link) {
  FileDescriptor master(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
  if (!master || ::grantpt(master.get()) != 0 || ::unlockpt(master.get()) != 0) throw std::runtime_error("no pty");
  make_raw(master.get());
  std::array<char, 64> slave{};
  ::ptsname_r(master.get(), slave.data(), slave.size());
  std::filesystem::create_symlink(slave.data(), link);
  return master;
}

FileDescriptor open_link(const std::string& link) {
  for (int ms = 0; ms < 5000; ++ms) {
    FileDescriptor fd(::open(link.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (fd) {
      make_raw(fd.get());
      return fd;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  throw std::runtime_error(link + " did not appear");
}

FileDescriptor bound_socket(int& port) {
  FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in address = loopback(0);
  socklen_t size = sizeof address;
  if (::bind(socket.get(), reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("no UDP socket");
  port = ntohs(address.sin_port);
  return socket;
}

FileDescriptor truth_socket(int port) {
  FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const sockaddr_in address = loopback(port);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error("no UDP socket");
  return socket;
}

int free_udp_port() {
  int port = 0;
  bound_socket(port);
  return port;
}

Simulator::Simulator(int port)
    : thread_([port](const std::stop_token& stop) {
        const FileDescriptor socket = truth_socket(port);
        const HostTime start = host_now();
        for (std::uint32_t k = 0; !stop.stop_requested(); ++k) {
          const Nanoseconds since_start = k * std::chrono::milliseconds(10);
          sleep_until(start + since_start);
          Truth truth = tumbling(TruthTime{since_start.count()});
          truth.sequence = k;
          std::array<std::byte, native_truth_size> datagram;
          encode_native_truth(truth, datagram);
          [[maybe_unused]] const auto sent = ::send(socket.get(), datagram.data(), datagram.size(), 0);
        }
      }) {}

PtyReaders::PtyReaders(std::vector<std::string> links)
    : thread_([links = std::move(links)](const std::stop_token& stop) {
        std::vector<FileDescriptor> open;
        std::vector<pollfd> ready;
        std::array<char, 4096> buffer;
        while (!stop.stop_requested()) {
          if (open.size() < links.size()) {
            FileDescriptor fd(::open(links[open.size()].c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
            if (!fd) {
              std::this_thread::sleep_for(std::chrono::milliseconds(1));
              continue;
            }
            make_raw(fd.get());
            ready.push_back({fd.get(), POLLIN, 0});
            open.push_back(std::move(fd));
            continue;
          }
          ::poll(ready.data(), ready.size(), 50);
          for (const pollfd& one : ready)
            if ((one.revents & POLLIN) != 0) [[maybe_unused]]
              const auto n = ::read(one.fd, buffer.data(), buffer.size());
        }
      }) {}

ControlFlood::ControlFlood(std::string socket, std::atomic<std::uint64_t>& answers)
    : thread_([socket = std::move(socket), &answers](const std::stop_token& stop) {
        constexpr std::string_view request =
            "{\"jsonrpc\": \"2.0\", \"method\": \"set\", \"params\": {\"truth.extrapolate_ms\": 100}, \"id\": 1}\n";
        FileDescriptor connection;
        std::array<char, 65536> buffer;
        std::string waiting;
        while (!stop.stop_requested()) {
          if (!connection) connection = connect_to_socket(socket);
          if (!connection) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            continue;
          }
          if (waiting.empty()) waiting = request;
          pollfd ready{connection.get(), POLLIN | POLLOUT, 0};
          ::poll(&ready, 1, 50);
          if ((ready.revents & POLLOUT) != 0)
            if (const auto n = ::send(connection.get(), waiting.data(), waiting.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
                n > 0)
              waiting.erase(0, static_cast<std::size_t>(n));
          if ((ready.revents & POLLIN) == 0) continue;
          const auto n = ::recv(connection.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
          if (n == 0) connection.reset();
          if (n > 0) answers += static_cast<std::uint64_t>(std::count(buffer.begin(), buffer.begin() + n, '\n'));
        }
      }) {}

DatagramTimes::DatagramTimes()
    : socket_(bound_socket(port_)), thread_([this](const std::stop_token& stop) {
        const int on = 1, room = 8 << 20;
        ::setsockopt(socket_.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
        ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
        std::int64_t first_s = 0;
        while (!stop.stop_requested()) {
          pollfd ready{socket_.get(), POLLIN, 0};
          if (::poll(&ready, 1, 50) <= 0) continue;
          std::array<std::byte, 2048> bytes;
          std::array<std::byte, 256> control;
          iovec part{bytes.data(), bytes.size()};
          msghdr message{};
          message.msg_iov = &part;
          message.msg_iovlen = 1;
          message.msg_control = control.data();
          message.msg_controllen = control.size();
          if (::recvmsg(socket_.get(), &message, MSG_DONTWAIT) <= 0) continue;
          for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
            if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
            timespec time{};
            std::memcpy(&time, CMSG_DATA(c), sizeof time);
            if (times_s_.empty()) first_s = time.tv_sec;
            times_s_.push_back(static_cast<double>(time.tv_sec - first_s) + 1e-9 * static_cast<double>(time.tv_nsec));
          }
        }
      }) {}

std::vector<double> DatagramTimes::take() {
  thread_.request_stop();
  thread_.join();
  return std::move(times_s_);
}

std::string config(int truth_port, const std::string& realtime, int imus, const std::string& imu) {
  std::string text =
      fmt::format("clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:{}\"\ndelay_ms = 20\n[realtime]\n{}\n",
                  truth_port, realtime);
  for (int i = 0; i < imus; ++i)
    text += fmt::format(
        "[[imu]]\nname = \"imu{}\"\nprotocol = \"native\"\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = "
        "100\n{}\n",
        i, fmt::format(fmt::runtime(imu), i, 1000.0 * i / imus));
  return text;
}

Percentiles Run::lateness() const {
  Percentiles worst;
  for (const nlohmann::json& imu : summary["imus"]) {
    const nlohmann::json& late = imu["lateness_us"];
    worst.p50 = std::max(worst.p50, late["p50"].get<double>());
    worst.p99 = std::max(worst.p99, late["p99"].get<double>());
    worst.p999 = std::max(worst.p999, late["p999"].get<double>());
    worst.max = std::max(worst.max, late["max"].get<double>());
  }
  return worst;
}

std::uint64_t Run::count(const std::string& key) const {
  std::uint64_t sum = 0;
  for (const nlohmann::json& imu : summary["imus"]) sum += imu[key].get<std::uint64_t>();
  return sum;
}

namespace {
double children_cpu_s() {
  rusage used{};
  ::getrusage(RUSAGE_CHILDREN, &used);
  const auto s = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return s(used.ru_utime) + s(used.ru_stime);
}
}  // namespace

Run run_imud(const Folder& folder, const std::string& config, int truth_port, double duration_s,
             std::vector<std::string> links, const std::vector<std::string>& arguments) {
  std::ofstream(folder / "config.toml") << config;
  const double before_s = children_cpu_s();
  Run run;
  {
    Program imud("imud");
    std::vector<std::string> all = {
        "run",       folder / "config.toml",  "--for",       fmt::format("{}", duration_s),
        "--summary", folder / "summary.json", "--log-every", "0"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    imud.start(all);
    const PtyReaders readers(std::move(links));
    const Simulator simulator(truth_port);
    const int code = imud.wait(std::chrono::milliseconds(static_cast<int>(1e3 * duration_s) + 20'000));
    if (code != 0) throw std::runtime_error(fmt::format("imud ended with {}: {}", code, imud.errors()));
    if (!imud.errors().empty() && imud.errors().find("warning") != std::string::npos) fmt::print("{}", imud.errors());
  }
  run.summary = nlohmann::json::parse(read_file(folder / "summary.json"));
  run.cpu_s = children_cpu_s() - before_s;
  return run;
}

Percentiles cyclictest(double duration_s, std::uint64_t* missed) {
  const ProgramResult result = run_program(
      "/usr/bin/cyclictest",
      {"-q", "-m", "-t", "1", "-p", "70", "-i", "1000", "-D", fmt::format("{:.0f}s", duration_s), "-h", "50000"});
  if (result.exit_code != 0) throw std::runtime_error("cyclictest (Debian's rt-tests) failed: " + result.errors);
  // Rows "microseconds count".
  std::vector<std::pair<double, std::uint64_t>> rows;
  std::uint64_t all = 0;
  for (const std::string& line : lines_of(result.output)) {
    std::istringstream fields(line);
    double us = 0;
    std::uint64_t count = 0;
    if (line.starts_with("#") || !(fields >> us >> count) || count == 0) continue;
    rows.emplace_back(us, count);
    all += count;
    if (missed != nullptr && us >= 1000) *missed += count;
  }
  if (all < 100) throw std::runtime_error("cyclictest printed no histogram");
  const auto at = [&](double p) {
    std::uint64_t sum = 0;
    for (const auto& [us, count] : rows)
      if (static_cast<double>(sum += count) >= p / 100 * static_cast<double>(all)) return us;
    return rows.back().first;
  };
  return {at(50), at(99), at(99.9), rows.back().first};
}

}  // namespace imud::timing
