// Random changes of requests to the control protocol, for its fuzz test.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/control/control_api.hpp"
#include "emulator/control/running_keys.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {

// The connection by which a request reaches imud.
enum class Carrier : std::uint8_t { socket, tcp, http, web_socket };

inline const std::string fuzz_token = "a token of the fuzz test";

inline std::string http_request(const std::string& line, const std::string& body = {},
                                const std::string& headers = {}) {
  std::string text = line + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + headers;
  if (!body.empty()) text += fmt::format("Content-Type: application/json\r\nContent-Length: {}\r\n", body.size());
  return text + "\r\n" + body;
}
inline const std::string upgrade_request =
    http_request("GET /api", "",
                 "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");

// Returns a frame of a client (RFC 6455, section 5.2), whose masking key is 0.
inline std::string web_socket_frame(unsigned char first, const std::string& payload) {
  std::string frame(1, static_cast<char>(first));
  const std::size_t size = payload.size();
  constexpr std::size_t most_in_7_bits = 125, most_in_16_bits = 0xFFFF;
  const auto marked = [](std::size_t length) { return static_cast<char>(0x80U | static_cast<unsigned>(length)); };
  const auto append = [&](int bits) {
    for (int shift = bits - 8; shift >= 0; shift -= 8)
      frame += static_cast<char>(static_cast<std::uint64_t>(size) >> shift & 0xFFU);
  };
  if (size <= most_in_7_bits) {
    frame += marked(size);
  } else if (size <= most_in_16_bits) {
    frame += marked(126);
    append(16);
  } else {
    frame += marked(127);
    append(64);
  }
  return frame + std::string(4, '\0') + payload;
}

// Requests with every method, key and kind of fault.
inline std::vector<Json> good_requests() {
  std::vector<Json> all;
  const auto add = [&](const std::string& method, Json params) {
    Json request = {{"jsonrpc", "2.0"}, {"method", method}};
    if (!params.is_null()) request["params"] = std::move(params);
    request["id"] = all.size();
    all.push_back(std::move(request));
  };
  for (const ControlApi::Method& method : ControlApi::methods())
    add(std::string(method.name), method.example.empty() ? Json() : Json::parse(method.example));
  for (const RunningKey& key : running_keys()) {
    Json value = key.type == RunningKey::Type::word     ? Json(key.words[0])
                 : key.type == RunningKey::Type::vector ? Json({0.1, 0, -0.1})
                                                        : Json(5);
    add("set", {{fmt::format("{}{}", key.of_imu ? "imu.*." : "", key.key), std::move(value)}});
  }
  for (const FaultKind* kind : fault_kinds()) {
    Json params = {{"target", kind->targets[0]}, {"kind", kind->name}, {"for_s", 0.01}};
    for (const FaultParameter& parameter : kind->parameters) params[std::string(parameter.key)] = 0.5;
    add("fault.begin", std::move(params));
  }
  for (const char* what : {"samples", "truth", "counters", "events"}) add("subscribe", {{"what", what}});
  add("authenticate", {{"token", fuzz_token}});
  all.push_back(all);
  return all;
}

inline constexpr std::string_view odd_texts[] = {"{",
                                                 "}",
                                                 "[",
                                                 "]",
                                                 ":",
                                                 ",",
                                                 "\"",
                                                 "\\",
                                                 "\n",
                                                 "\r\n",
                                                 "null",
                                                 "true",
                                                 "-1",
                                                 "1e308",
                                                 "1e999",
                                                 "0.1",
                                                 "18446744073709551616",
                                                 "\"*\"",
                                                 "\"imu1\"",
                                                 "\"auto\"",
                                                 "\"\\ud800\"",
                                                 "\"\\u0000\"",
                                                 "\xFF",
                                                 "\xC3\x28",
                                                 "{\"uniform\":[0,1]}",
                                                 "\"params\":",
                                                 "\"method\":",
                                                 "\"id\":",
                                                 "GET ",
                                                 "POST /api",
                                                 " HTTP/1.1\r\n",
                                                 "Host: ",
                                                 "Content-Length: 99999999999999999999\r\n",
                                                 "Transfer-Encoding: chunked\r\n",
                                                 "Connection: close\r\n",
                                                 "\r\n\r\n",
                                                 "\x81\xFE",
                                                 "\x89\x80",
                                                 "\x88\x82",
                                                 "\x00"};

// A sequence of inputs: half of them with changed JSON, half with changed bytes, some with both or neither.
class FuzzedRequests {
 public:
  explicit FuzzedRequests(std::uint64_t seed) : random_(seed) {}

  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % n); }
  // Returns the next input.
  std::string next(Carrier carrier) {
    std::string body = request();
    const bool changes_body = below(2) == 0;
    if (changes_body) change(body);
    std::string text;
    switch (carrier) {
      case Carrier::socket:
      case Carrier::tcp:
        if (carrier == Carrier::tcp && below(2) == 0)
          text = R"({"jsonrpc":"2.0","method":"authenticate","params":{"token":")" + fuzz_token + "\"}}\n";
        text += body + (below(16) == 0 ? "" : "\n");
        break;
      case Carrier::http: {
        constexpr const char* lines[] = {"GET /", "GET /metrics", "HEAD /main.js", "OPTIONS *", "GET /api"};
        if (below(8) == 0)
          text = http_request(lines[below(std::size(lines))], "", below(2) == 0 ? "Expect: 100-continue\r\n" : "");
        else if (below(8) == 0)
          text = http_request("POST /api", "", "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n") +
                 fmt::format("{:x}\r\n{}\r\n0\r\n\r\n", body.size(), body);
        else
          text = http_request("POST /api", body);
        break;
      }
      case Carrier::web_socket: {
        constexpr unsigned char kinds[] = {0x81, 0x81, 0x81, 0x81, 0x01, 0x80, 0x82, 0x88, 0x89, 0x8A};
        text = web_socket_frame(kinds[below(std::size(kinds))], body);
        break;
      }
    }
    if (!changes_body && below(2) == 0) change(text);
    return text;
  }

 private:
  // Changes a value, a name or the place of one in the JSON.
  void change_json(Json& json) {
    Json* at = &json;
    while (at->is_structured() && !at->empty() && below(5) != 0) {
      auto next = at->begin();
      std::advance(next, static_cast<std::ptrdiff_t>(below(at->size())));
      at = &*next;
    }
    const auto any = [&]() -> Json {
      switch (below(9)) {
        case 0:
          return nullptr;
        case 1:
          return static_cast<std::int64_t>(random_());
        case 2:
          return (static_cast<double>(below(2001)) - 1000) * std::pow(10, static_cast<double>(below(40)) - 20);
        case 3:
          return {{"uniform", {0, 1}}};
        case 4:
          return Json::array({0.5, -1, below(100)});
        case 5:
          return std::string(below(300), static_cast<char>(' ' + below(95)));
        case 6:
          return static_cast<int>(below(5));
        case 7:
          return requests_[below(requests_.size())];
        default:
          return Json(below(2) == 0 ? "imu1" : "*");
      }
    };
    if (at->is_object() && below(2) == 0)
      (*at)[below(2) == 0 ? "for_s" : std::string(odd_texts[below(std::size(odd_texts))])] = any();
    else
      *at = any();
  }

  std::string request() {
    Json json = requests_[below(requests_.size())];
    if (below(2) == 0)
      for (std::size_t k = 1 + below(3); k > 0; --k) change_json(json);
    return json_line(json);
  }

  void change(std::string& text) {
    for (std::size_t k = below(4); k > 0 && !text.empty(); --k) change_randomly(text, 4, odd_texts, random_);
  }

  std::mt19937_64 random_;
  const std::vector<Json> requests_ = good_requests();
};

}  // namespace imud
