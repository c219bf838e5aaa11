// A client of the control protocol.
#pragma once

#include <poll.h>
#include <sys/socket.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "emulator/control/socket_path.hpp"

namespace imud {

class ControlClient {
 public:
  // Waits until the socket exists, because imud may not run yet.
  explicit ControlClient(const std::string& path) {
    for (int i = 0; i < 3000 && !socket_; ++i) {
      socket_ = connect_to_socket(path);
      if (!socket_) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (!socket_) throw std::runtime_error("nobody listens to " + path);
  }
  explicit ControlClient(FileDescriptor socket) : socket_(std::move(socket)) {}

  // Returns false if the connection has ended.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (n <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
  }
  // Returns the number of bytes that were sent without waiting for room.
  std::size_t send_some(std::string_view bytes) {
    const ssize_t n = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  // Returns the next line; nullopt if the connection has ended, or if nothing was received for 30 s.
  std::optional<std::string> receive() {
    for (;;) {
      if (const std::size_t end = waiting_.find('\n'); end != waiting_.npos) {
        std::string line = waiting_.substr(0, end);
        waiting_.erase(0, end + 1);
        return line;
      }
      pollfd ready{socket_.get(), POLLIN, 0};
      if (::poll(&ready, 1, 30'000) <= 0) return std::nullopt;
      char bytes[4096];
      const ssize_t n = ::recv(socket_.get(), bytes, sizeof bytes, 0);
      if (n <= 0) return std::nullopt;
      waiting_.append(bytes, static_cast<std::size_t>(n));
    }
  }
  // Sends a request and returns the response to it; notifications before it are discarded. null if the connection
  // has ended.
  nlohmann::json call(const std::string& method, const nlohmann::json& params = nlohmann::json::object()) {
    send(nlohmann::json{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", ++id_}}.dump() + "\n");
    while (const auto line = receive()) {
      nlohmann::json response = nlohmann::json::parse(*line);
      if (response.contains("id") && response["id"] == id_) return response;
    }
    return nullptr;
  }
  // Returns the next notification of that method; null if none comes.
  nlohmann::json notification(const std::string& method) {
    while (const auto line = receive()) {
      nlohmann::json message = nlohmann::json::parse(*line);
      if (message.value("method", "") == method) return message["params"];
    }
    return nullptr;
  }

 private:
  FileDescriptor socket_;
  std::string waiting_;
  int id_ = 0;
};

}  // namespace imud
