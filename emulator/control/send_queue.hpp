// SendQueue: texts that wait until a client has read the earlier ones.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "emulator/control/subscriptions.hpp"
#include "emulator/ground/counters.hpp"

namespace imud {

// Bounded: a client that reads too slowly loses points first, then events. The connection of a client that does
// not read its answers is closed. Losses are counted.
class SendQueue {
 public:
  using Text = std::shared_ptr<const std::string>;
  // Limits of the waiting bytes: beyond the first, points are lost; beyond the second, events are lost, too;
  // beyond the third, the client is closed.
  static constexpr std::size_t most_for_points = 128 * 1024, most_for_events = 512 * 1024, most = 1024 * 1024;

  // `counters` outlives this.
  explicit SendQueue(ControlCounters& counters) : counters_(counters) {}

  // Adds an answer. Returns false, and counts it, if there is no room: the client must be closed.
  bool add(Text text) {
    if (bytes_ + text->size() > most) {
      counters_.clients_closed.count();
      return false;
    }
    push(std::move(text));
    return true;
  }
  // Adds a notification, or counts it as lost.
  void notify(const Text& text, Notification kind) {
    const bool is_event = kind == Notification::event;
    if (bytes_ + text->size() <= (is_event ? most_for_events : most_for_points)) return push(text);
    (is_event ? counters_.events_lost : counters_.notifications_lost).count();
  }
  bool empty() const noexcept { return texts_.empty(); }
  std::size_t size() const noexcept { return texts_.size(); }
  std::size_t bytes() const noexcept { return bytes_; }
  const std::string& front() const noexcept { return *texts_.front(); }
  void pop() {
    bytes_ -= texts_.front()->size();
    texts_.pop_front();
  }

 private:
  void push(Text text) {
    bytes_ += text->size();
    texts_.push_back(std::move(text));
  }
  std::deque<Text> texts_;
  std::size_t bytes_ = 0;
  ControlCounters& counters_;
};

}  // namespace imud
