// A run that cannot begin leaves the results of the run before and of a run in progress as they are.
#include <netinet/in.h>

#include <array>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

// A socket that has a port of its own.
class TakenPort {
 public:
  explicit TakenPort(int type) : socket_(::socket(AF_INET, type | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), size) == 0 && type == SOCK_STREAM)
      ::listen(socket_.get(), 1);
    ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  std::string address() const { return fmt::format("127.0.0.1:{}", port_); }

 private:
  FileDescriptor socket_;
  int port_ = 0;
};

class OldResults : public LiveTest {
 protected:
  static constexpr std::array names = {"out", "copy", "summary.json", "labels", "junit", "quality", "record"};

  OldResults() {
    config("realtime", simulator_.port(), "native", 100, "native", "file:" + path("out"));
    write("token", "0123456789abcdef\n");
  }
  std::vector<std::string> command(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {
        "run",      path("config.toml"), "--set",     fmt::format("imu.0.also=[\"file:{}\"]", path("copy")),
        "--labels", path("labels"),      "--junit",   path("junit"),
        "--record", path("record"),      "--summary", path("summary.json")};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

TEST_F(OldResults, StayIfTheRunCannotBegin) {
  const TakenPort udp(SOCK_DGRAM), tcp(SOCK_STREAM);
  const std::string other = write("other", "precious");
  const std::string quality = path("quality");
  const std::vector<std::string> causes[] = {
      {"--quality", quality, "--set", "truth.port=udp:" + udp.address()},
      {"--quality", quality, "--set", "web.listen=" + tcp.address()},
      {"--quality", quality, "--set", "web.listen=127.0.0.1:0", "--set", "web.token_file=" + path("none")},
      {"--quality", quality, "--set", "control.listen=" + tcp.address(), "--set",
       "control.token_file=" + path("token")},
      {"--quality", quality, "--set", "control.socket=" + other},
      {"--quality", path("none/quality")},
      {"--quality", quality, "--set", fmt::format("imu.0.also=[\"file:{}\", \"pty:{}\"]", path("copy"), other)}};
  for (const auto& cause : causes) {
    for (const char* name : names) write(name, std::string("old ") + name);
    const ProgramResult result = run_program("imud", command(cause));
    EXPECT_EQ(result.exit_code, 2) << cause.back() << result.errors;
    for (const char* name : names) EXPECT_EQ(read_file(path(name)), std::string("old ") + name) << cause.back();
  }
}

TEST_F(OldResults, GoWhenTheRunBegins) {
  for (const char* name : names) write(name, std::string("old ") + name);
  Program imud("imud");
  imud.start(command({"--quality", path("quality")}));
  ASSERT_TRUE(imud.wait_for_errors(" ready"));
  for (const char* name : {"out", "copy", "labels", "junit"}) EXPECT_EQ(read_file(path(name)), "") << name;
  EXPECT_EQ(summary()["complete"], false);
  EXPECT_FALSE(read_file(path("record")).starts_with("old"));
  EXPECT_FALSE(read_file(path("quality")).starts_with("old"));
  imud.stop();
}

TEST_F(OldResults, OfARunInProgressStay) {
  Program imud("imud");
  imud.start(command());
  ASSERT_TRUE(imud.wait_for_errors(" ready"));
  ASSERT_TRUE(simulator_.exchange(Simulator::truth(0, 0, true)));
  for (std::uint32_t k = 1; k < 20; ++k) ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * k, k, true)));
  ASSERT_TRUE(eventually([&] { return !read_file(path("out")).empty() && !read_file(path("copy")).empty(); }));
  const std::string out = read_file(path("out")), copy = read_file(path("copy")), record = read_file(path("record"));
  const std::string taken = "is written by another process";
  const auto refused = [&](const std::vector<std::string>& more, const std::string& file) {
    const ProgramResult result = run_program("imud", command(more));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.errors.find(file), std::string::npos) << result.errors;
    EXPECT_TRUE(read_file(path("out")).starts_with(out));
    EXPECT_TRUE(read_file(path("copy")).starts_with(copy));
    EXPECT_TRUE(read_file(path("record")).starts_with(record));
    return result.errors;
  };
  const std::string other_truth = "truth.port=udp:127.0.0.1:0", other_out = "imu.0.port=file:" + path("out2");
  EXPECT_NE(refused({}, path("summary.json")).find(taken), std::string::npos);
  const std::vector<std::string> no_record = {"run", path("config.toml"), "--set", other_truth};
  for (const char* option : {"record", "summary.json", "labels", "junit"}) {
    const std::string name = option;
    std::vector<std::string> one = no_record;
    one.insert(one.end(), {"--set", other_out, "--" + name.substr(0, name.find('.')), path(name)});
    const ProgramResult result = run_program("imud", one);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_NE(result.errors.find(path(name) + ": " + taken), std::string::npos) << result.errors;
  }
  const ProgramResult same_out = run_program("imud", no_record);
  EXPECT_EQ(same_out.exit_code, 2);
  EXPECT_NE(same_out.errors.find(path("out") + ": " + taken), std::string::npos) << same_out.errors;
  EXPECT_TRUE(read_file(path("out")).starts_with(out));
  imud.stop();
  EXPECT_EQ(run_program("imud", {"run", path("config.toml"), "--set", other_truth, "--for", "0.1"}).exit_code, 0)
      << "the file is free again";
}

}  // namespace
}  // namespace imud
