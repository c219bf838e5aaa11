// Random changes of requests to the control protocol over each of its transports, while a run on a simulated clock
// executes what they change. No input makes imud crash or hang, each
// answer is JSON-RPC, and a good request is answered afterwards. The environment variable IMUD_FUZZ_INPUTS sets the
// number of inputs for each transport. The seed is fixed.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>

#include "emulator/config/load_config.hpp"
#include "emulator/control/control_server.hpp"
#include "emulator/web/metrics.hpp"
#include "emulator/web/web_server.hpp"
#include "tests/emulator/control/fuzzed_requests.hpp"
#include "tests/emulator/simulated.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

namespace asio = boost::asio;

// Gives the fuzzed server its inputs, in the thread of the run.
class ControlFuzz : public testing::TestWithParam<Carrier> {
 protected:
  ControlFuzz() {
    std::ofstream(folder_ / "config.toml") << R"(clock = "realtime"
truth.port = "udp:127.0.0.1:9810"
[[imu]]
name = "imu1"
protocol = "native"
port = "file:a"
rate_hz = 500
before_first = "rest"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
[[imu]]
name = "line"
protocol = "stim300"
port = "file:b"
[[imu]]
name = "bus"
protocol = "canopen"
port = "can:vcan0"
rate_hz = 100
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 100
)";
    std::ofstream(folder_ / "token") << fuzz_token << "\n";
    ::chmod((folder_ / "token").c_str(), 0600);
    config_ = load_config(folder_ / "config.toml");
    config_.control = {.name = "fuzz",
                       .socket = folder_ / "socket",
                       .listen = "127.0.0.1:0",
                       .token_file = folder_ / "token",
                       .faults = true};
    level_ = spdlog::get_level();
    spdlog::set_level(spdlog::level::off);
  }
  ~ControlFuzz() override { spdlog::set_level(level_); }

  // A run with its servers, which ends after `inputs` inputs.
  class Target;

  const ScratchFolder folder_;
  Config config_;
  FuzzedRequests requests_{17};
  spdlog::level::level_enum level_;
};

// Sends nothing, and discards what it is given.
class DiscardingPort final : public Port {
 public:
  void send(std::span<const Frame> frames) noexcept override { counters_.count_sent(is_reply_, frames.size()); }
  std::optional<Received> receive() noexcept override { return std::nullopt; }
};

class ControlFuzz::Target {
 public:
  Target(ControlFuzz& fuzz, long inputs) : fuzz_(fuzz), left_(inputs), control_(fuzz.config_.imus.size()) {
    run_.control = &control_;
    run_.make_sensor = [](SimulatedHost&) { return std::make_unique<DiscardingPort>(); };
    run_.host().on_wait = [this] { step(); };
  }
  ~Target() { close(); }

  void run() {
    constexpr double far = 1e6;  // s; step() ends it
    run_.run(far);
    EXPECT_GT(run_.counters().samples.load(), 0U);
    EXPECT_GT(events_, 0) << "no change was made";
    api_->finish();
  }

 private:
  void begin() {
    Engine& engine = run_.engine();
    RunCounters counters{&engine.intake().counters(), &engine.quality(), {}};
    for (const auto& channel : engine.channels()) counters.imus.emplace_back(channel->name, &channel->counters);
    counters.faults = &engine.faults();
    counters.control = &control_.counters;
    monitor_.emplace(counters, fuzz_.config_, Monitor::Options{});
    reloader_.emplace(
        engine, fuzz_.config_, now_, [this] { return fuzz_.config_; }, [] {});
    api_.emplace(io_, ControlApi::Run{"fuzz", fuzz_.config_, control_, *monitor_, counters, [] {}, engine.faults(),
                                      *reloader_});
    api_->on_event = [this](const Json&) { ++events_; };
    server_.emplace(io_, fuzz_.config_.control, "fuzz");
    server_->start(*api_);
    web_.emplace(io_, WebConfig{"127.0.0.1:0", ""});
    web_->serve([this](std::string_view request, std::function<void(std::string)> answer,
                       const std::shared_ptr<Subscriber>& client) { api_->call(request, std::move(answer), client); },
                [this](MetricsFormat format) { return metrics(monitor_->now(), format); }, control_.counters);
  }

  // Called by the run between samples.
  void step() {
    if (!api_) begin();
    Truth truth;
    truth.time = TruthTime{(run_.host().now() - HostTime{}).count()};
    std::vector<std::byte> bytes(native_truth_size);
    encode_native_truth(truth, std::span<std::byte, native_truth_size>(bytes));
    if (run_.host().arrivals.empty())
      run_.host().arrivals.push_back({run_.host().now() + std::chrono::milliseconds(5), std::move(bytes)});
    constexpr int inputs_between_samples = 8;
    for (int i = 0; i < inputs_between_samples && left_ > 0; ++i, --left_) {
      give(fuzz_.requests_.next(GetParam()));
      if (left_ % 1000 == 0) expect_an_answer();
    }
    if (left_ > 0) return;
    run_.host().stop = true;
  }

  void give(std::string_view text) {
    if (!client_) open();
    for (int i = 0; !text.empty() && i < 100; ++i) {
      const ssize_t n = ::send(client_.get(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
      io_.poll();
      if (!read() || (n < 0 && errno != EAGAIN)) return close();
    }
    if (!text.empty() || fuzz_.requests_.below(64) == 0) close();
  }

  void open() {
    const Carrier carrier = GetParam();
    waiting_.clear();
    if (carrier == Carrier::socket) {
      client_ = connect_to_socket(fuzz_.config_.control.socket);
    } else {
      const std::string address = web_->address();
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      to.sin_port = htons(carrier == Carrier::tcp
                              ? server_->port().value()
                              : static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
      client_.reset(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
      const linger reset{1, 0};  // so that the port is free at once
      ::setsockopt(client_.get(), SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
      if (::connect(client_.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) client_.reset();
    }
    ASSERT_TRUE(client_) << std::strerror(errno);
    if (carrier != Carrier::web_socket) return;
    ::send(client_.get(), upgrade_request.data(), upgrade_request.size(), MSG_NOSIGNAL);
    for (int i = 0; i < 1000 && waiting_.find("\r\n\r\n") == std::string::npos; ++i) {
      io_.poll();
      read();
    }
    EXPECT_TRUE(waiting_.starts_with("HTTP/1.1 101 ")) << waiting_;
  }
  void close() {
    client_.reset();
    io_.poll();
  }

  // Reads what has come. Returns false if the connection has ended.
  bool read() {
    for (;;) {
      const ssize_t n = ::recv(client_.get(), buffer_.data(), buffer_.size(), MSG_DONTWAIT);
      if (n <= 0) return n < 0 && errno == EAGAIN;
      if (GetParam() == Carrier::socket) {
        waiting_.append(buffer_.data(), static_cast<std::size_t>(n));
        for (std::size_t end; (end = waiting_.find('\n')) != std::string::npos; waiting_.erase(0, end + 1))
          if (++answers_ % 64 == 0) expect_json_rpc({waiting_.data(), end});
      } else if (waiting_.size() < 4096) {
        waiting_.append(buffer_.data(), static_cast<std::size_t>(n));
      }
    }
  }
  static void expect_json_rpc(std::string_view line) {
    const Json json = Json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_structured()) << line;
    for (const Json& one : json.is_array() ? json : Json::array({json})) {
      const bool is_answer = one.contains("id") && one.contains("result") != one.contains("error");
      EXPECT_TRUE(one["jsonrpc"] == "2.0" && (is_answer || one["method"].is_string())) << line;
    }
  }

  // A client of its own.
  void expect_an_answer() {
    const FileDescriptor good = connect_to_socket(fuzz_.config_.control.socket);
    const std::string_view request = "{\"jsonrpc\":\"2.0\",\"method\":\"status\",\"id\":\"good\"}\n";
    ASSERT_EQ(::send(good.get(), request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    std::string answer;
    for (int i = 0; i < 10'000 && !answer.ends_with('\n'); ++i) {
      io_.poll();
      const ssize_t n = ::recv(good.get(), buffer_.data(), buffer_.size(), MSG_DONTWAIT);
      if (n > 0) answer.append(buffer_.data(), static_cast<std::size_t>(n));
    }
    EXPECT_TRUE(answer.find("\"api\":1") != std::string::npos && answer.find("\"good\"") != std::string::npos)
        << left_ << " inputs before the end: " << answer;
  }

  ControlFuzz& fuzz_;
  long left_;
  asio::io_context io_;
  RunControl control_;
  SimulatedRun run_{fuzz_.config_};
  std::optional<Monitor> monitor_;
  Config now_ = fuzz_.config_;
  std::optional<Reloader> reloader_;
  std::optional<ControlApi> api_;
  std::optional<ControlServer> server_;
  std::optional<WebServer> web_;
  FileDescriptor client_;
  std::string waiting_;  // what the client has read
  std::array<char, 65536> buffer_;
  long answers_ = 0, events_ = 0;
};

TEST_P(ControlFuzz, AnyBytesDoNoHarm) {
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 10'000;
  constexpr long of_a_run = 20'000;  // a run has a limited number of faults
  for (long n = 0; n < inputs && !HasFailure(); n += of_a_run) Target(*this, std::min(of_a_run, inputs - n)).run();
}

std::string name_of_carrier(const testing::TestParamInfo<Carrier>& info) {
  constexpr const char* names[] = {"socket", "tcp", "http", "web_socket"};
  return names[static_cast<std::size_t>(info.param)];
}
INSTANTIATE_TEST_SUITE_P(Carriers, ControlFuzz,
                         testing::Values(Carrier::socket, Carrier::tcp, Carrier::http, Carrier::web_socket),
                         name_of_carrier);

}  // namespace
}  // namespace imud
