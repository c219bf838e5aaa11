// TopView: what `imud top` shows, and what its keys do, without a terminal.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emulator/control/json_rpc.hpp"
#include "transports/host_clock.hpp"

namespace imud {

class TopView {
 public:
  explicit TopView(std::string name) : name_(std::move(name)) {}

  // Takes an answer or a notification of the run: of `status`, `list`, a fault's request, `counters` or `event`.
  void take(const Json& message, HostTime now);
  // Takes a byte or a Terminal::Key. Returns the request that it makes, such as {"method": "fault.begin", ...}; null:
  // none.
  Json take_key(int key);
  // Returns true after the key q.
  bool quits() const noexcept { return quits_; }

  // Return the rows from the top, and the text of the last row.
  std::vector<std::string> lines(HostTime now) const;
  std::string bottom() const;

 private:
  Json execute(const std::string& words);

  const std::string name_;
  Json status_ = Json::object(), interval_ = Json::object(), configured_ = Json::array();
  std::optional<HostTime> heard_;     // when the run has sent something last
  std::deque<std::string> events_;    // the newest ones
  std::optional<std::string> words_;  // of the fault that the user enters; nullopt: none
  std::string message_;               // of the last request
  bool quits_ = false;
};

}  // namespace imud
