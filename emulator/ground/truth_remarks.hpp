// TruthRemarks: texts about the truth that the sampling thread leaves for the log, each once in a run.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <span>
#include <string_view>

#include "emulator/ground/truth_bounds.hpp"

namespace imud {

// A text that one thread writes once and any thread reads afterwards. Allocates nothing.
class Remark {
 public:
  bool is_set() const noexcept { return size_.load(std::memory_order_acquire) != 0; }
  // Empty until it is set; later it does not change.
  std::string_view text() const noexcept { return {text_.data(), size_.load(std::memory_order_acquire)}; }

  // Sets the text, unless it is set already: `write(std::span<char> room)` writes it and returns its length, 0 if
  // there is nothing to remark yet. The sampling thread only.
  template <class Write>
  void set(Write write) noexcept {
    if (size_.load(std::memory_order_relaxed) != 0) return;
    size_.store(write(std::span<char>(text_)), std::memory_order_release);
  }

 private:
  std::array<char, 1000> text_{};
  std::atomic<std::size_t> size_ = 0;
};

struct TruthRemarks {
  Remark columns;                                 // columns that nothing reads
  Remark no_force;                                // truth without specific force and accumulated velocity
  Remark no_place;                                // truth without places, which an imu needs
  Remark far_from_earth;                          // positions at which the model of gravitation is not valid
  Remark time_unit;                               // times that are not nanoseconds
  Remark senders;                                 // two simulators at one port
  Remark content;                                 // the datagrams of a capture without any for the port
  Remark place;                                   // a place, or an angle of the Earth, that contradicts [earth]
  Remark date;                                    // a date that contradicts [earth]
  Remark noisy_poses;                             // motion that the given window derives is noise
  Remark last_line;                               // the last line of a file, without a line feed
  Remark long_line;                               // a line that is longer than the decoder's buffer
  std::array<Remark, BoundsWatch::kinds> excess;  // numbers and steps beyond truth.max_*

  // In the order in which the log reports them.
  std::array<const Remark*, 12 + BoundsWatch::kinds> all() const noexcept {
    std::array<const Remark*, 12 + BoundsWatch::kinds> all = {&content,        &columns,   &no_force,  &no_place,
                                                              &far_from_earth, &time_unit, &last_line, &long_line,
                                                              &senders,        &place,     &date,      &noisy_poses};
    for (std::size_t i = 0; i < excess.size(); ++i) all[all.size() - excess.size() + i] = &excess[i];
    return all;
  }
};

}  // namespace imud
