#include <algorithm>
#include <stdexcept>

#include "protocols/frames/host/frame_captures.hpp"

namespace imud {
namespace {

// Returns words for people that describe a value of the setting which contains `c`; empty if no value contains it.
std::string value_with(const FrameSettings::Setting& setting, char c) {
  if (setting.is_range && ((c >= '0' && c <= '9') || (c == '-' && setting.lowest < 0)))
    return "a value from " + std::to_string(setting.lowest) + " to " + std::to_string(setting.highest);
  for (const std::string& value : setting.values)
    if (value.find(c) != value.npos) return "the value " + value;
  return "";
}

}  // namespace

FrameLine::FrameLine(std::string_view pattern, bool ignores_case, const FrameSettings& settings)
    : ignores_case_(ignores_case) {
  const auto refuse = [](const std::string& fault) { throw std::invalid_argument(fault); };
  for (std::string_view rest = pattern; !rest.empty();) {
    Part part;
    if (rest.front() != '{') {
      part.text = rest.substr(0, rest.find('{'));
      if (!std::ranges::all_of(part.text, [](char c) { return c >= ' ' && c <= '~'; }))
        refuse("a line has printable characters; its end, CR or LF, is left out");
      rest.remove_prefix(part.text.size());
      parts_.push_back(std::move(part));
      continue;
    }
    const std::size_t end = rest.find('}');
    if (end == std::string_view::npos) refuse("a capture is {setting}, {value}, {NAME} of a setting, or {any}");
    const std::string name(rest.substr(1, end - 1));
    rest.remove_prefix(end + 1);
    if (rest.starts_with('{')) refuse("two captures need a character between them");
    if (!rest.empty()) part.end = rest.front();
    if (name == "setting") {
      part.kind = Kind::setting;
      if (std::exchange(captures_setting_, true)) refuse("{setting} is given twice");
      if (settings.size() == 0) refuse("{setting} needs a [setting]");
    } else if (name == "value") {
      part.kind = Kind::value;
      if (!captures_setting_) refuse("{value} must follow {setting}; the value of one setting is {NAME}");
    } else if (name == "any") {
      part.kind = Kind::any;
      if (std::exchange(has_any_, true)) refuse("{any} is given twice");
    } else {
      part.kind = Kind::named;
      part.setting = settings.at(name);
    }
    captures_values_ |= part.kind == Kind::value || part.kind == Kind::named;
    for (std::size_t i = 0; i < settings.size(); ++i) {
      const bool is_meant = part.kind == Kind::value || (part.kind == Kind::named && part.setting == i);
      captures_ranges_ |= is_meant && settings[i].is_range;
      if (!is_meant || part.end == '\0') continue;
      if (const std::string value = value_with(settings[i], part.end); !value.empty())
        refuse("{" + name + "} ends at '" + part.end + "', which is in " + value);
    }
    parts_.push_back(std::move(part));
  }
  const auto captures = std::ranges::count_if(parts_, [](const Part& part) { return part.kind != Kind::text; });
  if (captures > static_cast<std::ptrdiff_t>(FrameCaptures::most)) refuse("there are too many captures");
  if (std::ranges::count(parts_, Kind::value, &Part::kind) > 1) refuse("{value} is given twice");
  if (parts_.empty()) refuse("give the text of the line");
  if (pattern.size() >= FrameHostDescription::longest_line)
    refuse("the line is longer than " + std::to_string(FrameHostDescription::longest_line - 1) + " characters");
}

namespace {

std::size_t find_char(std::string_view line, char end, bool ignores_case) noexcept {
  const auto is_end = [=](char c) { return is_same_text({&c, 1}, {&end, 1}, ignores_case); };
  const auto found = std::ranges::find_if(line, is_end);
  return found == line.end() ? std::string_view::npos : static_cast<std::size_t>(found - line.begin());
}

}  // namespace

bool FrameLine::match(std::string_view line, bool ignores_case, const FrameSettings& settings,
                      FrameCaptures& captures) const noexcept {
  FrameCaptures found;
  found.line = line;
  for (const Part& part : parts_) {
    if (part.kind == Kind::text) {
      if (!is_same_text(line.substr(0, part.text.size()), part.text, ignores_case)) return false;
      line.remove_prefix(part.text.size());
      continue;
    }
    const std::size_t end = part.end == '\0' ? line.size() : find_char(line, part.end, ignores_case);
    if (end == std::string_view::npos) return false;
    const std::string_view text = line.substr(0, end);
    line.remove_prefix(end);
    if (part.kind == Kind::any) {
      found.any = text;
    } else if (part.kind == Kind::setting) {
      found.setting = settings.find(text, ignores_case);
      if (!found.setting) return false;
    } else {
      const std::size_t setting = part.kind == Kind::named ? part.setting : *found.setting;
      const auto value = settings.find_value(setting, text, ignores_case);
      if (value || found.is_allowed) found.value = text;
      found.add(setting, value);
    }
  }
  if (!line.empty()) return false;
  captures = found;
  return true;
}

std::vector<std::string> FrameLine::lines(const FrameSettings& settings) const {
  struct Begun {
    std::string text;
    std::size_t setting = 0;
  };
  constexpr std::size_t most = 1024;
  std::vector<Begun> all = {{}};
  for (const Part& part : parts_) {
    std::vector<Begun> longer;
    for (const Begun& begun : all) {
      const auto add = [&](const std::string& text, std::size_t setting) {
        if (longer.size() < most) longer.push_back({begun.text + text, setting});
      };
      if (part.kind == Kind::text || part.kind == Kind::any)
        add(part.kind == Kind::any ? "1" : part.text, begun.setting);
      else if (part.kind == Kind::setting)
        for (std::size_t i = 0; i < settings.size(); ++i) add(settings[i].name, i);
      else
        for (const std::string& value : settings.examples(part.kind == Kind::named ? part.setting : begun.setting))
          add(value, begun.setting);
    }
    all = std::move(longer);
  }
  std::vector<std::string> lines;
  for (Begun& begun : all) lines.push_back(std::move(begun.text));
  return lines;
}

std::vector<std::string> FrameLine::beginnings(const FrameSettings& settings) const {
  std::vector<std::string> all = {{}};
  for (const Part& part : parts_) {
    if (part.kind != Kind::text && part.kind != Kind::setting) break;
    std::vector<std::string> longer;
    for (const std::string& begun : all) {
      if (part.kind == Kind::text)
        longer.push_back(begun + part.text);
      else
        for (std::size_t i = 0; i < settings.size(); ++i) longer.push_back(begun + settings[i].name);
    }
    all = std::move(longer);
  }
  return all;
}

}  // namespace imud
