// FrameTestValues: the values in a test frame.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/sample.hpp"
#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/frames/layout/frame_element.hpp"
#include "protocols/frames/layout/message_layout.hpp"

namespace imud {

struct FrameTestValues {
  Sample sample;  // clock, counter and status
  MessageLayout::State state;
  std::vector<std::pair<const MeasuredQuantity*, double>> numbers{};  // SI

  // Adds the value of a source. Throws std::invalid_argument if the source cannot have this value.
  void add(const FrameSource& source, double value);
  bool has(const MeasuredQuantity& quantity) const noexcept {
    return std::ranges::find(numbers, &quantity, &std::pair<const MeasuredQuantity*, double>::first) != numbers.end();
  }
  // Returns the given number; 0 if none was given.
  double number(const MeasuredQuantity& quantity) const noexcept {
    for (const auto& [known, value] : numbers)
      if (known == &quantity) return value;
    return 0;
  }
};

// Calls `give` with each value. If `give` refuses a value by std::invalid_argument, calls `fault` with the line, the
// key and the text of the fault. Returns true if no value is refused.
template <class Give, class Fault>
bool give_test_values(std::span<const FrameDescription::Value> values, Give give, Fault fault) {
  bool is_good = true;
  for (const FrameDescription::Value& value : values) try {
      give(value);
    } catch (const std::invalid_argument& error) {
      fault(value.line, "test_values." + value.name, error.what());
      is_good = false;
    }
  return is_good;
}

// Returns the source that a test value sets. Throws std::invalid_argument if there is none.
FrameSource test_source(const std::string& name);
// Throws std::invalid_argument with the fault that no field of the message has the test value. `fields`: the texts of
// the fields.
[[noreturn]] void refuse_test_value(std::span<const std::string_view> fields);

// Returns the number, SI, that a message sends for a quantity. `given`: if not nullptr, has the values in place of
// the Reading's values.
inline double number_of(const MeasuredQuantity& quantity, const std::optional<double>& otherwise,
                        const Reading& reading, const FrameTestValues* given) noexcept {
  if (given != nullptr) return otherwise && !given->has(quantity) ? *otherwise : given->number(quantity);
  return otherwise && !reading.sample.solution ? *otherwise : quantity.get(reading);
}

}  // namespace imud
