#include "protocols/quantities/json_fields.hpp"

#include <array>
#include <charconv>
#include <stdexcept>
#include <utility>

namespace imud {
namespace {

constexpr std::size_t no_node = SIZE_MAX;

bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
bool is_hex(char c) noexcept { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

}  // namespace

JsonFields::JsonFields(TruthMap map) : map_(std::move(map)), nodes_(1) {
  for (const MappedQuantity& mapped : map_) {
    std::size_t node = 0;
    for (std::string_view rest = mapped.theirs; rest.data() != nullptr;) {
      const std::size_t dot = rest.find('.');
      const std::string_view name = rest.substr(0, dot);
      rest = dot == rest.npos ? std::string_view{} : rest.substr(dot + 1);
      std::size_t child = child_of(node, name);
      if (child == no_node) {
        child = nodes_.size();
        nodes_.push_back({std::string(name), 0, std::exchange(nodes_[node].child, child), nullptr});
      }
      node = child;
      const bool is_last = rest.data() == nullptr;
      if (nodes_[node].mapped != nullptr || (is_last && nodes_[node].child != 0))
        throw std::invalid_argument("columns: \"" + mapped.theirs +
                                    "\" is given twice, or is a part of another one's path");
      if (is_last) nodes_[node].mapped = &mapped;
    }
  }
}

std::size_t JsonFields::child_of(std::size_t node, std::string_view name) const noexcept {
  if (node == no_node) return no_node;
  std::size_t child = nodes_[node].child;
  while (child != 0 && nodes_[child].name != name) child = nodes_[child].sibling;
  return child == 0 ? no_node : child;
}

JsonFields::Outcome JsonFields::read(std::string_view text, TruthReading& reading) noexcept {
  text_ = text;
  at_ = 0;
  reading_ = &reading;
  given_.reset();
  refused_ = {};
  unknown_.clear();
  skip_blanks();
  const bool whole = at_ < text_.size() && text_[at_] == '{' ? read_value(0, 0) : false;
  if (!whole) return at_ >= text_.size() ? Outcome::cut : Outcome::faulty;
  return refused_.cause == TruthResult::ok ? Outcome::whole : Outcome::refused;
}

void JsonFields::skip_blanks() noexcept {
  while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n' || text_[at_] == '\r'))
    ++at_;
}

// Takes `c` and the blanks around it.
bool JsonFields::take(char c) noexcept {
  skip_blanks();
  if (at_ == text_.size() || text_[at_] != c) return false;
  ++at_;
  skip_blanks();
  return true;
}

// Reads the value for `node`; no_node: skips a value of which nothing is wanted.
bool JsonFields::read_value(std::size_t node, std::size_t depth) noexcept {
  if (at_ == text_.size()) return false;
  const MappedQuantity* const mapped = node == no_node ? nullptr : nodes_[node].mapped;
  const std::size_t begin = at_;
  std::string_view value;
  bool is_whole = false, is_scalar = true;
  switch (text_[at_]) {
    case '{':
    case '[':
      if (depth == max_depth) return false;
      is_scalar = false;
      is_whole = text_[at_] == '{' ? read_object(node, depth + 1) : read_array(node, depth + 1);
      value = text_.substr(begin, 1);
      break;
    case '"':
      is_whole = read_text(value);
      break;
    case 't':
    case 'f':
    case 'n':
      is_whole = read_word({"true", "false", "null"});
      is_scalar = false;
      value = text_.substr(begin, at_ - begin);
      break;
    default:
      is_whole = read_not_finite() || read_number();
      value = text_.substr(begin, at_ - begin);
  }
  if (!is_whole || mapped == nullptr) return is_whole;
  if (is_scalar)
    set(mapped->field, value);
  else if (refused_.cause == TruthResult::ok)
    refused_ = {TruthResult::bad_number, mapped->field.quantity, value};
  return true;
}

bool JsonFields::read_object(std::size_t node, std::size_t depth) noexcept {
  ++at_;
  if (take('}')) return true;
  do {
    std::string_view name;
    skip_blanks();
    if (!read_text(name) || !take(':')) return false;
    const std::size_t child = child_of(node, name);
    const auto field = map_.empty() && depth == 1 ? find_signed_field(name) : std::nullopt;
    if (depth == 1 && child == no_node && !field && unknown_.size() < unknown_.capacity()) unknown_.push_back(name);
    const std::size_t begin = at_;
    const bool is_text = at_ < text_.size() && text_[at_] == '"';
    if (!read_value(child, depth)) return false;
    if (field) set(*field, text_.substr(begin + (is_text ? 1 : 0), at_ - begin - (is_text ? 2 : 0)));
  } while (take(','));
  skip_blanks();
  if (at_ == text_.size() || text_[at_] != '}') return false;
  ++at_;
  return true;
}

bool JsonFields::read_array(std::size_t node, std::size_t depth) noexcept {
  ++at_;
  if (take(']')) return true;
  std::size_t index = 0;
  do {
    std::array<char, 20> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), index++).ptr;
    const std::string_view name(digits.data(), static_cast<std::size_t>(end - digits.data()));
    if (!read_value(child_of(node, name), depth)) return false;
  } while (take(','));
  skip_blanks();
  if (at_ == text_.size() || text_[at_] != ']') return false;
  ++at_;
  return true;
}

bool JsonFields::read_text(std::string_view& text) noexcept {
  if (at_ == text_.size() || text_[at_] != '"') return false;
  const std::size_t begin = ++at_;
  for (; at_ < text_.size() && text_[at_] != '"'; ++at_) {
    if (static_cast<unsigned char>(text_[at_]) < 0x20) return false;
    if (text_[at_] != '\\') continue;
    if (++at_ == text_.size()) return false;
    if (text_[at_] == 'u') {
      for (int i = 0; i < 4; ++i)
        if (++at_ == text_.size() || !is_hex(text_[at_])) return false;
    } else if (std::string_view("\"\\/bfnrt").find(text_[at_]) == std::string_view::npos) {
      return false;
    }
  }
  if (at_ == text_.size()) return false;
  text = text_.substr(begin, at_ - begin);
  ++at_;
  return true;
}

bool JsonFields::read_digits() noexcept {
  const std::size_t begin = at_;
  while (at_ < text_.size() && is_digit(text_[at_])) ++at_;
  return at_ > begin;
}

bool JsonFields::read_number() noexcept {
  const auto next_is = [&](std::string_view any) { return at_ < text_.size() && any.find(text_[at_]) != any.npos; };
  if (next_is("-")) ++at_;
  if (next_is("0"))
    ++at_;
  else if (!read_digits())
    return false;
  if (next_is(".")) {
    ++at_;
    if (!read_digits()) return false;
  }
  if (next_is("eE")) {
    ++at_;
    if (next_is("+-")) ++at_;
    if (!read_digits()) return false;
  }
  return true;
}

bool JsonFields::read_word(std::initializer_list<std::string_view> words) noexcept {
  for (const std::string_view word : words) {
    const std::string_view found = text_.substr(at_, word.size());
    if (!word.starts_with(found)) continue;
    at_ += found.size();
    return found == word;
  }
  return false;
}

bool JsonFields::read_not_finite() noexcept {
  const std::size_t sign = text_[at_] == '-' ? 1 : 0;
  if (text_.substr(at_ + sign).starts_with('I')) at_ += sign;
  return text_[at_] != '-' && read_word({"NaN", "Infinity"});
}

void JsonFields::set(const TruthField& field, std::string_view value) noexcept {
  if (given_[field.quantity] && refused_.cause == TruthResult::ok)
    refused_ = {TruthResult::no_columns, field.quantity, value, true};
  const TruthResult result = reading_->set(field, value);
  given_.set(field.quantity);
  if (result != TruthResult::ok && refused_.cause == TruthResult::ok) refused_ = {result, field.quantity, value};
}

}  // namespace imud
