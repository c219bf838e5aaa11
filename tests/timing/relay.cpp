#include "tests/timing/relay.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "core/imu.hpp"
#include "emulator/config/load_config.hpp"
#include "protocols/native_truth.hpp"
#include "protocols/truth_format.hpp"
#include "tests/tools/run_program.hpp"
#include "transports/host_clock.hpp"

namespace imud::timing {

namespace {

enum class Work : std::uint8_t { none, polls, samples };

// One recv, one write; if it `polls`, one ppoll before; if it `samples`, the truth's decoding and the sensor model's
// step between them as well, for an imu of the configuration.
class Relay {
 public:
  Relay(const std::string& link, Work work, const ImuModel& model) {
    const FileDescriptor master = open_pty(link);
    const FileDescriptor socket = bound_socket(port_);
    const FileDescriptor reader(::open(link.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));  // so that nobody hangs up
    child_ = ::fork();
    if (child_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    std::array<std::byte, 2048> buffer{};
    std::array<pollfd, 2> inputs{{{socket.get(), POLLIN, 0}, {master.get(), POLLIN, 0}}};
    const bool polls = work != Work::none;
    const std::unique_ptr<TruthDecoder> decoder = find_truth_format("native")->make(Settings{});
    Timeline timeline;
    Imu imu(model, 1, 1);
    while (true) {
      if (polls && ::ppoll(inputs.data(), inputs.size(), nullptr, nullptr) < 0) break;
      const ssize_t size = ::recv(socket.get(), buffer.data(), buffer.size(), polls ? MSG_DONTWAIT : 0);
      if (size < 0) {
        if (polls && errno == EAGAIN) continue;
        break;
      }
      if (work == Work::samples) {
        Truth truth;
        decoder->feed(std::span(buffer).first(static_cast<std::size_t>(size)), TruthInput::datagram, {});
        if (decoder->next(truth) != TruthResult::ok) break;
        timeline.push(truth);
        const Sample sample = imu.sample(timeline, truth.time, DeviceTime{truth.time.ns});
        static_assert(sizeof sample >= frame_size);
        std::memcpy(buffer.data(), static_cast<const void*>(&sample), frame_size);
      }
      if (::write(master.get(), buffer.data(), frame_size) < 0) break;
    }
    ::_exit(0);
  }
  ~Relay() {
    ::kill(child_, SIGKILL);
    ::waitpid(child_, nullptr, 0);
  }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;
  int port() const { return port_; }

 private:
  int port_ = 0;
  pid_t child_ = 0;
};

// imud in lockstep, with a pty of the name `name` in the folder.
struct Lockstep {
  Lockstep(const Folder& folder, const std::string& name, int spin_us) {
    std::ofstream(folder / (name + ".toml"))
        << config(port, "", 1, "rate_hz = 1000\nport = \"pty:" + (folder / name) + "\"") << "\n";
    imud.start({"run", folder / (name + ".toml"), "--set", "clock=lockstep", "--set", "truth.delay_ms=0", "--set",
                fmt::format("realtime.spin_us={}", spin_us)});
    if (!imud.wait_for_errors("ready")) throw std::runtime_error("imud has not begun: " + imud.errors());
  }
  const int port = free_udp_port();
  Program imud{"imud"};
};

// One path from truth to bytes, measured at both ends.
class Path {
 public:
  Path(int port, const std::string& link) : socket_(truth_socket(port)), pty_(open_link(link)) {}

  // us.
  double step() {
    Truth truth = tumbling(TruthTime{} + k_ * std::chrono::milliseconds(1));
    truth.sequence = k_++;
    std::array<std::byte, native_truth_size> datagram;
    encode_native_truth(truth, datagram);
    const HostTime begin = host_now();
    if (::send(socket_.get(), datagram.data(), datagram.size(), 0) < 0)
      throw std::runtime_error("nobody takes truth");
    std::array<std::byte, 4096> bytes;
    pollfd ready{pty_.get(), POLLIN, 0};
    if (::poll(&ready, 1, 5000) <= 0) throw std::runtime_error("no measurement came");
    const ssize_t size = ::read(pty_.get(), bytes.data(), bytes.size());
    const HostTime end = host_now();
    if (size < static_cast<ssize_t>(frame_size))  // the rest follows
      while (::poll(&ready, 1, 2) > 0 && ::read(pty_.get(), bytes.data(), bytes.size()) > 0) {
      }
    return 1e6 * seconds(end - begin);
  }

 private:
  FileDescriptor socket_;
  FileDescriptor pty_;
  std::uint32_t k_ = 0;
};

}  // namespace

Latencies measure_latency(const Folder& folder, int steps) {
  Lockstep plain(folder, "plain", 0), awake(folder, "awake", 1000);
  const ImuModel model = load_config(folder / "plain.toml").imus[0].model;
  const Relay relay(folder / "relay", Work::none, model), polling(folder / "polling", Work::polls, model),
      sampling(folder / "sampling", Work::samples, model);
  Path through_relay(relay.port(), folder / "relay"), through_polling(polling.port(), folder / "polling");
  Path through_sampling(sampling.port(), folder / "sampling");
  Path through_plain(plain.port, folder / "plain"), through_awake(awake.port, folder / "awake");
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // until imud has noticed that the pty is open

  Latencies all;
  constexpr int block = 1000;
  for (int done = 0; done < steps; done += block) {
    const auto measure = [](Path& path, std::vector<double>& latencies) {
      for (int k = 0; k < block; ++k) {
        latencies.push_back(path.step());
        std::this_thread::sleep_for(std::chrono::microseconds(200));
      }
    };
    measure(through_relay, all.relay);
    measure(through_polling, all.polling);
    measure(through_sampling, all.sampling);
    measure(through_plain, all.imud);
    measure(through_awake, all.spinning);
  }
  for (Program* imud : {&plain.imud, &awake.imud})
    if (imud->stop() != 0) throw std::runtime_error("imud failed: " + imud->errors());
  return all;
}

}  // namespace imud::timing
