// Truth by a connection: TCP and Unix sockets, by TruthIntake and by whole runs; simulators that disconnect within a
// line, and come back.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <charconv>
#include <cstring>
#include <regex>

#include "emulator/truth/truth_intake.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/transports/capture_builder.hpp"
#include "transports/host_clock.hpp"

namespace imud {
namespace {

using Taken = TruthIntake::Outcome;

// A simulator's end of a connection.
class Connection {
 public:
  explicit Connection(FileDescriptor socket) : socket_(std::move(socket)) {}
  // Connects to "scheme:127.0.0.1:PORT", or to "scheme:PATH".
  explicit Connection(const std::string& port) {
    const std::string address = port.substr(port.find(':') + 1);
    sockaddr_storage storage{};
    if (address.starts_with('/')) {
      auto& path = reinterpret_cast<sockaddr_un&>(storage);
      path.sun_family = AF_UNIX;
      address.copy(path.sun_path, sizeof path.sun_path - 1);
    } else {
      auto& v4 = reinterpret_cast<sockaddr_in&>(storage);
      v4.sin_family = AF_INET;
      v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      v4.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.find(':') + 1))));
    }
    socket_.reset(::socket(storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const socklen_t size = storage.ss_family == AF_UNIX ? sizeof(sockaddr_un) : sizeof(sockaddr_in);
    EXPECT_EQ(::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&storage), size), 0) << port;
  }
  void send(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t sent = ::send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL);
      ASSERT_GT(sent, 0);
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
  }
  // Returns the next line, without its line feed; empty if none comes.
  std::string line() {
    std::string text;
    for (char c = 0;; text += c) {
      pollfd ready{socket_.get(), POLLIN, 0};
      if (::poll(&ready, 1, static_cast<int>(Program::default_timeout.count())) <= 0 ||
          ::recv(socket_.get(), &c, 1, 0) != 1)
        return {};
      if (c == '\n') return text;
    }
  }

 private:
  FileDescriptor socket_;
};

// A simulator that listens at a free port.
class ListeningSimulator {
 public:
  ListeningSimulator() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_.get(), 4), 0);
    ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    port_ = fmt::format("tcp:127.0.0.1:{}", ntohs(address.sin_port));
  }
  const std::string& port() const { return port_; }
  Connection accept() const {
    pollfd ready{socket_.get(), POLLIN, 0};
    EXPECT_EQ(::poll(&ready, 1, static_cast<int>(Program::default_timeout.count())), 1);
    return Connection(FileDescriptor(::accept(socket_.get(), nullptr, nullptr)));
  }

 private:
  FileDescriptor socket_;
  std::string port_;
};

// A text format that greets its simulator, and answers each truth: "NS\n", answered by "reached NS\n".
class AnsweringDecoder final : public TruthDecoder {
 public:
  void start(HostTime now) noexcept override { deadline_ = now; }
  std::optional<HostTime> deadline() const noexcept override { return deadline_; }
  void poll(HostTime, FrameBuffer& out) noexcept override {
    deadline_.reset();
    push("hello\n", out);
  }
  void feed(std::span<const std::byte> bytes, TruthInput input, HostTime) noexcept override {
    EXPECT_EQ(input, TruthInput::stream);
    rest_ = {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    while (!rest_.empty()) {
      const char c = rest_.front();
      rest_.remove_prefix(1);
      if (c != '\n') {
        line_ += c;
        continue;
      }
      truth = {};
      truth.acknowledge = true;
      const auto [end, error] = std::from_chars(line_.data(), line_.data() + line_.size(), truth.time.ns);
      const bool is_whole = error == std::errc() && end == line_.data() + line_.size();
      line_.clear();
      return is_whole ? TruthResult::ok : TruthResult::bad_number;
    }
    return std::nullopt;
  }
  void finish() noexcept override {
    losses_.cut_short += line_.empty() ? 0 : 1;
    line_.clear();
  }
  void acknowledge(const Truth& truth, TruthTime, std::uint64_t, FrameBuffer& out) noexcept override {
    push(fmt::format("reached {}\n", truth.time.ns), out);
  }

 private:
  static void push(std::string_view text, FrameBuffer& out) noexcept {
    std::memcpy(out.room(text.size()).data(), text.data(), text.size());
    out.push(text.size());
  }
  std::string_view rest_;
  std::string line_;
  std::optional<HostTime> deadline_;
};

constexpr TruthFormat answering = {
    .name = "answering",
    .summary = "a text that is answered",
    .document = "this file",
    .delimits_itself = true,
    .acknowledges = true,
    .settings = {},
    .make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<AnsweringDecoder>(); },
};

class TruthConnectionTest : public LiveTest {
 protected:
  std::unique_ptr<TruthIntake> intake(const std::string& port) {
    TruthConfig truth;
    truth.port = port;
    truth.format = &answering;
    truth.settings = Settings(answering.settings);
    return std::make_unique<TruthIntake>(truth, timeline_, open_port(port, Role::listener));
  }
  // Serves the simulator, as the loop does, until `condition` is fulfilled.
  template <class Condition>
  bool serve(TruthIntake& intake, Condition condition) {
    return eventually([&] {
      if (const auto deadline = intake.deadline(); deadline) intake.poll(host_now());
      for (Taken outcome = intake.take(); outcome != Taken::nothing; outcome = intake.take()) {
        outcomes_.push_back(outcome);
        if (intake.answer_due()) intake.answer(timeline_.newest(), 0);
      }
      return condition();
    });
  }
  // Sends truths, each after the answer to the one before, as in lockstep.
  void exchange(TruthIntake& intake, Connection& simulator, std::int64_t from, std::int64_t to) {
    for (std::int64_t ns = from; ns != to; ++ns) {
      simulator.send(fmt::format("{}\n", ns));
      const std::uint64_t before = intake.counters().accepted;
      ASSERT_TRUE(serve(intake, [&] { return intake.counters().accepted > before; })) << ns;
      ASSERT_EQ(simulator.line(), fmt::format("reached {}", ns));
    }
  }

  static std::string header() {
    return "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,"
           "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z\n";
  }
  static std::string rows_of(int from_ms, int to_ms) {
    std::string text;
    for (int ms = from_ms; ms < to_ms; ms += 10) text += fmt::format("{}000000,0,0,0,0,0,0,1,2,3\n", ms);
    return text;
  }
  // A simulator that sends a second, disconnects within a line, and comes back twice: from its beginning, and where
  // it had stopped.
  template <class Connect>
  void disconnect_and_return(Program& imud, Connect connect) {
    const auto disconnected = [&](int times) {
      return eventually([&] {
        const std::string log = imud.errors();
        int seen = 0;
        for (std::size_t at = 0; (at = log.find(" is disconnected", at)) != std::string::npos; ++at) ++seen;
        return seen >= times;
      });
    };
    connect().send(header() + rows_of(0, 1000) + "1000000000,0,0,0,0");
    ASSERT_TRUE(disconnected(1));
    connect().send(header() + rows_of(0, 500) + "500");
    ASSERT_TRUE(disconnected(2));
    connect().send(rows_of(500, 700));
    ASSERT_TRUE(disconnected(3));
    EXPECT_EQ(imud.stop(), 0);
    EXPECT_EQ(imud.errors().find("refused"), std::string::npos) << imud.errors();
    const auto s = summary();
    EXPECT_EQ(s["truth"]["accepted"], 100 + 50 + 20);
    EXPECT_EQ(s["truth"]["refused"].size(), 0U) << s["truth"]["refused"];
    EXPECT_EQ(s["truth"]["runs"], 2);
    EXPECT_EQ(s["truth"]["disconnections"], 3);
    EXPECT_EQ(s["truth"]["truncated"], 2);
    const auto all = rows(read_file(path("out")));
    ASSERT_EQ(all.size(), 100U + 70U);
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_EQ(all[i][0], std::to_string((i < 100 ? i : i - 100) * 10'000'000));
  }

  Timeline timeline_;
  std::vector<Taken> outcomes_;
};

TEST_F(TruthConnectionTest, AnswersAreSentOnTheStream) {
  for (const std::string& port : {std::string("tcp-listen:127.0.0.1:0"), "unix-listen:" + path("socket")}) {
    timeline_ = Timeline();
    const auto listening = intake(port);
    const std::string at = listening->chosen_port().empty() ? port : listening->chosen_port();
    for (std::uint64_t times = 0; times < 3; ++times) {
      Connection simulator(at);
      const auto first = static_cast<std::int64_t>(10 * times);
      ASSERT_TRUE(serve(*listening, [&] {
        const auto& seen = listening->counters();
        return seen.disconnections == times && seen.port_state.load() == PortState::ready &&
               listening->deadline() == std::nullopt;
      }));
      EXPECT_EQ(simulator.line(), "hello");
      exchange(*listening, simulator, first, first + 10);
      simulator.send("77");
    }
    ASSERT_TRUE(serve(*listening, [&] { return listening->counters().disconnections == 3; }));
    EXPECT_EQ(listening->counters().accepted, 30U);
    EXPECT_EQ(listening->counters().truncated, 3U);
    EXPECT_EQ(listening->counters().runs, 1U);
  }
}

TEST_F(TruthConnectionTest, EachConnectionIsGreeted) {
  const ListeningSimulator simulator;
  const auto connecting = intake(simulator.port());
  for (int times = 0; times < 2; ++times) {
    ASSERT_TRUE(serve(*connecting, [&] { return connecting->descriptor() >= 0; }));
    Connection connection = simulator.accept();
    ASSERT_TRUE(serve(*connecting, [&] { return !connecting->deadline(); }));
    EXPECT_EQ(connection.line(), "hello");
    exchange(*connecting, connection, 10 * times, 10 * times + 5);
  }
  EXPECT_EQ(connecting->counters().refused[static_cast<std::size_t>(Refusal::bad_number)], 0U);
}

TEST_F(TruthConnectionTest, ANewConnectionFromAnEarlierTimeBeginsARun) {
  const auto listening = intake("tcp-listen:127.0.0.1:0");
  const auto send = [&](const std::string& text, std::uint64_t accepted) {
    Connection(listening->chosen_port()).send(text);
    const std::uint64_t before = listening->counters().disconnections;
    ASSERT_TRUE(serve(*listening, [&] { return listening->counters().disconnections > before; }));
    EXPECT_EQ(listening->counters().accepted, accepted);
  };
  send("0\n1\n2\n", 3);
  send("0\n1\n2\n", 6);  // begins as the first, less than a second after it
  EXPECT_EQ(listening->counters().runs, 2U);
  send("3\n4\n", 8);  // continues
  EXPECT_EQ(listening->counters().runs, 2U);
  send("4\n5\n", 9);  // repeats the newest
  EXPECT_EQ(listening->counters().runs, 2U);
  send("3600000000000\n", 10);  // later by more than max_gap_ms
  EXPECT_EQ(listening->counters().runs, 3U);
}

TEST_F(TruthConnectionTest, ASimulatorConnectsDisconnectsAndComesBack) {
  for (const std::string& port : {std::string("tcp-listen:127.0.0.1:0"), "unix-listen:" + path("truth")}) {
    const std::string c = config("lockstep", port, "csv", 100, "csv", "file:" + path("out"));
    Program imud("imud");
    start(imud, c);
    ASSERT_TRUE(imud.wait_for_errors("ready"));
    std::string at = port;
    if (port.ends_with(":0")) {
      std::smatch chosen;
      const std::string log = imud.errors();
      ASSERT_TRUE(std::regex_search(log, chosen, std::regex("truth.port is (tcp-listen:127.0.0.1:[1-9][0-9]*)\n")));
      at = chosen[1];
    }
    disconnect_and_return(imud, [&] { return Connection(at); });
  }
}

TEST_F(TruthConnectionTest, ASimulatorThatIsConnectedToEndsAndComesBack) {
  const ListeningSimulator simulator;
  const std::string c = config("lockstep", simulator.port(), "csv", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  disconnect_and_return(imud, [&] { return simulator.accept(); });
}

TEST_F(TruthConnectionTest, ASecondConnectionIsRefusedAndReported) {
  const std::string c = config("lockstep", "unix-listen:" + path("truth"), "csv", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  ASSERT_TRUE(imud.wait_for_errors("ready"));
  const Connection simulator("unix:" + path("truth"));
  simulator.send(header() + rows_of(0, 100));
  Connection second("unix:" + path("truth"));
  EXPECT_EQ(second.line(), "");
  ASSERT_TRUE(imud.wait_for_errors("has refused a second connection"));
  simulator.send(rows_of(100, 200));
  ASSERT_TRUE(eventually([&] { return rows(read_file(path("out"))).size() == 20; }));
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["truth"]["connections_refused"], 1);
  EXPECT_EQ(summary()["truth"]["accepted"], 20);
}

// A product behind a serial device server.
TEST_F(TruthConnectionTest, ADeviceIsReadByTcp) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "native", "tcp-listen:127.0.0.1:0");
  Program imud("imud");
  start(imud, c, {"--wait-for-reader"});
  ASSERT_TRUE(imud.wait_for_errors("waiting for a reader"));
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "240"});
  std::smatch chosen;
  const std::string log = imud.errors();
  ASSERT_TRUE(std::regex_search(log, chosen, std::regex("imu.imu1.port is tcp-listen(:127.0.0.1:[1-9][0-9]*)\n")))
      << log;
  for (int times = 0; times < 2; ++times) {
    const ProgramResult decoded =
        run_program("imu-decode", {"native", "tcp" + std::string(chosen[1]), "--count", "40"});
    EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
    EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
    EXPECT_NE(decoded.errors.find("0 bytes skipped"), std::string::npos) << decoded.errors;
  }
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  const auto imu = summary()["imus"][0];
  EXPECT_EQ(imu["frames"].get<std::uint64_t>() + imu["dropped"].get<std::uint64_t>(), imu["samples"]);
}

// A capture of a simulator that disconnects within a line and comes back; its segments have no regard for lines.
TEST_F(TruthConnectionTest, ACaptureOfConnectionsIsReplayed) {
  constexpr unsigned simulator = 10001, listener = 40000;
  capture::Bytes content = capture::file_header({}, 1);
  std::int64_t ns = 0;
  const auto add = [&](std::uint32_t sequence, const std::string& payload, unsigned flags) {
    const capture::Bytes segment = capture::tcp(payload, simulator, listener, sequence, flags);
    content += capture::file_record({}, {ns += 1000, capture::ethernet(0x0800, capture::ipv4(segment, {{}, 6}))});
  };
  std::uint32_t sequence = 0xFFFF'FF00;
  for (const std::string& text : {header() + rows_of(0, 1000) + "1000000000,0,0,0,0", header() + rows_of(0, 500)}) {
    add(sequence++, "", capture::syn);
    std::size_t i = 0;
    for (std::size_t at = 0; at < text.size(); at += 100, ++i) {
      const bool is_swapped = at + (i % 2 == 0 ? 200 : 100) <= text.size();  // pairs of whole segments
      const std::size_t swapped = !is_swapped ? at : i % 2 == 0 ? at + 100 : at - 100;
      add(sequence + static_cast<std::uint32_t>(swapped), text.substr(swapped, 100), capture::ack);
      if (i % 5 == 0) add(sequence + static_cast<std::uint32_t>(swapped), text.substr(swapped, 100), capture::ack);
    }
    add(sequence + static_cast<std::uint32_t>(text.size()), "", capture::fin);
    sequence += 100'000;
  }
  capture::write_file(path("flight.pcap"), content);
  // The port is that of the configuration.
  const std::string c = config("lockstep", "tcp:127.0.0.1:10001", "csv", 100, "csv", "file:" + path("out"));
  const ProgramResult replayed =
      run_program("imud", {"replay", c, path("flight.pcap"), "--fast", "--summary", path("summary.json")});
  EXPECT_EQ(replayed.exit_code, 3) << "a line is cut short: " << replayed.errors;
  const auto s = summary();
  EXPECT_EQ(s["truth"]["accepted"], 150) << replayed.errors;
  EXPECT_EQ(s["truth"]["refused"].size(), 0U) << s["truth"]["refused"];
  EXPECT_EQ(s["truth"]["runs"], 2);
  EXPECT_EQ(s["truth"]["truncated"], 1);
  EXPECT_EQ(rows(read_file(path("out"))).size(), 150U);
}

TEST_F(TruthConnectionTest, PortsAreChecked) {
  const auto fault = [&](const std::string& port, const std::string& format) {
    const std::string c = config("lockstep", port, format, 100, "csv", "file:" + path("out"));
    const ProgramResult checked = run_program("imud", {"check", c});
    EXPECT_EQ(checked.exit_code, 2);
    return checked.errors;
  };
  EXPECT_NE(fault("tcp:127.0.0.1:9810", "native").find("whose borders tcp: does not keep"), std::string::npos);
  EXPECT_NE(fault("tcp:127.0.0.l:9810", "csv").find("right would be ADDR:PORT with a numeric address or a name"),
            std::string::npos);
  EXPECT_NE(fault("tcp:127.0.0.1:0", "csv").find("only a listener's port is chosen"), std::string::npos);
  EXPECT_NE(fault("unix:x?y=1", "csv").find("unix has none"), std::string::npos);
  // Two ports that the system chooses are not the same.
  const std::string two = write("two.toml", R"(
clock = "lockstep"
truth = {port = "tcp-listen:127.0.0.1:0", format = "csv"}
[[imu]]
protocol = "stim300"
port = "tcp-listen:127.0.0.1:0"
[[imu]]
protocol = "stim300"
port = "tcp-listen:127.0.0.1:0"
)");
  EXPECT_EQ(run_program("imud", {"check", two}).exit_code, 0);
  const ProgramResult same = run_program("imud", {"check", two, "--set", "imu.*.port=tcp-listen:127.0.0.1:4001"});
  EXPECT_EQ(same.exit_code, 2);
  EXPECT_NE(same.errors.find("the same as imu.0; give another"), std::string::npos) << same.errors;
}

}  // namespace
}  // namespace imud
