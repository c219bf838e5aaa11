// A J1939 unit on a bus without other nodes than the test.
#pragma once

#include "tests/protocols/can_unit.hpp"

namespace imud::j1939_test {

inline const std::string own_name = "0100E06600830080";  // the NAME of the initial settings

class Unit : public CanUnit {
 public:
  explicit Unit(std::string_view settings = "") : CanUnit("j1939", settings) {}

  // Takes samples at 100 Hz for a time; returns all frames.
  Texts run(Nanoseconds time) {
    Texts all;
    for (Nanoseconds passed{}; passed < time; passed += 10ms) {
      for (std::string& text : pass(10ms)) all.push_back(std::move(text));
      for (std::string& text : sample()) all.push_back(std::move(text));
    }
    return all;
  }
};

// A unit that has claimed its address, and has had a sample.
class Claimed : public Unit {
 public:
  explicit Claimed(std::string_view settings = "") : Unit(settings) {
    pass(250ms);
    sample();
  }
};

inline std::size_t count_of(const Texts& texts, std::string_view begin) {
  return static_cast<std::size_t>(
      std::ranges::count_if(texts, [&](const std::string& text) { return text.starts_with(begin); }));
}

}  // namespace imud::j1939_test
