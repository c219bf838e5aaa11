#include "emulator/control/ctl.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <CLI/CLI.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "emulator/control/json_rpc.hpp"
#include "emulator/control/line_connection.hpp"
#include "emulator/control/socket_path.hpp"
#include "emulator/control/token.hpp"
#include "transports/port_spec.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// A change waits for a sample, a reload for files, for a sample and for other reloads.
constexpr Nanoseconds longest_change = 10s, longest_reload = 60s;

Nanoseconds longest_wait(const std::string& method) {
  const bool only_asks = method == "status" || method == "list" || method == "subscribe" || method == "unsubscribe";
  return only_asks ? longest_answer : method == "reload" ? longest_reload : longest_change;
}

int fail(std::string_view what, int exit_code = 1) {
  fmt::print(stderr, "imud: {}\n", what);
  return exit_code;
}

// Returns the reason, for people, why a connection to that socket has failed.
std::string failure_text(const std::string& path, int error) {
  switch (error) {
    case ENOENT:
      return fmt::format("{}: there is no such socket: does that imud run, with this path?", path);
    case ECONNREFUSED:
      return fmt::format("{}: no imud listens there any more: it was killed, and its next run replaces the socket",
                         path);
    case EAGAIN:
      return fmt::format("{}: that imud answers no connections: its process is stopped or too busy", path);
    case EACCES:
      return fmt::format("{}: no permission: that imud belongs to another user", path);
    default:
      return fmt::format("{}: {}", path, std::strerror(error));
  }
}

// Returns a connection, or prints why there is none.
LineConnection connect_by_socket(const CtlOptions& options) {
  std::string path = options.socket;
  if (path.empty()) {
    const Instances found = find_instances();
    const Instance* const instance = found.running_by_name(options.name);
    if (instance == nullptr) {
      fail(none_text(found, options.name));
      return LineConnection();
    }
    path = instance->path;
  }
  FileDescriptor socket = connect_to_socket(path);
  if (!socket) fail(failure_text(path, errno));
  return LineConnection(std::move(socket));
}

// Returns a connection by TCP after sending the token, or prints why there is none. `address` has the form
// ADDRESS:PORT.
LineConnection connect_by_tcp(const NumericAddress& address, const std::string& secret) {
  const boost::asio::ip::tcp::endpoint to(boost::asio::ip::make_address(address.address), address.port);
  const std::string name = fmt::format("{}, port {}", address.address, address.port);
  FileDescriptor socket(::socket(to.protocol().family(), SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!socket || ::connect(socket.get(), to.data(), static_cast<socklen_t>(to.size())) != 0) {
    fail(fmt::format("{}: {}; does an imud run with that [control] listen?", name, std::strerror(errno)));
    return LineConnection();
  }
  LineConnection lines(std::move(socket));
  const Json request = {{"jsonrpc", "2.0"}, {"method", "authenticate"}, {"params", {{"token", secret}}}, {"id", 0}};
  const auto answer = lines.send(json_line(request)) ? lines.receive(host_now() + longest_answer) : std::nullopt;
  const Json response = answer ? Json::parse(*answer, nullptr, false) : Json();
  if (response.is_object() && response.contains("result")) return lines;
  fail(fmt::format("{}: {}", name, response.is_object() ? "the token is not that of the run" : "no imud answers"));
  return LineConnection();
}

int list_instances(bool json) {
  const Instances found = find_instances();
  if (json) {
    Json list = Json::array();
    for (const Instance& one : found.running) list.push_back({{"name", one.name}, {"socket", one.path}});
    fmt::print("{}\n", list.dump(2, ' ', false, Json::error_handler_t::replace));
    return found.running.empty() ? 1 : 0;
  }
  if (found.running.empty()) return fail(none_text(found, ""));
  for (const Instance& one : found.running) fmt::print("{:<12} {}\n", one.name, one.path);
  return 0;
}

// A value is JSON, or else a text, as a shell passes it: text=climb, rate_hz=50, value=[1, 2, 3].
Json value_of(const std::string& text) {
  Json value = Json::parse(text, nullptr, false);
  return value.is_discarded() ? Json(text) : value;
}

// Returns lines of words for an answer. Throws Json::exception for the answer of another program.
std::string words_of(const std::string& method, const Json& result) {
  std::string out;
  if (method == "status") {
    out = fmt::format("imud {}, {} (process {}), clock {}, {:.1f} s\n", result.at("version").get<std::string>(),
                      result.at("name").get<std::string>(), result.at("pid").get<int>(),
                      result.at("clock").get<std::string>(), result.at("counters").at("duration_s").get<double>());
    for (const Json& imu : result.at("imus"))
      out += fmt::format("{:<8} {} at {:g} Hz to {}, power {}{}, {} samples\n", imu.at("name").get<std::string>(),
                         imu.at("protocol").get<std::string>(), imu.at("rate_hz").get<double>(),
                         imu.at("port").get<std::string>(), imu.at("power").get<std::string>(),
                         imu.at("paused").get<bool>() ? ", paused" : "", imu.at("samples").get<std::uint64_t>());
    return out;
  }
  if (method == "list") {
    out = "methods\n";
    for (const Json& one : result.at("methods"))
      out += fmt::format("  {:<14} {}{}\n", one.at("name").get<std::string>(), one.at("summary").get<std::string>(),
                         one.contains("example") ? "; " + one.at("example").dump() : "");
    out += "keys of set\n";
    for (const Json& one : result.at("keys"))
      out += fmt::format("  {:<36} {}\n", one.at("key").get<std::string>(), one.at("meaning").get<std::string>());
    out += "imus\n";
    for (const Json& one : result.at("imus")) out += fmt::format("  {}\n", one.get<std::string>());
    return out;
  }
  if (result.contains("changed")) {
    for (const Json& one : result.at("changed"))
      out += fmt::format("{}: {}, was {}\n", one.at("key").get<std::string>(), one.at("to").get<std::string>(),
                         one.at("from").get<std::string>());
    if (result.at("changed").empty()) out += "no key differs\n";
  }
  if (result.contains("applied")) {
    for (const Json& one : result.at("applied")) {
      out +=
          fmt::format("{}: from sample {}", one.at("imu").get<std::string>(), one.at("sample").get<std::uint64_t>());
      if (one.at("time_ns").is_number()) out += fmt::format(", {:.6f} s", 1e-9 * one.at("time_ns").get<double>());
      out += '\n';
    }
    return out;
  }
  return result.dump(2) + "\n";
}

// Prints the answer, except the one to `subscribe` without --json. Returns the exit code. Throws Json::exception for
// the answer of another program.
int print_answer(const CtlOptions& options, const Json& response) {
  const bool is_error = response.contains("error");
  const Json& content = response.at(is_error ? "error" : "result");
  if (options.json) fmt::print("{}\n", content.dump(2));
  if (is_error) {
    const int code = content.at("code").get<int>();
    const std::string words = content.at("message").get<std::string>();
    const bool is_wrong = code <= RpcError::invalid_request && code >= RpcError::invalid_params;
    return options.json ? (is_wrong ? 2 : 1) : fail(words, is_wrong ? 2 : 1);
  }
  if (!options.json && options.method != "subscribe") fmt::print("{}", words_of(options.method, content));
  return 0;
}

// Returns the run of the options as people know it.
std::string run_of(const CtlOptions& options) {
  for (const std::string& name : {options.to, options.socket, options.name})
    if (!name.empty()) return name;
  return "the run";
}

}  // namespace

const CLI::App* add_ctl_command(CLI::App& app, CtlOptions& options) {
  CLI::App* command =
      app.add_subcommand("ctl", "Ask or change a run that goes on; without METHOD: list those of this user");
  command->add_option("METHOD", options.method, "status, list, mark, power, set, reload, subscribe, ...: see list");
  command
      ->add_option("PARAMETER", options.parameters,
                   "Such as imu=imu1 state=cycle; a value is JSON, such as [0.01, 0, 0], or a text")
      ->type_name("KEY=VALUE");
  CLI::Option* socket = command->add_option("--socket", options.socket, "The socket of the run")->type_name("PATH");
  CLI::Option* name =
      command->add_option("--name", options.name, "The name of the run ([control] name); else its process number")
          ->excludes(socket);
  CLI::Option* to = command->add_option("--to", options.to, "The TCP port of the run ([control] listen)")
                        ->type_name("ADDRESS:PORT")
                        ->excludes(socket)
                        ->excludes(name);
  CLI::Option* token =
      command->add_option("--token-file", options.token_file, "The file with the token, for --to")->type_name("FILE");
  to->needs(token);
  token->needs(to);
  command->add_flag("--json", options.json, "Print the answer as JSON");
  return command;
}

int ctl(const CtlOptions& options) {
  if (options.method.empty() && options.to.empty()) return list_instances(options.json);
  if (options.method.empty()) return fail("give a METHOD, such as status", 2);
  Json params = Json::object();
  for (const std::string& parameter : options.parameters) {
    const std::size_t equals = parameter.find('=');
    if (equals == parameter.npos || equals == 0)
      return fail(fmt::format("{}: give parameters as KEY=VALUE", parameter), 2);
    params[parameter.substr(0, equals)] = value_of(parameter.substr(equals + 1));
  }
  std::optional<NumericAddress> to;
  if (!options.to.empty()) {
    to = NumericAddress::try_parse(options.to);
    // The token is sent unencrypted.
    if (!to || !to->is_loopback())
      return fail(fmt::format("{}: give a loopback address and a port, such as 127.0.0.1:7700", options.to), 2);
  }
  LineConnection lines =
      to ? connect_by_tcp(*to, Token::read_secret(options.token_file)) : connect_by_socket(options);
  if (!lines) return 1;
  Json request = {{"jsonrpc", "2.0"}, {"method", options.method}};
  if (!params.empty()) request["params"] = std::move(params);
  request["id"] = 1;
  const Nanoseconds limit = longest_wait(options.method);
  const auto answer = lines.send(json_line(request)) ? lines.receive(host_now() + limit) : std::nullopt;
  if (!answer && lines)
    return fail(silent_text(run_of(options), limit) +
                (limit == longest_answer ? "" : "; it may execute the request later"));
  if (!answer) return fail("the connection has ended before the answer");
  const Json response = Json::parse(*answer, nullptr, false);
  if (!response.is_object()) return fail("the answer is no JSON");
  try {
    if (const int exit_code = print_answer(options, response); exit_code != 0) return exit_code;
  } catch (const Json::exception&) {
    return fail("the answer is that of another program, or of another version of imud");
  }
  if (options.method != "subscribe") return 0;
  std::signal(SIGINT, [](int) { std::_Exit(0); });
  while (const auto line = lines.receive()) {
    const Json notification = Json::parse(*line, nullptr, false);
    if (!notification.is_object() || !notification.contains("params")) continue;
    fmt::print("{}\n", json_line(notification.at("params")));
    if (std::fflush(stdout) != 0) return 0;  // the reader has gone
  }
  return 0;
}

}  // namespace imud
