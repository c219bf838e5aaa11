// LineConnection: a client's connection to the control protocol of a run.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"

namespace imud {

// The time in which a run answers a request that changes nothing.
inline constexpr Nanoseconds longest_answer = std::chrono::seconds(2);
// Returns the words about a run that has not answered within `limit`.
std::string silent_text(std::string_view name, Nanoseconds limit);

// Sends and receives lines over a stream socket. One thread.
class LineConnection {
 public:
  LineConnection() = default;
  explicit LineConnection(FileDescriptor socket) : socket_(std::move(socket)) {}

  // Returns false if there is no socket, or if the connection has ended.
  explicit operator bool() const noexcept { return static_cast<bool>(socket_); }
  int descriptor() const noexcept { return socket_.get(); }

  // Sends the text and a line feed. Returns false, and closes the socket, if the connection has ended.
  bool send(std::string line);
  // Waits for the next line, if given not longer than until `until`, and returns the line without its line feed.
  // Returns nullopt if no line has come, or if the connection has ended; the end of the connection closes the
  // socket.
  std::optional<std::string> receive(std::optional<HostTime> until = {});

 private:
  FileDescriptor socket_;
  std::string waiting_;
};

}  // namespace imud
