// `imud ctl`: over TCP, and its words about runs that were killed.
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <csignal>
#include <thread>

#include "tests/emulator/control/controlled_run.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class ControlCtl : public ControlledRun {
 protected:
  struct Result {
    int exit_code;
    std::string text;
  };
  static Result ctl(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "ctl");
    const ProgramResult result = run_program("imud", arguments);
    return {result.exit_code, result.output + result.errors};
  }
  // A configuration whose socket is found by its name, or by its process number.
  std::string named(const std::string& name) {
    const std::string config = running(name.empty() ? "" : fmt::format("name = \"{}\"\n", name));
    std::string text = read_file(config);
    const std::string socket = path("socket");
    text.replace(text.find(socket), socket.size(), "auto");
    return write("named.toml", text);
  }
  std::string killed_run(const std::string& config) {
    Program imud("imud");
    start(imud, config);
    EXPECT_TRUE(imud.wait_for_errors("ready")) << imud.errors();
    const std::string number = fmt::to_string(imud.pid());
    imud.stop(SIGKILL);
    return number;
  }

  const SetVariable runtime_{"XDG_RUNTIME_DIR", folder_}, service_{"RUNTIME_DIRECTORY", {}};
};

TEST_F(ControlCtl, SpeaksOverTcpWithTheToken) {
  write("token", "0123456789abcdef-token\n");
  write("wrong", "0123456789abcdef-tokem\n");
  for (const char* file : {"token", "wrong"}) ASSERT_EQ(::chmod(path(file).c_str(), 0600), 0);
  Program imud("imud");
  start(imud, running(fmt::format("listen = \"127.0.0.1:0\"\ntoken_file = \"{}\"\n", path("token"))));
  ASSERT_TRUE(imud.wait_for_errors("ready"));
  const std::string to = fmt::format("127.0.0.1:{}", tcp_port(imud)), token = path("token");
  const Result status = ctl({"--to", to, "--token-file", token, "status", "--json"});
  EXPECT_EQ(status.exit_code, 0) << status.text;
  EXPECT_EQ(nlohmann::json::parse(status.text)["pid"], imud.pid());
  EXPECT_TRUE(ctl({"--to", to, "--token-file", token, "mark", "text=a"}).text.starts_with("imu1: from sample "));
  const Result wrong = ctl({"--to", to, "--token-file", path("wrong"), "status"});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_TRUE(contains(wrong.text, "the token is not that of the run")) << wrong.text;
  EXPECT_EQ(ctl({"--to", to, "status"}).exit_code, 2) << "no token";
  EXPECT_EQ(ctl({"--token-file", token, "status"}).exit_code, 2) << "no address";
  EXPECT_EQ(ctl({"--to", to, "--token-file", token, "--socket", path("socket"), "status"}).exit_code, 2);
  EXPECT_EQ(ctl({"--to", to, "--token-file", token}).exit_code, 2) << "no method";
  const Result remote = ctl({"--to", "192.0.2.1:7700", "--token-file", token, "status"});
  EXPECT_EQ(remote.exit_code, 2);
  EXPECT_TRUE(contains(remote.text, "give a loopback address and a port")) << remote.text;
  ::chmod(token.c_str(), 0644);
  EXPECT_TRUE(contains(ctl({"--to", to, "--token-file", token, "status"}).text, "others can read the token"));
  ::chmod(token.c_str(), 0600);
  EXPECT_EQ(ctl({"--to", to, "--token-file", token, "quit"}).exit_code, 0);
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
  const Result none = ctl({"--to", to, "--token-file", token, "status"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_TRUE(contains(none.text, "Connection refused; does an imud run with that [control] listen?")) << none.text;
}

TEST_F(ControlCtl, NamesTheRunThatWasKilled) {
  const std::string config = named("bench");
  killed_run(config);
  ASSERT_TRUE(std::filesystem::exists(path("imud-bench.sock")));
  const Result by_name = ctl({"--name", "bench", "status"});
  EXPECT_EQ(by_name.exit_code, 1);
  EXPECT_EQ(by_name.text, fmt::format("imud: bench does not run: it was killed, and has left {}, which the next run "
                                      "removes\n",
                                      path("imud-bench.sock")));
  EXPECT_EQ(ctl({"--socket", path("imud-bench.sock"), "status"}).text,
            fmt::format("imud: {}: no imud listens there any more: it was killed, and its next run replaces the "
                        "socket\n",
                        path("imud-bench.sock")));
  EXPECT_EQ(
      ctl({"--socket", path("absent.sock"), "status"}).text,
      fmt::format("imud: {}: there is no such socket: does that imud run, with this path?\n", path("absent.sock")));
  Program next("imud");
  start(next, config);
  ASSERT_TRUE(next.wait_for_errors("ready")) << next.errors();
  EXPECT_EQ(ctl({"--name", "bench", "quit"}).exit_code, 0);
  EXPECT_EQ(next.wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(path("imud-bench.sock")));
}

TEST_F(ControlCtl, DoesNotWaitForARunThatIsStopped) {
  Program imud("imud");
  start(imud, named("bench"));
  ASSERT_TRUE(imud.wait_for_errors("ready")) << imud.errors();
  ASSERT_EQ(ctl({"--name", "bench", "status"}).exit_code, 0);
  ASSERT_EQ(::kill(imud.pid(), SIGSTOP), 0);
  for (const bool by_name : {true, false}) {
    const std::string run = by_name ? "bench" : path("imud-bench.sock");
    const Result silent = ctl({by_name ? "--name" : "--socket", run, "status"});
    EXPECT_EQ(silent.exit_code, 1);
    EXPECT_EQ(silent.text,
              fmt::format("imud: {}: has not answered within 2 s: its process is stopped or too busy, or "
                          "ends\n",
                          run));
  }
  ASSERT_EQ(::kill(imud.pid(), SIGCONT), 0);
  EXPECT_EQ(imud.stop(), 0);
}

// Another program may listen at the path.
TEST_F(ControlCtl, RefusesTheAnswerOfAnotherProgram) {
  const std::vector<std::string> answers = {
      "{}", "[]", "{\"result\": 1}", "{\"error\": {}}", "{\"error\": 1}", "{\"result\": {\"imus\": 1}}"};
  ControlSocketFile file(path("other.sock"));
  const FileDescriptor listener(file.release());
  std::size_t served = 0;
  for (const std::string& answer : answers) {
    std::thread other([&] {
      pollfd ready{listener.get(), POLLIN, 0};
      if (::poll(&ready, 1, 30'000) != 1) return;
      const FileDescriptor client(::accept(listener.get(), nullptr, nullptr));
      std::string request(1000, ' ');
      if (::recv(client.get(), request.data(), request.size(), 0) <= 0) return;
      const std::string line = answer + "\n";
      served += ::send(client.get(), line.data(), line.size(), MSG_NOSIGNAL) > 0 ? 1 : 0;
    });
    const Result result = ctl({"--socket", path("other.sock"), "status"});
    other.join();
    EXPECT_EQ(result.exit_code, 1) << answer;
    EXPECT_TRUE(result.text.starts_with("imud: the answer is ")) << answer << ": " << result.text;
  }
  EXPECT_EQ(served, answers.size());
}

// Other tests may run imud meanwhile.
TEST_F(ControlCtl, TheExitCodeOfAnEmptyListIs1) {
  const Result list = ctl({"--json"});
  const nlohmann::json found = nlohmann::json::parse(list.text);
  ASSERT_TRUE(found.is_array()) << list.text;
  EXPECT_EQ(list.exit_code, found.empty() ? 1 : 0);
}

TEST_F(ControlCtl, TakesOfTwoRunsOfOneNameTheOneInTheFirstFolder) {
  const std::string config = named("bench");
  ASSERT_TRUE(std::filesystem::create_directory(path("service")));
  ASSERT_EQ(::chmod(path("service").c_str(), 0700), 0);
  Program later("imud"), first("imud");
  start(later, config);
  ASSERT_TRUE(later.wait_for_errors("ready")) << later.errors();
  const SetVariable service("RUNTIME_DIRECTORY", path("service"));
  first.start({"run", config, "--set", "truth.port=udp:127.0.0.1:0"});
  ASSERT_TRUE(first.wait_for_errors("ready")) << first.errors();
  const Result status = ctl({"--name", "bench", "status", "--json"});
  ASSERT_EQ(status.exit_code, 0) << status.text;
  EXPECT_EQ(nlohmann::json::parse(status.text)["pid"], first.pid());
  EXPECT_EQ(first.stop(), 0);
  EXPECT_EQ(later.stop(), 0);
}

// No later run has the process number of one that was killed.
TEST_F(ControlCtl, TheNextRunRemovesSocketsOfProcessNumbers) {
  const std::string config = named("");
  const std::string socket = path(fmt::format("imud-{}.sock", killed_run(config)));
  ASSERT_TRUE(std::filesystem::is_socket(socket));
  write("imud-file.sock", "no socket");
  Program next("imud"), third("imud");
  start(next, config);
  ASSERT_TRUE(next.wait_for_errors("ready")) << next.errors();
  EXPECT_FALSE(std::filesystem::exists(socket));
  // Neither other files nor the sockets of those that run are touched.
  third.start({"run", config, "--set", "truth.port=udp:127.0.0.1:0"});
  ASSERT_TRUE(third.wait_for_errors("ready")) << third.errors();
  EXPECT_TRUE(std::filesystem::exists(path("imud-file.sock")));
  for (Program* run : {&next, &third}) {
    const Result status = ctl({"--name", fmt::to_string(run->pid()), "status"});
    EXPECT_EQ(status.exit_code, 0) << status.text;
    EXPECT_EQ(run->stop(), 0);
  }
}

}  // namespace
}  // namespace imud
