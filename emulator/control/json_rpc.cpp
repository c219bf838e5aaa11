#include "emulator/control/json_rpc.hpp"

#include <fmt/format.h>

#include <exception>
#include <memory>
#include <utility>
#include <vector>

namespace imud {
namespace {

// The requests of one text, and their responses.
struct Call {
  std::vector<Json> responses;
  std::size_t missing = 0;
  bool is_batch = false;
  std::function<void(std::string)> answer;

  void add(Json response) {
    responses.push_back(std::move(response));
    finish_one();
  }
  void finish_one() {
    if (--missing > 0) return;
    if (responses.empty()) return answer({});
    answer(json_line(is_batch ? Json(std::move(responses)) : std::move(responses.front())));
  }
};

Json response(Json id, Json members) {
  Json whole = {{"jsonrpc", "2.0"}};
  whole.update(members);
  whole["id"] = std::move(id);
  return whole;
}

Json error_response(Json id, const RpcError& error) {
  return response(std::move(id), {{"error", {{"code", static_cast<int>(error.code)}, {"message", error.what()}}}});
}

// Throws RpcError.
Json parse(std::string_view text) {
  const auto limit = [](int depth, Json::parse_event_t, Json&) {
    if (depth > rpc_max_depth)
      throw RpcError(RpcError::invalid_request, fmt::format("nested more deeply than {} levels", rpc_max_depth));
    return true;
  };
  try {
    return Json::parse(text.begin(), text.end(), limit);
  } catch (const Json::parse_error& error) {
    throw RpcError(RpcError::parse_error, fmt::format("Parse error: not JSON at byte {}", error.byte));
  } catch (const Json::exception&) {
    throw RpcError(RpcError::parse_error, "Parse error: a number is beyond all ranges");
  }
}

// Returns why the JSON is no request; nullptr if it is a request.
const char* fault_of(const Json& request) {
  if (!request.is_object()) return "Invalid Request: give an object";
  const auto version = request.find("jsonrpc");
  if (version == request.end() || *version != "2.0") return "Invalid Request: \"jsonrpc\" must be \"2.0\"";
  const auto method = request.find("method");
  if (method == request.end() || !method->is_string()) return "Invalid Request: \"method\" must be a text";
  const auto params = request.find("params");
  if (params != request.end() && !params->is_structured()) return "Invalid Request: \"params\" must be an object";
  const auto id = request.find("id");
  if (id != request.end() && !id->is_string() && !id->is_number() && !id->is_null())
    return "Invalid Request: \"id\" must be a text or a number";
  return nullptr;
}

void execute_one(const Json& request, const RpcMethod& method, const std::shared_ptr<Call>& call) {
  if (const char* fault = fault_of(request))
    return call->add(error_response(nullptr, RpcError(RpcError::invalid_request, fault)));
  const bool is_notification = !request.contains("id");
  const Json id = is_notification ? Json() : request["id"];
  const auto replied = std::make_shared<bool>(false);
  const RpcReply reply([call, id, is_notification, replied](Json members) {
    if (std::exchange(*replied, true)) return;
    if (is_notification) return call->finish_one();
    call->add(response(id, std::move(members)));
  });
  try {
    method(request["method"].get<std::string>(), request.contains("params") ? request["params"] : Json(), reply);
  } catch (const RpcError& error) {
    reply.error(error);
  } catch (const std::exception& error) {
    reply.error(RpcError(RpcError::internal_error, fmt::format("Internal error: {}", error.what())));
  }
}

}  // namespace

void answer_rpc(std::string_view text, const RpcMethod& method, std::function<void(std::string)> answer) {
  const auto call = std::make_shared<Call>();
  call->answer = std::move(answer);
  call->missing = 1;
  Json requests;
  try {
    requests = parse(text);
    if (requests.is_array() && requests.empty())
      throw RpcError(RpcError::invalid_request, "Invalid Request: the batch is empty");
    if (requests.is_array() && requests.size() > rpc_max_requests)
      throw RpcError(RpcError::invalid_request,
                     fmt::format("Invalid Request: more than {} requests in one batch", rpc_max_requests));
  } catch (const RpcError& error) {
    return call->add(error_response(nullptr, error));
  }
  call->is_batch = requests.is_array();
  if (!call->is_batch) return execute_one(requests, method, call);
  call->missing = requests.size();
  for (const Json& request : requests) execute_one(request, method, call);
}

std::string rpc_notification(std::string_view method, std::string_view params) {
  return fmt::format(R"({{"jsonrpc":"2.0","method":"{}","params":{}}})", method, params);
}

std::string rpc_refusal(const RpcError& error) { return json_line(error_response(nullptr, error)); }

std::string json_line(const Json& value) { return value.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace imud
