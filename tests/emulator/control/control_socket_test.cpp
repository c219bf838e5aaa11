// The sockets of the control protocol: who may connect, and what a client can do to a run.
#include <arpa/inet.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <random>
#include <utility>

#include "emulator/control/control_server.hpp"
#include "emulator/control/token.hpp"
#include "emulator/ground/text_file.hpp"
#include "tests/emulator/control/controlled_run.hpp"
#include "tests/tools/processor_time.hpp"

namespace imud {
namespace {

using nlohmann::json;

class ControlSocket : public ControlledRun {};

TEST_F(ControlSocket, AHundredClientsAndStalledOnesLeaveTheRunAlone) {
  Program imud("imud");
  start(imud, running());
  std::vector<std::unique_ptr<ControlClient>> clients;
  for (int i = 0; i < 100; ++i) clients.push_back(std::make_unique<ControlClient>(path("socket")));
  for (auto& client : clients)
    EXPECT_EQ(client->call("subscribe", {{"what", "samples"}})["result"]["subscribed"].size(), 1U);
  // The first ten read nothing from now on. One more sends requests with long answers, and reads none of them.
  ControlClient flood(path("socket"));
  const std::string request = "{\"jsonrpc\": \"2.0\", \"method\": \"list\", \"id\": 1}\n";
  for (int i = 0, waits = 0; i < 20'000 && waits < 100; ++i)
    if (flood.send_some(request) == 0 && ++waits > 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  while (flood.receive()) {
  }
  EXPECT_FALSE(flood.send(request) && flood.send(request) && flood.receive()) << "it was closed";
  const std::uint64_t before = samples(*clients[50]);
  for (std::size_t i = 10; i < clients.size(); ++i) EXPECT_FALSE(clients[i]->notification("samples").is_null());
  // As many changes as the connection takes: each gets its answer, in order, or is refused as too many.
  ControlClient marks(path("socket"));
  constexpr int count = 2000;
  std::thread sender([&] {
    for (int i = 0; i < count; ++i)
      marks.send(
          fmt::format("{{\"jsonrpc\":\"2.0\",\"method\":\"mark\",\"params\":{{\"text\":\"a\"}},\"id\":{}}}\n", i));
  });
  for (int i = 0; i < count; ++i) {
    const auto line = marks.receive();
    if (!line) {
      ADD_FAILURE() << "closed after " << i << " answers";
      break;
    }
    const json answer = json::parse(*line);
    EXPECT_EQ(answer["id"], i);
    EXPECT_TRUE(answer.contains("result")) << answer;
  }
  sender.join();
  EXPECT_GT(samples(*clients[50]), before);
  clients.clear();
  ControlClient last(path("socket"));
  EXPECT_EQ(last.call("status")["result"]["lost"]["events"], 0);
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(ControlSocket, AnyBytesLeaveTheRunAlone) {
  Program imud("imud");
  start(imud, running());
  ControlClient watch(path("socket"));
  std::mt19937 random(3);
  const std::string good = "{\"jsonrpc\": \"2.0\", \"method\": \"mark\", \"params\": {\"text\": \"a\"}, \"id\": 1}\n";
  const std::string pieces[] = {"{",    "}",     "[",    "\n",      "\"quit\":", "\"set\"",
                                "null", "1e999", "\xFF", "\\u0000", good};
  for (int i = 0; i < 300; ++i) {
    ControlClient client(path("socket"));
    std::string bytes = good;
    for (std::size_t n = random() % 40; n > 0; --n) {
      bytes.insert(random() % (bytes.size() + 1), pieces[random() % std::size(pieces)]);
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    if (i % 50 == 0) bytes.assign(200'000, i % 100 == 0 ? '[' : 'x');  // longer than a request may be
    client.send(bytes);
    if (i % 3 == 0) client.send(good);
    if (i % 2 == 0) client.receive();
  }
  EXPECT_GT(samples(watch), 0U);
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
}

TEST_F(ControlSocket, ARequestThatIsTooLongIsRefused) {
  Program imud("imud");
  start(imud, running());
  ControlClient client(path("socket"));
  client.send(std::string(100'000, ' '));
  const auto line = client.receive();
  ASSERT_TRUE(line);
  EXPECT_EQ(json::parse(*line)["error"]["message"], "Invalid Request: longer than 65536 bytes");
  EXPECT_FALSE(client.receive());
  // Without a line feed at its end, as the last request of a client that sends nothing more.
  FileDescriptor half = connect_to_socket(path("socket"));
  const std::string request = R"({"jsonrpc": "2.0", "method": "mark", "params": {"text": "end"}, "id": "last"})";
  EXPECT_EQ(::send(half.get(), request.data(), request.size(), 0), static_cast<ssize_t>(request.size()));
  ::shutdown(half.get(), SHUT_WR);
  ControlClient reader(std::move(half));
  const auto answer = reader.receive();
  ASSERT_TRUE(answer);
  EXPECT_EQ(json::parse(*answer)["id"], "last");
  EXPECT_FALSE(reader.receive());
  EXPECT_EQ(imud.stop(), 0);
}

// With too many open files a connection waits. It is served when a file has been closed.
TEST_F(ControlSocket, WaitsForRoomWithTooManyOpenFiles) {
  Program imud("imud");
  start(imud, running());
  ASSERT_TRUE(imud.wait_for_errors("ready"));
  EXPECT_GT(ControlClient(path("socket")).call("status")["result"]["pid"].get<int>(), 0);
  rlimit before{};
  ASSERT_EQ(::prlimit(imud.pid(), RLIMIT_NOFILE, nullptr, &before), 0);
  const rlimit none{0, before.rlim_max};
  ASSERT_EQ(::prlimit(imud.pid(), RLIMIT_NOFILE, &none, nullptr), 0);
  ControlClient client(path("socket"));
  ASSERT_TRUE(imud.wait_for_errors("a connection cannot be accepted: Too many open files"));
  // Returns the processor time of the thread of the clients.
  const auto used = [&] { return processor_time_s(fmt::format("/proc/{0}/task/{0}/stat", imud.pid())); };
  const double begin_s = used();
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_LT(used() - begin_s, 0.1);
  const std::string errors = imud.errors(), words = "cannot be accepted";
  EXPECT_EQ(errors.find(words), errors.rfind(words)) << errors;
  ASSERT_EQ(::prlimit(imud.pid(), RLIMIT_NOFILE, &before, nullptr), 0);
  EXPECT_EQ(client.call("status")["result"]["pid"], imud.pid());
  EXPECT_EQ(imud.stop(), 0);
}

TEST_F(ControlSocket, ReplacesAStaleSocketAndNoOther) {
  Program killed("imud");
  start(killed, running());
  EXPECT_EQ(ControlClient(path("socket")).call("status")["result"]["pid"].is_number(), true);
  {
    Program second("imud");
    second.start({"run", path("config.toml"), "--set", "truth.port=udp:127.0.0.1:0"});
    EXPECT_EQ(second.wait(), 2);
    EXPECT_NE(second.errors().find("another imud listens there"), std::string::npos) << second.errors();
  }
  killed.stop(SIGKILL);
  ASSERT_TRUE(std::filesystem::exists(path("socket")));
  Program next("imud");
  next.start({"run", path("config.toml")});
  EXPECT_TRUE(ControlClient(path("socket")).call("status").contains("result"));
  // A run removes its own socket alone.
  std::filesystem::remove(path("socket"));
  write("socket", "a file");
  EXPECT_EQ(next.stop(), 0);
  EXPECT_EQ(read_file(path("socket")), "a file");
  Program refused("imud");
  refused.start({"run", path("config.toml")});
  EXPECT_EQ(refused.wait(), 2);
  EXPECT_NE(refused.errors().find("something that is no socket"), std::string::npos) << refused.errors();
}

TEST(ControlUsers, AreTheOwnOneAndRoot) {
  constexpr uid_t own = 1000, other = 1001;
  EXPECT_TRUE(may_control(own, own));
  EXPECT_TRUE(may_control(0, own));
  EXPECT_FALSE(may_control(other, own));
  EXPECT_FALSE(may_control(own, 0));
}

// By a process of another user, which only root can make; others have the rule alone, above.
TEST_F(ControlSocket, AnotherUserIsRefused) {
  if (::geteuid() != 0) return;
  Program imud("imud");
  start(imud, running());
  ControlClient own(path("socket"));
  ASSERT_EQ(::chmod(folder_.c_str(), 0711), 0);
  const auto as_nobody = [&] {
    int ends[2];
    EXPECT_EQ(::pipe(ends), 0);
    if (const pid_t child = ::fork(); child == 0) {
      constexpr uid_t nobody = 65534;
      std::string seen = "no permission";
      if (::setgid(nobody) != 0 || ::setuid(nobody) != 0) ::_exit(1);
      if (FileDescriptor socket = connect_to_socket(path("socket"))) {
        ControlClient client(std::move(socket));
        seen = client.receive().value_or("closed");
      }
      if (::write(ends[1], seen.data(), seen.size()) < 0) ::_exit(1);
      ::_exit(0);
    } else {
      ::close(ends[1]);
      char seen[1024];
      const ssize_t size = ::read(ends[0], seen, sizeof seen);
      ::close(ends[0]);
      ::waitpid(child, nullptr, 0);
      return std::string(seen, static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    }
  };
  EXPECT_EQ(as_nobody(), "no permission");
  ASSERT_EQ(::chmod(path("socket").c_str(), 0666), 0);  // as a careless administrator might
  EXPECT_NE(as_nobody().find("this imud belongs to another user"), std::string::npos);
  EXPECT_TRUE(own.call("status").contains("result"));
  EXPECT_EQ(imud.stop(), 0);
}

FileDescriptor connect_to_tcp(std::uint16_t port) {
  FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  EXPECT_EQ(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return socket;
}

TEST_F(ControlSocket, TcpNeedsTheToken) {
  const std::string token = "0123456789abcdef-token";
  write("token", token + "\nsecond line\n");
  const std::string config = running(fmt::format("listen = \"127.0.0.1:0\"\ntoken_file = \"{}\"\n", path("token")));
  {
    ::chmod(path("token").c_str(), 0644);
    Program careless("imud");
    careless.start({"run", config});
    EXPECT_EQ(careless.wait(), 2);
    EXPECT_NE(careless.errors().find("others can read the token"), std::string::npos) << careless.errors();
  }
  ::chmod(path("token").c_str(), 0600);
  Program imud("imud");
  start(imud, config);
  ASSERT_TRUE(imud.wait_for_errors("control: TCP port ") && imud.wait_for_errors("ready"));
  const std::uint16_t port = tcp_port(imud);
  for (const std::string wrong :
       {R"({"jsonrpc": "2.0", "method": "authenticate", "params": {"token": "0123456789abcdef-tokem"}, "id": 1})",
        R"({"jsonrpc": "2.0", "method": "authenticate", "params": {"token": ""}, "id": 1})",
        R"({"jsonrpc": "2.0", "method": "status", "id": 1})", R"([])", "POST / HTTP/1.1"}) {
    ControlClient client(connect_to_tcp(port));
    client.send(wrong + "\n{\"jsonrpc\": \"2.0\", \"method\": \"quit\", \"id\": 2}\n");
    const auto answer = client.receive();
    ASSERT_TRUE(answer);
    EXPECT_TRUE(json::parse(*answer).contains("error")) << wrong;
    EXPECT_FALSE(client.receive()) << "it was closed";
  }
  ControlClient client(connect_to_tcp(port));
  EXPECT_EQ(client.call("authenticate", {{"token", token}})["result"]["authenticated"], true);
  EXPECT_EQ(client.call("status")["result"]["api"], 1);
  EXPECT_EQ(client.call("status")["result"]["counters"]["control"]["connections_refused"], 5);
  EXPECT_EQ(client.call("quit")["result"]["quits"], true);
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

TEST(ControlToken, MatchesItselfAlone) {
  const Token token("a token of sixteen");
  EXPECT_TRUE(token.matches("a token of sixteen"));
  EXPECT_FALSE(token.matches("a token of sixteem"));
  EXPECT_FALSE(token.matches("a token of sixteen "));
  EXPECT_FALSE(token.matches(""));
  EXPECT_THROW(Token::read("/nonexistent"), OpenError);
}

TEST(ControlToken, IsRefusedIfAnyoneButItsOwnerMayReadIt) {
  const std::string path = testing::TempDir() + fmt::format("imud_token_{}", ::getpid());
  std::ofstream(path) << "a token of sixteen\n";
  constexpr std::pair<mode_t, bool> modes[] = {{0600, true},  {0400, true},  {0640, false},
                                               {0604, false}, {0620, false}, {0601, false}};
  for (const auto& [mode, is_good] : modes) {
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    if (is_good)
      EXPECT_TRUE(Token::read(path).matches("a token of sixteen")) << mode;
    else
      EXPECT_THROW(Token::read(path), OpenError) << mode;
  }
  ::unlink(path.c_str());
}

}  // namespace
}  // namespace imud
