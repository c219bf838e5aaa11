#include "protocols/frames/layout/frame_test_values.hpp"

#include <cmath>
#include <stdexcept>

namespace imud {

void FrameTestValues::add(const FrameSource& source, double value) {
  using enum MeasuredQuantity::Kind;
  const MeasuredQuantity* quantity = source.in.quantity;
  if (quantity != nullptr && quantity->kind == number) {
    numbers.emplace_back(quantity, source.in.factor * value + source.in.offset);
    return;
  }
  if (quantity != nullptr && quantity->kind == time) {
    if (std::abs(source.in.factor * value) > 1e9) throw std::invalid_argument("give a time up to 1e9 s");
    sample.time.ns = std::llround(source.in.factor * value * 1e9);
    return;
  }
  if (value < 0 || value > 0x1p53 || value != std::floor(value))
    throw std::invalid_argument("give a whole number that is not negative");
  const auto whole = static_cast<std::uint64_t>(value);
  if (quantity != nullptr && quantity->kind == counter)
    sample.counter = whole;
  else if (quantity != nullptr)
    sample.status = static_cast<std::uint32_t>(whole);
  else if (source.kind == FrameSource::Kind::alive_counter)
    state.count = whole;
  else if (source.kind == FrameSource::Kind::frame_counter)
    state.frames = whole;
  else if (source.bits == FrameSource::starting)
    state.is_starting = whole != 0;
  else
    sample.status = whole != 0 ? sample.status | source.bits : sample.status & ~source.bits;
}

FrameSource test_source(const std::string& name) {
  const auto source = name.starts_with('-') ? std::nullopt : find_frame_source(name);
  if (!source) throw std::invalid_argument(unknown_frame_source(name));
  return *source;
}

void refuse_test_value(std::span<const std::string_view> fields) {
  std::string names;
  for (const std::string_view field : fields)
    names.append(names.empty() ? "" : ", ").append(field.substr(0, field.find_first_of(":%")));
  throw std::invalid_argument("the message does not carry it; its fields are " + (names.empty() ? "none" : names));
}

}  // namespace imud
