#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/numbers/number_text.hpp"
#include "protocols/frames/host/frame_captures.hpp"
#include "protocols/frames/layout/frame_compiler.hpp"
#include "protocols/frames/layout/frame_parts.hpp"
#include "protocols/wire/byte_text.hpp"

namespace imud {
namespace {

using Kind = FrameElement::Kind;

// Returns the next word of a text between blanks, and removes it.
std::string_view take_word(std::string_view& text) noexcept {
  const std::size_t begin = std::min(text.find_first_not_of(" \t\n\r"), text.size());
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find_first_of(" \t\n\r"));
  text.remove_prefix(word.size());
  return word;
}

bool is_measured(const FrameElement& element) {
  return element.kind == Kind::field ||
         std::ranges::any_of(element.bit_fields, [](const FrameElement::BitField& bits) {
           return bits.source.kind != FrameSource::Kind::constant;
         });
}

// Returns true if all words of the text are hexadecimal bytes or ??, and there is a ??.
bool has_any_byte(std::string_view text) {
  bool has = false;
  while (true) {
    const std::string_view word = take_word(text);
    if (word.empty()) return has;
    if (word == "??")
      has = true;
    else if (!hex_bytes_in(word))
      return false;
  }
}

}  // namespace

// Divides the elements into captures and a layout. In the layout, captures are bytes of any value.
class FrameBytes::Parser {
 public:
  Parser(const FrameDescription& description, Role role, std::size_t request_size, const FrameSettings& settings,
         bool has_items)
      : description_(description),
        role_(role),
        request_size_(request_size),
        settings_(settings),
        has_items_(has_items) {}

  // Throws std::invalid_argument.
  void add(const FrameHostDescription::Text& element) {
    line_ = element.line;
    std::string_view text = element.text;
    while (text.starts_with(' ')) text.remove_prefix(1);
    if (has_any_byte(text)) {
      if (role_ == Role::answer) refuse_element("an answer has no ??; a byte of the request is {NUMBER}");
      while (true) {
        const std::string_view word = take_word(text);
        if (word.empty()) return;
        keep(word == "??" ? "_:1" : word);
      }
    }
    if (std::string_view rest = text; !take_condition(rest).empty())
      refuse_element("only a message has optional elements");
    if (text == "{items}") {
      if (role_ != Role::request)
        refuse_element("only a request has {items}; an answer to them has a form of its own");
      if (!has_items_) refuse_element("{items} needs items = [[...], ...] of the request");
      if (std::exchange(uses_items_, true)) refuse_element("{items} is given twice");
      return keep("_:*");
    }
    if (text.starts_with('{')) return add_capture(text);
    if (text.starts_with("bits:") && text.find('{') != text.npos) return add_bits(text);
    const FrameElement parsed = parse_frame_element(text, message.is_big, description_.checks);
    if (is_measured(parsed) && is_of_request())
      refuse_element(
          "a request has constants, _:N, bits of constants, lengths, checks, and {NAME}:TYPE of a setting");
    if (parsed.has_carry) refuse_element("only a message carries remainders");
    has_quantities |= is_measured(parsed);
    keep(text);
  }
  // Adds a byte in place of a refused element, so that the other elements can be checked.
  void add_refused() { keep("_:1"); }

  // Sets the places of the captures.
  void place(const FrameLayout& layout) {
    for (auto& [capture, row] : placed_) capture.offset = layout.rows()[row].offset.value_or(0);
  }
  std::vector<Capture> captures() const {
    std::vector<Capture> all;
    for (const auto& [capture, row] : placed_) all.push_back(capture);
    return all;
  }

  bool uses_items() const noexcept { return uses_items_; }

  FrameDescription::Message message;
  bool has_quantities = false;

 private:
  bool is_of_request() const noexcept { return role_ != Role::answer; }
  void keep(std::string_view element) {
    if (!element.starts_with('@')) ++rows_;
    message.layout.push_back({std::string(element), line_});
  }

  void add_capture(std::string_view text) {
    const std::size_t end = text.find('}');
    if (end == text.npos) refuse_element("a capture is {NAME}:TYPE of a setting, or in an answer {3} or {3-6}");
    const std::string name(text.substr(1, end - 1));
    const std::string_view rest = text.substr(end + 1);
    Capture capture;
    if (!name.empty() && name.find_first_not_of("0123456789-") == name.npos) {
      if (is_of_request()) refuse_element("a byte of a request that may be any is ??");
      const std::size_t dash = name.find('-');
      const auto first = number_in<std::size_t>(std::string_view(name).substr(0, dash));
      const auto last = dash == name.npos ? first : number_in<std::size_t>(std::string_view(name).substr(dash + 1));
      if (!first || !last || *last < *first || *last >= request_size_ || !rest.empty())
        refuse_element(request_size_ == 0 ? "a line has no bytes by number; give the answer as a text"
                                          : "give bytes of the request from 0 to " +
                                                std::to_string(request_size_ - 1) + ", as {3} or {3-6}");
      capture.first = *first;
      capture.number.bytes = *last - *first + 1;
    } else {
      if (rest.find_first_of("*+-%") != rest.npos || !rest.starts_with(':'))
        refuse_element("a setting is captured as {NAME}:TYPE, with \" be\" or \" le\": {RATE}:u16");
      capture.number =
          parse_frame_element("sample_counter" + std::string(rest), message.is_big, description_.checks).number;
      if (capture.number.format != FrameNumber::Format::unsigned_integer)
        refuse_element("the type must be unsigned: u8, u16, u24, u32 or u64");
      capture.width = static_cast<unsigned>(8 * capture.number.bytes);
      set_setting(capture, name);
    }
    placed_.emplace_back(capture, rows_);
    keep("_:" + std::to_string(capture.number.bytes));
  }

  void set_setting(Capture& capture, const std::string& name) {
    capture.setting = settings_.at(name);
    settings_.require_codes(*capture.setting, capture.width);
  }

  void add_bits(std::string_view text) {
    std::string order;
    if (text.ends_with(" be") || text.ends_with(" le")) {
      order = text.substr(text.size() - 3);
      text.remove_suffix(3);
    }
    const std::size_t colon = text.find(':', 5);
    if (colon == text.npos) refuse_element("bits are given as bits:u16:0-1={NAME},2=1");
    const std::string head(text.substr(0, colon + 1));
    std::string constants, all;
    for (std::string_view rest = text.substr(colon + 1); !rest.empty();) {
      std::string_view part = rest.substr(0, rest.find(','));
      rest.remove_prefix(std::min(rest.size(), part.size() + 1));
      while (part.starts_with(' ')) part.remove_prefix(1);
      const std::size_t brace = part.find("={");
      const bool is_setting = brace != part.npos;
      const std::string bits(part.substr(0, brace));
      all.append(all.empty() ? "" : ",").append(bits).append(is_setting ? "=0" : "");
      if (!is_setting) {
        constants.append(constants.empty() ? "" : ",").append(bits);
        continue;
      }
      if (!part.ends_with('}')) refuse_element("bits are given as bits:u16:0-1={NAME},2=1");
      const FrameElement one = parse_frame_element(head + bits + "=0" + order, message.is_big, description_.checks);
      Capture capture;
      capture.number = one.number;
      capture.low = one.bit_fields[0].low;
      capture.width = one.bit_fields[0].high - capture.low + 1;
      set_setting(capture, std::string(part.substr(brace + 2, part.size() - brace - 3)));
      placed_.emplace_back(capture, rows_);
    }
    const FrameElement parsed = parse_frame_element(head + all + order, message.is_big, description_.checks);
    if (is_measured(parsed) && is_of_request())
      refuse_element("bits of a request are constants or {NAME} of a setting");
    has_quantities |= is_measured(parsed);
    keep(constants.empty() ? "_:" + std::to_string(parsed.number.bytes) : head + constants + order);
  }

  const FrameDescription& description_;
  const Role role_;
  const std::size_t request_size_;
  const FrameSettings& settings_;
  const bool has_items_;
  bool uses_items_ = false;
  std::uint32_t line_ = 0;
  std::size_t rows_ = 0;                                 // of the elements so far
  std::vector<std::pair<Capture, std::size_t>> placed_;  // with the rows of their elements
};

FrameBytes::FrameBytes(const FrameDescription& description, std::span<const FrameHostDescription::Text> elements,
                       const std::string& place, Role role, std::size_t request_size, const FrameSettings& settings,
                       const Items& items) {
  Parser parser(description, role, request_size, settings, !items.empty());
  std::vector<FrameFault> faults;
  parser.message.line = elements.front().line;
  parser.message.is_big = description.host.is_big;
  for (const FrameHostDescription::Text& element : elements) try {
      parser.add(element);
    } catch (const std::invalid_argument& error) {
      faults.push_back({element.line, place + ": \"" + element.text + "\"", error.what()});
      parser.add_refused();
    }
  try {
    layout_.emplace(description, parser.message,
                    role == Role::item      ? FrameLayout::Use::item
                    : role == Role::request ? FrameLayout::Use::request
                                            : FrameLayout::Use::message);
  } catch (const FrameFaults& error) {
    const std::string head = where_in(parser.message, "");
    for (const FrameFault& fault : error.faults)
      faults.push_back(
          {fault.line, place + ": " + fault.where.substr(std::min(head.size(), fault.where.size())), fault.what});
  }
  for (const std::vector<FrameHostDescription::Text>& item : items) try {
      items_.emplace_back(description, item, place + ": items", Role::item, 0, settings);
      captures_values_ |= items_.back().captures_values();
    } catch (const FrameFaults& error) {
      faults.insert(faults.end(), error.faults.begin(), error.faults.end());
    }
  if (!items.empty() && !parser.uses_items())
    faults.push_back({elements.front().line, place + ": items", "give the element {items}, where they are"});
  if (layout_ && layout_->size() == 0 && role == Role::item)
    faults.push_back({elements.front().line, place, "an item has at least one byte"});
  const std::size_t most =
      role == Role::answer ? FrameHostDescription::longest_answer : FrameHostDescription::longest_request - 1;
  if (layout_ && layout_->size() > most)
    faults.push_back({elements.front().line, place,
                      "has " + std::to_string(layout_->size()) + " bytes, more than " + std::to_string(most)});
  if (!faults.empty()) throw FrameFaults(description.file, std::move(faults));
  parser.place(*layout_);
  captures_ = parser.captures();
  has_quantities_ = parser.has_quantities;
  captures_values_ |= !captures_.empty() && role != Role::answer;
  if (captures_.size() > FrameCaptures::most && role != Role::answer)
    throw FrameFaults(description.file, {{elements.front().line, place, "has too many captures"}});
}

void FrameCaptures::add(std::size_t index, std::optional<FrameValue> chosen_value) noexcept {
  is_allowed &= chosen_value.has_value();
  if (!chosen_value) return;
  const std::span<FrameChosen> all = std::span(chosen).first(count);
  const auto known = std::ranges::find(all, index, &FrameChosen::setting);
  if (known != all.end())
    known->value = *chosen_value;
  else
    chosen[count++] = {index, *chosen_value};
}

// Reads the captured values. `bytes`: a whole request, or a whole item.
void FrameBytes::capture(std::span<const std::byte> bytes, const FrameSettings& settings,
                         FrameCaptures& captures) const noexcept {
  for (const Capture& one : captures_) {
    const std::size_t at = one.offset < fixed() ? one.offset : one.offset - size() + bytes.size();
    const std::uint64_t code = load_number(one.number, bytes.data() + at) >> one.low & low_bits(one.width);
    captures.add(*one.setting, settings.find_code(*one.setting, code));
  }
}

// Reads the captures of items. Returns false if the bytes are no sequence of items.
bool FrameBytes::capture_items(std::span<const std::byte> bytes, const FrameSettings& settings,
                               FrameCaptures& captures) const noexcept {
  while (!bytes.empty()) {
    const auto item = std::ranges::find_if(items_, [bytes](const FrameBytes& one) {
      return one.layout_->match(bytes).match == FrameLayout::Match::yes;
    });
    if (item == items_.end()) return false;
    item->capture(bytes.first(item->size()), settings, captures);
    bytes = bytes.subspan(item->size());
  }
  return true;
}

FrameLayout::Match FrameBytes::match(std::span<const std::byte> held, const FrameSettings& settings,
                                     FrameCaptures& captures) const noexcept {
  const FrameLayout::Found found = layout_->match(held);
  if (found.match != FrameLayout::Match::yes) return found.match;
  captures = {};
  captures.bytes = held.first(found.size);
  capture(captures.bytes, settings, captures);
  if (!items_.empty() && !capture_items(captures.bytes.subspan(fixed(), found.size + 1 - size()), settings, captures))
    return FrameLayout::Match::no;
  return found.match;
}

void FrameBytes::fill(std::span<const FrameValue> values, const FrameSettings& settings,
                      std::span<std::byte> out) const noexcept {
  for (const Capture& one : captures_) {
    if (!one.setting) continue;
    std::byte* const to = out.data() + (one.offset < fixed() ? one.offset : one.offset - size() + out.size());
    const std::uint64_t code = settings.code({*one.setting, values[*one.setting]});
    store_number(load_number(one.number, to) | (code & low_bits(one.width)) << one.low, one.number, to);
  }
}

std::vector<std::byte> FrameBytes::example(std::span<const FrameValue> values, const FrameSettings& settings) const {
  std::vector<std::byte> content;
  for (const FrameBytes& item : items_) {
    const std::vector<std::byte> one = item.example(values, settings);
    content.insert(content.end(), one.begin(), one.end());
  }
  std::vector<std::byte> bytes = layout_->with_content(content);
  fill(values, settings, bytes);
  layout_->seal(bytes);
  return bytes;
}

void FrameBytes::write(const Reading& newest, std::span<const std::byte> request, std::span<const FrameValue> values,
                       const FrameSettings& settings, std::span<std::byte> out) const noexcept {
  layout_->encode(newest, {}, {}, out);
  for (const Capture& one : captures_)
    if (!one.setting)
      std::ranges::copy(request.subspan(one.first, one.number.bytes),
                        out.begin() + static_cast<std::ptrdiff_t>(one.offset));
  fill(values, settings, out);
  layout_->seal(out);
}

}  // namespace imud
