// CommandQueue: a bounded queue of commands from the main thread to the sampling thread, in batches.
#pragma once

#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emulator/imu/command.hpp"

namespace imud {

// A batch is queued whole or not at all, and is popped whole. The constructor allocates; neither thread waits or
// locks.
class CommandQueue {
 public:
  static constexpr std::size_t capacity = 256;      // commands
  static constexpr std::size_t longest_batch = 64;  // commands

  CommandQueue() : entries_(capacity) { batch_.reserve(longest_batch); }

  // Returns whether a batch of this size fits now. Main thread.
  bool has_room(std::size_t commands) const noexcept {
    return commands > 0 && commands <= longest_batch && entries_.write_available() >= commands;
  }
  // Adds a batch. Returns false if the batch is empty or does not fit. Main thread.
  bool push(std::uint64_t number, std::span<const Command> commands) {
    if (!has_room(commands.size())) return false;
    batch_.clear();
    for (std::size_t i = 0; i < commands.size(); ++i)
      batch_.push_back({number, static_cast<std::uint32_t>(commands.size() - i), commands[i]});
    return entries_.push(batch_.data(), batch_.size()) == batch_.size();  // published at once
  }

  // Calls `execute(command)` for each command of the oldest batch, in order. Returns the number of the batch; 0 if
  // there is none.
  // Sampling thread.
  template <class Execute>
  std::uint64_t pop(Execute execute) noexcept {
    std::uint64_t number = 0;
    for (Entry entry; entries_.pop(entry);) {
      number = entry.batch;
      execute(entry.command);
      if (entry.left == 1) break;
    }
    return number;
  }
  // Sampling thread.
  bool has_batch() const noexcept { return entries_.read_available() > 0; }

 private:
  struct Entry {
    std::uint64_t batch = 0;
    std::uint32_t left = 0;  // commands of the batch, with this one
    Command command;
  };
  boost::lockfree::spsc_queue<Entry> entries_;
  std::vector<Entry> batch_;  // of push()
};

}  // namespace imud
