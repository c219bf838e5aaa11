// Ten minutes of simulated time of every product that listens, with a host that changes modes at random times: no
// byte leaves that the mode forbids, although samples are prepared before their instants.
#include <map>
#include <utility>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/control/mode_clients.hpp"
#include "tests/emulator/run/realtime_test.hpp"
#include "tests/protocols/conformance.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// The line between a device and a client, which writes every 0.1 to 60 ms.
class ClientLine final : public Port {
 public:
  ClientLine(SimulatedHost& host, ModeClient& client) : host_(host), client_(client) {}

  std::optional<Received> receive() noexcept override {
    end_command();
    if (host_.now() < next_) return std::nullopt;
    next_ = host_.now() + 100us + Nanoseconds(random_() % 60'000'000);
    written_ = client_.write(host_.now());
    is_executing_ = true;
    return Received{{std::as_bytes(std::span(written_))}, host_.now()};
  }
  void reply(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) answer_ += text(frame);
    counters_.count_sent(is_reply_, frames.size());
  }
  void send(std::span<const Frame> frames) noexcept override {
    counters_.count_sent(is_reply_, frames.size());
    for (const Frame& frame : frames) {
      if (client_.allows(text(frame), host_.now())) continue;
      if (++forbidden <= 3)
        ADD_FAILURE() << "after \"" << testing::PrintToString(written_) << "\" at " << host_.now().ns << ": "
                      << testing::PrintToString(std::string(text(frame)));
    }
  }
  int descriptor() const noexcept override { return 1001; }
  HostTime next() const { return next_; }
  std::size_t commands = 0, forbidden = 0;

 private:
  // A channel receives again after each command: then the command is executed, and its answer complete.
  void end_command() {
    if (!std::exchange(is_executing_, false)) return;
    ++commands;
    client_.on_executed(std::exchange(answer_, {}), host_.now());
  }
  static std::string_view text(const Frame& frame) {
    return {reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size()};
  }
  SimulatedHost& host_;
  ModeClient& client_;
  std::mt19937_64 random_{7};
  HostTime next_ = host_.now() + 1s;
  std::string written_, answer_;
  bool is_executing_ = false;
};

TEST_F(RealtimeTest, NoProductSendsWhatItsModeForbids) {
  Stim300Client stim300;
  VectorNavClient vectornav;
  MipClient mip;
  const std::map<std::string_view, ModeClient*> clients = {
      {"stim300", &stim300}, {"vectornav", &vectornav}, {"mip", &mip}};
  for (const Protocol* protocol : protocols()) {
    const bool has_serial_host = protocol->link == Link::bytes && overrides_receive(*protocol);
    EXPECT_EQ(clients.contains(protocol->name), has_serial_host) << protocol->name;
  }
  for (const auto& entry : clients) {
    ModeClient* const client = entry.second;  // clang 14 captures no structured binding
    SCOPED_TRACE(entry.first);
    SimulatedRun run(load_config(write("config.toml",
                                       "clock = \"realtime\"\n[truth]\nport = \"udp:127.0.0.1:9810\"\n"
                                       "[[imu]]\nport = \"pty:imu\"\n" +
                                           client->configuration())));
    ClientLine* line = nullptr;
    run.make_sensor = [&](SimulatedHost& host) {
      auto made = std::make_unique<ClientLine>(host, *client);
      line = made.get();
      host.next_input = [&](int) { return line->next(); };
      return made;
    };
    HostTime power_at = run.at(5);
    run.host().on_wait = [&, random = std::mt19937_64(9)]() mutable {
      if (run.host().now() < power_at) return;
      power_at = run.host().now() + Nanoseconds(random() % 10'000'000'000);
      run.engine().power_cycle.make();
      client->on_power(run.host().now());
    };
    run.run(600);
    EXPECT_GT(line->commands, 15'000U);
    EXPECT_EQ(line->forbidden, 0U);
    for (const std::string& frame : client->expected_frames) EXPECT_GT(client->frames[frame], 100U) << frame;
    for (const std::string& mode : client->expected_modes) EXPECT_GT(client->modes[mode], 20U) << mode;
  }
}

}  // namespace
}  // namespace imud
