// The optional elements of a message: their conditions, their faults, and the tests of their frames.
#include <algorithm>

#include "protocols/frames/layout/frame_compiler.hpp"
#include "protocols/frames/layout/frame_parts.hpp"

namespace imud {

// Returns the bit of the element's condition; 0 if it has none.
std::uint64_t FrameLayout::Compiler::condition_of(const FrameElement& element) {
  if (element.condition.empty()) return 0;
  if (!settings_) settings_.emplace(description_);
  if (!settings_->faults().empty()) return 0;  // which are reported where settings are read
  FrameCondition condition = settings_->condition(element.condition);
  const auto found = std::ranges::find(out_.conditions_, condition);
  const auto index = static_cast<unsigned>(found - out_.conditions_.begin());
  if (found == out_.conditions_.end()) {
    if (index == 64) refuse_element("there are more than 64 different conditions");
    out_.conditions_.push_back(std::move(condition));
  }
  return std::uint64_t{1} << index;
}

// Refuses optional elements with a common condition if their bytes in the range are no whole number of pieces.
void FrameLayout::Compiler::require_whole(const FrameCheck::Range& range, std::size_t bytes,
                                          const std::string& pieces) const {
  for (std::size_t i = 0; i < out_.conditions_.size(); ++i) {
    std::size_t size = 0;
    for (const Whole::Part& part : out_.whole_.parts)
      if (part.needs == std::uint64_t{1} << i && part.offset >= range.first && part.offset < range.second)
        size += part.size;
    if (size % bytes != 0)
      refuse_element("the elements of one condition have " + std::to_string(size) +
                     " bytes, which are no whole number of " + pieces);
  }
}

// Refuses a length that is negative without the optional elements.
void FrameLayout::Compiler::require_sizes(const Whole::Length& length) const {
  const FrameCheck::Range& range = length.range;
  require_whole(range, length.divisor, "pieces of " + std::to_string(length.divisor) + " bytes");
  std::size_t least = range.second - range.first;
  for (const Whole::Part& part : out_.whole_.parts)
    if (part.offset >= range.first && part.offset < range.second) least -= part.size;
  if (length.of(least) < 0) refuse_element("the length is negative without the optional elements");
}

// Keeps the whole layout, and selects the elements that a unit as delivered sends.
void FrameLayout::Compiler::make_optional() {
  if (out_.conditions_.empty()) return;
  Whole& whole = out_.whole_;
  const auto covers = [&](const Whole::Length& length) {
    return std::ranges::all_of(whole.parts, [&](const Whole::Part& part) {
      return part.offset >= length.range.first && part.offset + part.size <= length.range.second;
    });
  };
  if (out_.checks_.empty() && description_.escape == FrameEscape::none && std::ranges::none_of(whole.lengths, covers))
    throw FrameFaults(
        description_.file,
        {{message_.line, where_in(message_, "layout"),
          "a decoder cannot see whether the optional elements are there: give a length of them, or a check"}});
  whole.bytes = out_.template_;
  whole.constant = out_.constant_;
  whole.fields = out_.fields_;
  whole.checks = out_.checks_;
  out_.select(settings_->delivered());
}

// Stores the place of the element if it has any number of bytes.
void FrameLayout::Compiler::set_variable(const FrameElement& element) {
  if (!element.is_variable) return;
  if (use_ == Use::message) refuse_element("only a request has any number of bytes; give their number, as _:4");
  if (use_ == Use::item) refuse_element("an item has a fixed number of bytes");
  if (out_.variable_) refuse_element("only one part of a request has any number of bytes");
  out_.variable_ = out_.size();
}

// Checks that the end of a request with any number of bytes can be found: it needs a length before these bytes.
void FrameLayout::Compiler::make_variable() {
  if (!out_.variable_) return;
  const std::size_t first = *out_.variable_;
  const auto refuse = [this](const char* what) {
    throw FrameFaults(description_.file, {{message_.line, where_in(message_, "layout"), what}});
  };
  bool has_length = false;
  for (const Whole::Length& one : out_.whole_.lengths) {
    const bool is_of_it = one.range.first <= first && one.range.second > first;
    has_length |= is_of_it && one.offset < first;
    if (!is_of_it) continue;
    if (one.divisor != 1) refuse("the length of any number of bytes counts bytes, not pieces");
    std::fill_n(out_.constant_.begin() + static_cast<std::ptrdiff_t>(one.offset), one.number.bytes, std::byte{0});
  }
  if (!has_length) refuse("give a length, before them, of the bytes that may be of any number");
  if (std::ranges::any_of(out_.checks_, [](const Check& one) { return one.check.word_size() != 1; }))
    refuse("a check of any number of bytes is of bytes, not of words");
  if (!out_.have_places({first, first + 1, out_.size(), out_.size()})) refuse("a check has more than 16 ranges");
}

// Compiles the message with the elements that are sent with the settings of the test, and tests this message.
void FrameLayout::Compiler::test_selected(const FrameDescription::Test& test) {
  std::vector<FrameValue> values = settings_->delivered();
  for (const FrameHostDescription::Choice& choice : test.settings) try {
      const std::size_t setting = settings_->at(choice.setting);
      values[setting] = settings_->value_at(setting, choice.values.front());
    } catch (const std::invalid_argument& error) {
      return fault(choice.line, "test_settings", error.what());
    }
  FrameDescription::Message sent = message_;
  sent.layout.clear();
  for (const Placed& placed : placed_) {
    const auto is_needed = [&](const FrameCondition& one) {
      return placed.needs >> (&one - out_.conditions_.data()) & 1U;
    };
    const auto condition = std::ranges::find_if(out_.conditions_, is_needed);
    if (condition == out_.conditions_.end() || condition->allows(values[condition->setting]))
      sent.layout.push_back({placed.element.text, placed.line});
  }
  sent.tests = {test};
  sent.tests.front().settings.clear();
  try {
    static_cast<void>(FrameLayout(description_, sent));
  } catch (const FrameFaults& error) {
    faults_.insert(faults_.end(), error.faults.begin(), error.faults.end());
  }
}

}  // namespace imud
