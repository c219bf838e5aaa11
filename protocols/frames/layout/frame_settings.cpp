#include "protocols/frames/layout/frame_settings.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "core/numbers/nearest.hpp"
#include "core/numbers/number_text.hpp"
#include "protocols/frames/layout/frame_number.hpp"

namespace imud {
namespace {

constexpr double highest_baud = 2e7;

char lower(char c) noexcept { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

[[noreturn]] void refuse_setting(const std::string& fault) { throw std::invalid_argument(fault); }

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

}  // namespace

bool is_same_text(std::string_view a, std::string_view b, bool ignores_case) noexcept {
  if (!ignores_case) return a == b;
  return std::ranges::equal(a, b, [](char x, char y) { return lower(x) == lower(y); });
}

bool FrameCondition::allows(FrameValue value) const noexcept {
  if (mask != 0) return ((value + lowest) & mask) == wanted;
  return std::ranges::find(values, value) != values.end();
}

bool FrameCondition::excludes(const FrameCondition& other) const noexcept {
  if (setting != other.setting) return false;
  if (mask != 0 && other.mask != 0) return (mask & other.mask & (wanted ^ other.wanted)) != 0;
  const FrameCondition &list = mask == 0 ? *this : other, &rest = mask == 0 ? other : *this;
  return std::ranges::none_of(list.values, [&](FrameValue value) { return rest.allows(value); });
}

bool all_hold(std::span<const FrameCondition> conditions, std::span<const FrameValue> values) noexcept {
  return std::ranges::all_of(conditions, [&](const FrameCondition& one) { return one.allows(values[one.setting]); });
}

bool exclude(std::span<const FrameCondition> some, std::span<const FrameCondition> others) noexcept {
  return std::ranges::any_of(some, [&](const FrameCondition& one) {
    return std::ranges::any_of(others, [&](const FrameCondition& two) { return one.excludes(two); });
  });
}

bool FrameSwitch::is_on(std::span<const FrameValue> values) const noexcept {
  if (!is_streamed || (rate && periods[values[*rate]].count() == 0)) return false;
  return all_hold(when, values);
}

FrameSettings::FrameSettings(const FrameDescription& description) : all_(description.host.settings) {
  for (const Setting& one : all_) {
    std::vector<double>& numbers = numbers_.emplace_back();
    for (const std::string& value : one.values)
      numbers.push_back(one.is_number ? number_in<double>(value).value_or(0) : 0);
    std::vector<std::uint64_t>& codes = codes_.emplace_back(one.codes);
    codes.resize(one.values.size(), no_code);
    if (!one.codes.empty() || !one.is_number) continue;
    for (std::size_t k = 0; k < codes.size(); ++k)
      if (numbers[k] >= 0 && numbers[k] <= 0x1p53 && numbers[k] == std::floor(numbers[k]))
        codes[k] = static_cast<std::uint64_t>(numbers[k]);
  }
}

std::vector<FrameFault> FrameSettings::faults() const {
  std::vector<FrameFault> faults;
  if (all_.size() > FrameHostDescription::most_settings)
    faults.push_back(
        {all_.front().line, "setting", "there are more than " + std::to_string(FrameHostDescription::most_settings)});
  constexpr std::string_view words[] = {"setting", "value", "any", "line"};
  for (const Setting& one : all_) {
    const auto fault = [&](std::string what) {
      faults.push_back({one.line, "setting." + one.name, std::move(what)});
    };
    const auto is_letter = [](char c) {
      return (lower(c) >= 'a' && lower(c) <= 'z') || (c >= '0' && c <= '9') || c == '_';
    };
    if (one.name.empty() || !std::ranges::all_of(one.name, is_letter) || (one.name[0] >= '0' && one.name[0] <= '9'))
      fault("a name is of letters, digits and underscores, and does not begin with a digit");
    if (std::ranges::find(words, one.name) != std::end(words))
      fault("give another name; {" + one.name + "} means something else in requests and answers");
    if (one.is_range) {
      if (one.lowest > one.highest) fault("min must not be more than max");
      continue;
    }
    if (one.values.empty() || one.values.size() > FrameHostDescription::most_values) {
      fault("give 1 to " + std::to_string(FrameHostDescription::most_values) +
            " allowed values, the delivered one first");
      continue;
    }
    for (std::size_t i = 0; i < one.values.size(); ++i) {
      if (std::find(one.values.begin(), one.values.begin() + static_cast<std::ptrdiff_t>(i), one.values[i]) !=
          one.values.begin() + static_cast<std::ptrdiff_t>(i))
        fault("the value " + one.values[i] + " is given twice");
      if (!std::ranges::all_of(one.values[i], [](char c) { return c > ' ' && c <= '~'; }) || one.values[i].empty())
        fault("a value has printable characters without blanks");
    }
    if (!one.codes.empty() && one.codes.size() != one.values.size())
      fault("there are " + std::to_string(one.codes.size()) + " codes for " + std::to_string(one.values.size()) +
            " values; give one for each value, in their order");
    for (std::size_t i = 0; i < one.codes.size(); ++i)
      if (std::find(one.codes.begin(), one.codes.begin() + static_cast<std::ptrdiff_t>(i), one.codes[i]) !=
          one.codes.begin() + static_cast<std::ptrdiff_t>(i))
        fault("the code " + std::to_string(one.codes[i]) + " is given twice");
  }
  return faults;
}

std::optional<std::size_t> FrameSettings::find(std::string_view name, bool ignores_case) const noexcept {
  for (std::size_t i = 0; i < all_.size(); ++i)
    if (is_same_text(all_[i].name, name, ignores_case)) return i;
  return std::nullopt;
}

std::optional<FrameValue> FrameSettings::find_value(std::size_t setting, std::string_view text,
                                                    bool ignores_case) const noexcept {
  const Setting& one = all_[setting];
  // A text that is no number becomes NaN, which equals no value and is in no range.
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  const double given = one.is_number ? number_in<double>(text).value_or(none) : none;
  if (one.is_range) {
    if (given != std::floor(given) || given < static_cast<double>(one.lowest) ||
        given > static_cast<double>(one.highest))
      return std::nullopt;
    return static_cast<FrameValue>(static_cast<std::int64_t>(given) - one.lowest);
  }
  for (std::size_t i = 0; i < one.values.size(); ++i)
    if (is_same_text(one.values[i], text, ignores_case) || given == numbers_[setting][i]) return i;
  return std::nullopt;
}

std::optional<FrameValue> FrameSettings::find_code(std::size_t setting, std::uint64_t code) const noexcept {
  const Setting& one = all_[setting];
  if (one.is_range) {
    const auto lowest = static_cast<std::uint64_t>(one.lowest), highest = static_cast<std::uint64_t>(one.highest);
    return code >= lowest && code <= highest ? std::optional(code - lowest) : std::nullopt;
  }
  const auto found = std::ranges::find(codes_[setting], code);
  if (found == codes_[setting].end() || code == no_code) return std::nullopt;
  return static_cast<FrameValue>(found - codes_[setting].begin());
}

std::uint64_t FrameSettings::code(FrameChosen chosen) const noexcept {
  const Setting& one = all_[chosen.setting];
  return one.is_range ? static_cast<std::uint64_t>(one.lowest) + chosen.value : codes_[chosen.setting][chosen.value];
}

double FrameSettings::number(FrameChosen chosen) const noexcept {
  const Setting& one = all_[chosen.setting];
  if (one.is_range) return static_cast<double>(one.lowest + static_cast<std::int64_t>(chosen.value));
  return numbers_[chosen.setting][chosen.value];
}

std::string_view FrameSettings::text(FrameChosen chosen, Room& room) const noexcept {
  const Setting& one = all_[chosen.setting];
  if (!one.is_range) return one.values[chosen.value];
  const auto end =
      std::to_chars(room.data(), room.data() + room.size(), one.lowest + static_cast<std::int64_t>(chosen.value)).ptr;
  return {room.data(), static_cast<std::size_t>(end - room.data())};
}

std::string FrameSettings::word(FrameChosen chosen) const {
  Room room;
  return std::string(text(chosen, room));
}

template <class Check>
void FrameSettings::each_end(std::size_t setting, Check check) const {
  const Setting& one = all_[setting];
  if (one.is_range) {
    const auto last = static_cast<FrameValue>(one.highest - one.lowest);
    for (const FrameValue value : {one.delivered, FrameValue{0}, last}) check(FrameChosen{setting, value});
  }
  for (std::size_t i = 0; i < one.values.size(); ++i) check(FrameChosen{setting, i});
}

std::vector<std::string> FrameSettings::examples(std::size_t setting) const {
  std::vector<std::string> texts;
  each_end(setting, [&](FrameChosen chosen) { texts.push_back(word(chosen)); });
  return texts;
}

std::size_t FrameSettings::at(const std::string& name) const {
  if (const auto found = find(name)) return *found;
  std::vector<std::string> names;
  for (const Setting& one : all_) names.push_back(one.name);
  const std::string meant = nearest(name, names);
  refuse_setting("there is no setting \"" + name + "\"; " +
                 (!meant.empty()  ? "did you mean \"" + meant + "\"?"
                  : names.empty() ? "describe it as [setting] " + name + " = [allowed values]"
                                  : "there are " + listed(names)));
}

FrameValue FrameSettings::value_at(std::size_t setting, const std::string& text) const {
  if (const auto found = find_value(setting, text)) return *found;
  const Setting& one = all_[setting];
  refuse_setting(text + " is no value of " + one.name +
                 (one.is_range ? "; give a whole number from " + std::to_string(one.lowest) + " to " +
                                     std::to_string(one.highest)
                               : "; there are " + listed(one.values)));
}

FrameCondition FrameSettings::condition(const FrameHostDescription::Choice& choice) const {
  FrameCondition condition{at(choice.setting), {}};
  for (const std::string& value : choice.values) condition.values.push_back(value_at(condition.setting, value));
  return condition;
}

FrameCondition FrameSettings::condition(std::string_view text) const {
  if (const std::size_t equals = text.find('='); equals != text.npos)
    return condition({std::string(text.substr(0, equals)), {std::string(text.substr(equals + 1))}, 0});
  const bool is_inverse = text.starts_with('!');
  const std::size_t dot = text.find('.');
  const auto bit = dot == text.npos ? std::nullopt : number_in<unsigned>(text.substr(dot + 1));
  if (!bit || *bit > 63)
    refuse_setting(
        "an optional element begins with a bit or a value of a setting, as MASK.3? or !MASK.3? or FORM=A?");
  FrameCondition condition{at(std::string(text.substr(is_inverse, dot - is_inverse)))};
  const std::uint64_t mask = std::uint64_t{1} << *bit;
  const Setting& one = all_[condition.setting];
  require_codes(condition.setting, 64);
  if (one.is_range) {
    condition.lowest = static_cast<std::uint64_t>(one.lowest);
    condition.mask = mask;
    condition.wanted = is_inverse ? 0 : mask;
  }
  for (std::size_t i = 0; i < one.values.size(); ++i)
    if (((codes_[condition.setting][i] & mask) == 0) == is_inverse) condition.values.push_back(i);
  // The least value from `lowest` on that has the bit.
  const auto with_bit = [mask](std::uint64_t lowest) {
    return (lowest & mask) != 0 ? lowest : (lowest & ~(mask - 1)) | mask;
  };
  if (one.is_range ? static_cast<std::uint64_t>(one.highest) < with_bit(static_cast<std::uint64_t>(one.lowest))
                   : std::ranges::none_of(codes_[condition.setting], [=](auto code) { return (code & mask) != 0; }))
    refuse_setting("no value of " + one.name + " has bit " + std::to_string(*bit));
  return condition;
}

std::vector<FrameValue> FrameSettings::delivered() const {
  std::vector<FrameValue> values;
  for (const Setting& one : all_) values.push_back(one.delivered);
  return values;
}

FrameSwitch FrameSettings::switch_of(const FrameDescription::Message& message,
                                     std::vector<FrameFault>& faults) const {
  FrameSwitch result;
  result.is_streamed = message.is_streamed;
  const auto attempt = [&](std::uint32_t line, const std::string& key, auto act) {
    try {
      act();
    } catch (const std::invalid_argument& error) {
      faults.push_back({line, "message \"" + message.name + "\": " + key, error.what()});
    }
  };
  for (const FrameHostDescription::Choice& choice : message.when)
    attempt(choice.line, "when." + choice.setting, [&] { result.when.push_back(condition(choice)); });
  if (!message.rate_setting.empty())
    attempt(message.line, "rate_hz", [&] {
      result.periods = periods(at(message.rate_setting));
      result.rate = at(message.rate_setting);
    });
  return result;
}

void FrameSettings::require_codes(std::size_t setting, unsigned bits) const {
  const Setting& one = all_[setting];
  if (one.is_range && one.lowest < 0)
    refuse_setting(one.name + " has negative values, which have no code; give {values = [...], codes = [...]}");
  each_end(setting, [&](FrameChosen chosen) {
    const std::uint64_t sent = code(chosen);
    if (!one.is_range && sent == no_code)
      refuse_setting("the value " + word(chosen) + " of " + one.name +
                     " has no code; give {values = [...], codes = [...]}");
    if (sent > low_bits(bits)) refuse_setting("the bits do not hold the code of the value " + word(chosen));
  });
}

std::vector<Nanoseconds> FrameSettings::periods(std::size_t setting) const {
  const Setting& one = all_[setting];
  each_end(setting, [&](FrameChosen chosen) {
    const double rate_hz = number(chosen);
    const bool is_special = rate_hz == 0 || std::isinf(rate_hz);
    if (!one.is_number || !(is_special || (rate_hz >= Grid::min_rate_hz && rate_hz <= Grid::max_rate_hz)))
      refuse_setting("the value " + word(chosen) + " of " + one.name +
                     " is no rate; give Hz from 0.001 to 10000, 0, at which nothing is sent, or inf: each sample");
  });
  const std::size_t count = one.is_range ? static_cast<std::size_t>(one.highest - one.lowest) + 1 : one.values.size();
  std::vector<Nanoseconds> periods;
  for (std::size_t i = 0; i < count; ++i) {
    const double rate_hz = number({setting, i});
    periods.push_back(rate_hz == 0          ? Nanoseconds{}
                      : std::isinf(rate_hz) ? FrameSwitch::each_sample
                                            : nanoseconds(1 / rate_hz));
  }
  return periods;
}

void FrameSettings::require_bauds(std::size_t setting) const {
  each_end(setting, [&](FrameChosen chosen) {
    const double baud = number(chosen);
    if (!all_[setting].is_number || !(baud >= 1 && baud <= highest_baud) || baud != std::floor(baud))
      refuse_setting("the value " + word(chosen) + " of " + all_[setting].name +
                     " is no bit rate; give whole numbers up to 20000000");
  });
}

}  // namespace imud
