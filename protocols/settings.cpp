#include "protocols/settings.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

using List = std::vector<std::string>;

template <class... Alternatives>
struct Overloaded : Alternatives... {
  using Alternatives::operator()...;
};
template <class... Alternatives>
Overloaded(Alternatives...) -> Overloaded<Alternatives...>;

// Returns the initial value of a setting. Later values have the type of the result.
SettingValue initial_value(const Setting& setting) {
  return std::visit(
      Overloaded{
          [](std::string_view text) -> SettingValue { return std::string(text); },
          [](std::span<const std::string_view> list) -> SettingValue { return List(list.begin(), list.end()); },
          [](auto number) -> SettingValue { return number; },
      },
      setting.initial);
}

std::string join(std::span<const std::string_view> words) {
  std::string joined;
  for (const std::string_view word : words) joined.append(joined.empty() ? "" : ", ").append(word);
  return joined;
}

std::string number_text(double value, bool integer) {
  char text[32];
  const auto end = integer ? std::to_chars(text, std::end(text), static_cast<std::int64_t>(value)).ptr
                           : std::to_chars(text, std::end(text), value).ptr;
  return {text, end};
}

std::string valid_values(const Setting& setting) {
  const auto number = [&setting](std::string kind, bool integer) {
    if (setting.min < setting.max)
      kind += " from " + number_text(setting.min, integer) + " to " + number_text(setting.max, integer);
    return kind;
  };
  return std::visit(
      Overloaded{
          [](bool) -> std::string { return "true or false"; },
          [&](std::int64_t) { return number("an integer", true); },
          [&](double) { return number("a finite number", false); },
          [&](std::string_view) { return setting.choices.empty() ? "a text" : "one of " + join(setting.choices); },
          [](std::span<const std::string_view>) -> std::string { return "a list of texts, such as [\"a\", \"b\"]"; },
      },
      setting.initial);
}

[[noreturn]] void refuse(const Setting& setting) {
  throw std::invalid_argument(std::string(setting.key) + ": must be " + valid_values(setting));
}

bool acceptable(const Setting& setting, const SettingValue& value) {
  const auto within = [&setting](double number) {
    return std::isfinite(number) && (setting.min >= setting.max || (number >= setting.min && number <= setting.max));
  };
  return std::visit(Overloaded{
                        [](bool) { return true; },
                        [&](std::int64_t number) { return within(static_cast<double>(number)); },
                        [&](double number) { return within(number); },
                        [&](const std::string& text) {
                          return setting.choices.empty() || std::ranges::count(setting.choices, text) > 0;
                        },
                        [](const List&) { return true; },
                    },
                    value);
}

std::string_view without_blanks(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::optional<std::int64_t> integer_from(std::string_view text) {
  const bool negative = text.starts_with('-');
  std::string_view digits = text.substr(negative ? 1 : 0);
  const bool hexadecimal = digits.starts_with("0x") || digits.starts_with("0X");
  if (hexadecimal) digits.remove_prefix(2);
  if (digits.empty() || digits.front() == '-') return {};
  const std::string signed_digits = (negative ? "-" : "") + std::string(digits);
  return number_in<std::int64_t>(signed_digits, hexadecimal ? 16 : 10);
}

List parse_list(std::string_view text) {
  List list;
  if (without_blanks(text).empty()) return list;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    list.emplace_back(without_blanks(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return list;
}

}  // namespace

Settings::Settings(std::span<const Setting> declared) : declared_(declared) {
  for (const Setting& setting : declared) {
    values_.push_back(initial_value(setting));
    if (setting.frames != nullptr) frames_ = *setting.frames;
  }
}

std::size_t Settings::find(std::string_view key) const {
  return static_cast<std::size_t>(std::ranges::find(declared_, key, &Setting::key) - declared_.begin());
}

void Settings::set(std::string_view key, SettingValue value) {
  const std::size_t i = find(key);
  if (i == declared_.size()) {
    std::vector<std::string_view> keys;
    for (const Setting& setting : declared_) keys.push_back(setting.key);
    throw std::invalid_argument("unknown setting \"" + std::string(key) + "\"; " +
                                (keys.empty() ? "there are no settings" : "the settings are " + join(keys)));
  }
  if (std::holds_alternative<double>(values_[i]) && std::holds_alternative<std::int64_t>(value))
    value = static_cast<double>(std::get<std::int64_t>(value));
  if (value.index() != values_[i].index() || !acceptable(declared_[i], value)) refuse(declared_[i]);
  values_[i] = std::move(value);
  if (declared_[i].names_frames) frames_.reset();
}

void Settings::set_text(std::string_view key, std::string_view text) {
  const std::size_t i = find(key);
  if (i == declared_.size()) return set(key, false);  // throws, as the key is unknown
  const Setting& setting = declared_[i];
  const auto parsed = [&setting](const auto& number) -> SettingValue {
    if (!number) refuse(setting);
    return *number;
  };
  set(key, std::visit(Overloaded{
                          [&](bool) -> SettingValue {
                            if (text != "true" && text != "false") refuse(setting);
                            return text == "true";
                          },
                          [&](std::int64_t) { return parsed(integer_from(text)); },
                          [&](double) { return parsed(number_in<double>(text)); },
                          [&](const std::string&) -> SettingValue { return std::string(text); },
                          [&](const List&) -> SettingValue { return parse_list(text); },
                      },
                      values_[i]));
}

const SettingValue& Settings::value(std::string_view key) const {
  const std::size_t i = find(key);
  if (i == values_.size()) throw std::logic_error("setting \"" + std::string(key) + "\" is not declared");
  return values_[i];
}

template <class T>
const T& Settings::get(std::string_view key) const {
  const T* typed = std::get_if<T>(&value(key));
  if (typed == nullptr) throw std::logic_error("setting \"" + std::string(key) + "\" has another type");
  return *typed;
}

bool Settings::flag(std::string_view key) const { return get<bool>(key); }
std::int64_t Settings::integer(std::string_view key) const { return get<std::int64_t>(key); }
double Settings::real(std::string_view key) const { return get<double>(key); }
const std::string& Settings::text(std::string_view key) const { return get<std::string>(key); }
const std::vector<std::string>& Settings::list(std::string_view key) const { return get<List>(key); }

}  // namespace imud
