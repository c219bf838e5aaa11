// JSON-RPC 2.0: the examples of the specification, and texts that are no requests.
#include <gtest/gtest.h>

#include <random>

#include "emulator/control/json_rpc.hpp"

namespace imud {
namespace {

// The methods of the examples.
void example_method(const std::string& method, const Json& params, const RpcReply& reply) {
  if (method == "subtract")
    return reply.result(params.is_array() ? params[0].get<int>() - params[1].get<int>()
                                          : params["minuend"].get<int>() - params["subtrahend"].get<int>());
  if (method == "sum") {
    int sum = 0;
    for (const Json& n : params) sum += n.get<int>();
    return reply.result(sum);
  }
  if (method == "get_data") return reply.result({"hello", 5});
  if (method == "update" || method == "notify_hello" || method == "notify_sum") return reply.result(nullptr);
  throw RpcError(RpcError::method_not_found, "Method not found");
}

std::string rpc_answer(std::string_view text) {
  std::string answer = "none came";
  int answers = 0;
  answer_rpc(text, example_method, [&](std::string got) {
    answer = std::move(got);
    ++answers;
  });
  EXPECT_EQ(answers, 1) << text;
  return answer;
}

// Replaces each error's message by that of the specification, which ours begins with.
void shorten_messages(Json& response) {
  if (response.is_array()) {
    for (Json& one : response) shorten_messages(one);
  } else if (response.contains("error")) {
    for (const std::string message : {"Parse error", "Invalid Request", "Method not found"})
      if (response["error"]["message"].get<std::string>().starts_with(message))
        response["error"]["message"] = message;
  }
}

// https://www.jsonrpc.org/specification, "7 Examples", quoted; the last members of each pair are the Server's.
TEST(ControlRpc, AnswersTheExamplesOfTheSpecification) {
  const std::pair<const char*, const char*> examples[] = {
      // rpc call with positional parameters
      {R"({"jsonrpc": "2.0", "method": "subtract", "params": [42, 23], "id": 1})",
       R"({"jsonrpc": "2.0", "result": 19, "id": 1})"},
      {R"({"jsonrpc": "2.0", "method": "subtract", "params": [23, 42], "id": 2})",
       R"({"jsonrpc": "2.0", "result": -19, "id": 2})"},
      // rpc call with named parameters
      {R"({"jsonrpc": "2.0", "method": "subtract", "params": {"subtrahend": 23, "minuend": 42}, "id": 3})",
       R"({"jsonrpc": "2.0", "result": 19, "id": 3})"},
      {R"({"jsonrpc": "2.0", "method": "subtract", "params": {"minuend": 42, "subtrahend": 23}, "id": 4})",
       R"({"jsonrpc": "2.0", "result": 19, "id": 4})"},
      // a Notification
      {R"({"jsonrpc": "2.0", "method": "update", "params": [1,2,3,4,5]})", ""},
      {R"({"jsonrpc": "2.0", "method": "foobar"})", ""},
      // rpc call of non-existent method
      {R"({"jsonrpc": "2.0", "method": "foobar", "id": "1"})",
       R"({"jsonrpc": "2.0", "error": {"code": -32601, "message": "Method not found"}, "id": "1"})"},
      // rpc call with invalid JSON
      {R"({"jsonrpc": "2.0", "method": "foobar, "params": "bar", "baz])",
       R"({"jsonrpc": "2.0", "error": {"code": -32700, "message": "Parse error"}, "id": null})"},
      // rpc call with invalid Request object
      {R"({"jsonrpc": "2.0", "method": 1, "params": "bar"})",
       R"({"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null})"},
      // rpc call Batch, invalid JSON
      {R"([{"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"}, {"jsonrpc": "2.0", "method")",
       R"({"jsonrpc": "2.0", "error": {"code": -32700, "message": "Parse error"}, "id": null})"},
      // rpc call with an empty Array
      {"[]", R"({"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null})"},
      // rpc call with an invalid Batch (but not empty)
      {"[1]", R"([{"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null}])"},
      // rpc call with invalid Batch
      {"[1,2,3]",
       R"([{"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
           {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
           {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null}])"},
      // rpc call Batch
      {R"([{"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"},
           {"jsonrpc": "2.0", "method": "notify_hello", "params": [7]},
           {"jsonrpc": "2.0", "method": "subtract", "params": [42,23], "id": "2"},
           {"foo": "boo"},
           {"jsonrpc": "2.0", "method": "foo.get", "params": {"name": "myself"}, "id": "5"},
           {"jsonrpc": "2.0", "method": "get_data", "id": "9"}])",
       R"([{"jsonrpc": "2.0", "result": 7, "id": "1"},
           {"jsonrpc": "2.0", "result": 19, "id": "2"},
           {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
           {"jsonrpc": "2.0", "error": {"code": -32601, "message": "Method not found"}, "id": "5"},
           {"jsonrpc": "2.0", "result": ["hello", 5], "id": "9"}])"},
      // rpc call Batch (all notifications)
      {R"([{"jsonrpc": "2.0", "method": "notify_sum", "params": [1,2,4]},
           {"jsonrpc": "2.0", "method": "notify_hello", "params": [7]}])",
       ""}};
  for (const auto& [request, expected] : examples) {
    const std::string answer = rpc_answer(request);
    if (*expected == '\0') {
      EXPECT_EQ(answer, "") << request;
      continue;
    }
    EXPECT_EQ(answer.find('\n'), answer.npos) << "one line";
    Json got = Json::parse(answer);
    shorten_messages(got);
    EXPECT_EQ(got.dump(), Json::parse(expected).dump()) << request;
  }
}

TEST(ControlRpc, RefusesWhatIsNestedTooDeeplyOrTooMany) {
  const auto code = [](const std::string& text) { return Json::parse(rpc_answer(text))["error"]["code"].get<int>(); };
  EXPECT_EQ(code(std::string(60'000, '[')), RpcError::invalid_request);
  EXPECT_EQ(code(std::string(30'000, '[') + std::string(30'000, ']')), RpcError::invalid_request);
  std::string many = "[1";
  for (std::size_t i = 1; i < rpc_max_requests; ++i) many += ",1";
  EXPECT_EQ(Json::parse(rpc_answer(many + "]")).size(), rpc_max_requests);
  EXPECT_EQ(code(many + ",1]"), RpcError::invalid_request);
  EXPECT_EQ(code(R"({"jsonrpc": "2.0", "method": "sum", "params": [1e999], "id": 1})"), RpcError::parse_error);
  EXPECT_EQ(code("\xFF\xFE"), RpcError::parse_error);
  EXPECT_EQ(code(R"({"jsonrpc": "2.0", "method": "sum", "id": [1]})"), RpcError::invalid_request);
}

// Answers may come in another order than the requests, and after call() has returned.
TEST(ControlRpc, AnswersABatchWhenTheLastReplyHasCome) {
  std::vector<RpcReply> replies;
  std::vector<std::string> answers;
  answer_rpc(R"([{"jsonrpc": "2.0", "method": "a", "id": 1}, {"jsonrpc": "2.0", "method": "b", "id": 2}])",
             [&](const std::string&, const Json&, RpcReply reply) { replies.push_back(std::move(reply)); },
             [&](std::string answer) { answers.push_back(std::move(answer)); });
  ASSERT_EQ(replies.size(), 2U);
  replies[1].result("second");
  replies[1].result("again, which is ignored");
  EXPECT_TRUE(answers.empty());
  replies[0].error(RpcError(RpcError::run_ended, "first"));
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0], R"([{"jsonrpc":"2.0","result":"second","id":2},)"
                        R"({"jsonrpc":"2.0","error":{"code":-32002,"message":"first"},"id":1}])");
}

// Pieces of requests in any order, with bytes changed: each text gets one answer, which is JSON or nothing.
TEST(ControlRpc, AnswersAnyBytes) {
  std::mt19937 random(17);
  const std::string pieces[] = {"{",       "}",          "[",           "]",        ",",          ":", "\"jsonrpc\"",
                                "\"2.0\"", "\"method\"", "\"id\"",      "\"sum\"",  "\"params\"", "1", "-1e400",
                                "null",    "true",       "\"\\ud800\"", "\xC3\x28", " ",          "\\"};
  for (int i = 0; i < 20'000; ++i) {
    std::string text = i % 2 == 0 ? "" : R"({"jsonrpc": "2.0", "method": "sum", "params": [1, 2], "id": 1})";
    for (std::size_t n = random() % 12; n > 0; --n) {
      const std::string& piece = pieces[random() % std::size(pieces)];
      text.insert(text.empty() ? 0 : random() % text.size(), piece);
      if (random() % 4 == 0) text[random() % text.size()] = static_cast<char>(random());
    }
    const std::string answer = rpc_answer(text);
    EXPECT_TRUE(answer.empty() || Json::accept(answer)) << text;
  }
}

}  // namespace
}  // namespace imud
