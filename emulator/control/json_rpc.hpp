// JSON-RPC 2.0 (https://www.jsonrpc.org/specification): from a text with requests to the text that answers them.
#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

namespace imud {

using Json = nlohmann::ordered_json;

// The refusal of a request: an error code, either of the standard or of the server (-32000 to -32099), and a
// message.
struct RpcError : std::runtime_error {
  enum Code : int {
    parse_error = -32700,
    invalid_request = -32600,
    method_not_found = -32601,
    invalid_params = -32602,
    internal_error = -32603,
    busy = -32000,       // too much waits already; the same request may succeed later
    refused = -32001,    // not possible in this run, or on this connection
    run_ended = -32002,  // before the request took effect
  };
  RpcError(Code error, const std::string& what) : std::runtime_error(what), code(error) {}
  Code code;
};

// Returns the refusal of wrong parameters: "Invalid params: " and `what`.
inline RpcError wrong_params(const std::string& what) {
  return {RpcError::invalid_params, "Invalid params: " + what};
}

// Sends the answer to one request. Exactly one of result() and error() must be called, once.
class RpcReply {
 public:
  explicit RpcReply(std::function<void(Json response_members)> send) : send_(std::move(send)) {}
  void result(Json value) const { send_({{"result", std::move(value)}}); }
  void error(const RpcError& error) const {
    send_({{"error", {{"code", static_cast<int>(error.code)}, {"message", error.what()}}}});
  }
  // Returns a reply that calls `first` before it is sent.
  RpcReply after(std::function<void()> first) const {
    return RpcReply([first = std::move(first), send = send_](Json members) {
      first();
      send(std::move(members));
    });
  }

 private:
  std::function<void(Json)> send_;
};

// Executes a request. `params` is an object, an array, or null if it is absent. Replies now or later, or throws
// RpcError.
using RpcMethod = std::function<void(const std::string& method, const Json& params, RpcReply reply)>;

// A request is refused if its values are nested more deeply than this, or if a batch has more requests.
inline constexpr int rpc_max_depth = 32;
inline constexpr std::size_t rpc_max_requests = 64;

// Executes the requests of a text: one object, or an array of them in their order. Calls `answer` once, after all
// replies, with the text of the answer, in one line; empty if no request wants one.
void answer_rpc(std::string_view text, const RpcMethod& method, std::function<void(std::string)> answer);

// Returns the text of a notification, in one line. `params` is JSON.
std::string rpc_notification(std::string_view method, std::string_view params);
// Returns the answer to a text that is refused as a whole.
std::string rpc_refusal(const RpcError& error);

// Returns the value as one line; bytes that are no UTF-8 are replaced.
std::string json_line(const Json& value);

}  // namespace imud
