#include "protocols/frames/host/frame_requests.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/numbers/nearest.hpp"

namespace imud {
namespace {

std::string title_of(const FrameHostDescription::Request& described) {
  if (described.text) return described.text->text;
  std::string title;
  for (const FrameHostDescription::Text& element : described.layout)
    if (!element.text.starts_with('@')) title += (title.empty() ? "" : " ") + element.text;
  return title;
}

std::span<const std::byte> line_bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

// Returns true if the request may match lines that cannot be listed.
bool is_open(const FrameRequest& request) {
  return request.text->has_any() || request.text->captures_ranges() ||
         (request.text->captures_values() && request.otherwise.is_given());
}

}  // namespace

FrameAnswer::FrameAnswer(const FrameDescription& description, const FrameHostDescription::Answer& answer,
                         const std::string& place, const FrameLine* request, std::size_t request_size,
                         bool is_refusal, const FrameSettings& settings)
    : is_refusal_(is_refusal) {
  if (answer.text) try {
      add_parts(answer.text->text, request, settings);
      if (longest_ > FrameHostDescription::longest_answer)
        throw std::invalid_argument("may have " + std::to_string(longest_) + " bytes, more than " +
                                    std::to_string(FrameHostDescription::longest_answer));
    } catch (const std::invalid_argument& error) {
      throw FrameFaults(description.file, {{answer.text->line, place, error.what()}});
    }
  if (answer.layout.empty()) return;
  bytes_.emplace(description, answer.layout, place, FrameBytes::Role::answer, request_size, settings);
  longest_ = bytes_->size();
}

void FrameAnswer::add_parts(std::string_view text, const FrameLine* request, const FrameSettings& settings) {
  const auto refuse = [](const std::string& fault) { throw std::invalid_argument(fault); };
  const auto longest_value = [&settings](std::size_t setting) {
    std::size_t longest = 0;
    for (const std::string& value : settings.examples(setting)) longest = std::max(longest, value.size());
    return longest;
  };
  if (text.empty()) refuse("must not be empty; leave it out if the unit does not answer");
  while (!text.empty()) {
    Part part;
    if (text.front() != '{') {
      part.text = text.substr(0, text.find('{'));
      text.remove_prefix(part.text.size());
      longest_ += part.text.size();
      parts_.push_back(std::move(part));
      continue;
    }
    const std::size_t end = text.find('}');
    if (end == std::string_view::npos) refuse("{ begins {setting}, {value}, {NAME} of a setting, {any} or {line}");
    const std::string name(text.substr(1, end - 1));
    text.remove_prefix(end + 1);
    std::size_t longest = FrameHostDescription::longest_line;
    if (name == "setting" || name == "value") {
      part.kind = name == "setting" ? Kind::setting : Kind::value;
      if (request == nullptr || (!request->captures_setting() && !(is_refusal_ && part.kind == Kind::value)))
        refuse("the request captures no {setting}; the value of one setting is {NAME}");
      if (!is_refusal_) {
        longest = 0;
        for (std::size_t i = 0; i < settings.size(); ++i)
          longest = std::max(longest, part.kind == Kind::setting ? settings[i].name.size() : longest_value(i));
      }
    } else if (name == "any") {
      part.kind = Kind::any;
      if (request == nullptr || !request->has_any()) refuse("the request captures no {any}");
    } else if (name == "line") {
      part.kind = Kind::line;
      if (request == nullptr) refuse("the request is no line; a byte of it is {NUMBER}, in a list of elements");
    } else {
      part.kind = Kind::named;
      part.setting = settings.at(name);
      longest = longest_value(part.setting);
    }
    longest_ += longest;
    parts_.push_back(std::move(part));
  }
}

std::string_view FrameAnswer::text_of(const Part& part, const FrameCaptures& captures, const FrameAnswering& with,
                                      FrameSettings::Room& room) const noexcept {
  switch (part.kind) {
    case Kind::text:
      return part.text;
    case Kind::setting:
      return captures.setting ? with.settings[*captures.setting].name : std::string_view();
    case Kind::value:
      if (is_refusal_ || !captures.setting) return captures.value;
      return with.settings.text({*captures.setting, with.values[*captures.setting]}, room);
    case Kind::named:
      return with.settings.text({part.setting, with.values[part.setting]}, room);
    case Kind::any:
      return captures.any;
    case Kind::line:
      return captures.line;
  }
  return {};
}

std::size_t FrameAnswer::write(const FrameCaptures& captures, const FrameAnswering& with,
                               std::span<std::byte> out) const noexcept {
  if (bytes_) {
    bytes_->write(with.newest, captures.bytes, with.values, with.settings, out.first(bytes_->size()));
    return bytes_->size();
  }
  std::size_t size = 0;
  for (const Part& part : parts_) {
    FrameSettings::Room room;
    const auto text = std::as_bytes(std::span(text_of(part, captures, with, room)));
    std::ranges::copy(text, out.begin() + static_cast<std::ptrdiff_t>(size));
    size += text.size();
  }
  return size;
}

template <class Act>
void FrameRequests::attempt(std::uint32_t line, const std::string& place, Act act) {
  try {
    act();
  } catch (const FrameFaults& error) {
    faults_.insert(faults_.end(), error.faults.begin(), error.faults.end());
  } catch (const std::invalid_argument& error) {
    faults_.push_back({line, place, error.what()});
  }
}

FrameRequests::FrameRequests(const FrameDescription& description) : settings_(description) {
  const FrameHostDescription& host = description.host;
  faults_ = settings_.faults();
  if (!faults_.empty()) throw FrameFaults(description.file, std::move(faults_));
  delivered_ = settings_.delivered();
  if (!description.baud_setting.empty())
    attempt(1, "line.baud", [&] {
      baud_setting_ = settings_.at(description.baud_setting);
      settings_.require_bauds(*baud_setting_);
    });
  if (host.requests.size() > FrameHostDescription::most_requests)
    faults_.push_back({host.requests.front().line, "request",
                       "there are more than " + std::to_string(FrameHostDescription::most_requests)});
  else
    for (const FrameHostDescription::Request& described : host.requests) add(description, described);
  for (const FrameHostDescription::Unknown& described : host.unknown) add_unknown(description, described);
  if (faults_.empty()) check_overlaps();
  if (!faults_.empty()) throw FrameFaults(description.file, std::move(faults_));
}

void FrameRequests::add(const FrameDescription& description, const FrameHostDescription::Request& described) {
  FrameRequest request;
  request.line = described.line;
  request.title = title_of(described);
  const std::size_t before = faults_.size();
  const std::string place = "request \"" + request.title.substr(0, 40) + "\"";
  attempt(described.line, place, [&] {
    if (described.text)
      request.text.emplace(described.text->text, described.ignores_case, settings_);
    else if (!described.layout.empty())
      request.bytes.emplace(description, described.layout, place, FrameBytes::Role::request, 0, settings_,
                            described.items);
  });
  if (faults_.size() != before) return;
  if (!request.text && !request.bytes) {
    faults_.push_back({described.line, "request", "give a line, bytes, or a layout"});
    return;
  }
  has_lines_ |= request.text.has_value();
  const FrameLine* const line = request.text ? &*request.text : nullptr;
  const std::size_t size = request.bytes ? request.bytes->fixed() : 0;
  const bool captures_values = line != nullptr ? line->captures_values() : request.bytes->captures_values();
  const auto answer = [&](const FrameHostDescription::Answer& one, const char* key, bool is_refusal) {
    FrameAnswer made;
    attempt(described.line, place,
            [&] { made = {description, one, place + ": " + key, line, size, is_refusal, settings_}; });
    longest_answer_ = std::max(longest_answer_, made.longest());
    needs_samples_ |= made.has_quantities();
    return made;
  };
  request.answer = answer(described.answer, "answer", false);
  request.otherwise = answer(described.otherwise, "otherwise", true);
  const auto fault = [&](const char* key, std::string what) {
    faults_.push_back({described.line, place + ": " + key, std::move(what)});
  };
  if (described.otherwise.is_given() && !captures_values)
    fault("otherwise", "the request captures no value that could be wrong");
  if (described.sets_captured && !captures_values)
    fault("set", "the request captures no value; give the values, as {NAME = VALUE}");
  if (!described.sets_captured && captures_values)
    fault("set", "missing: the request has a value of a setting, and changes nothing; give set = true");
  add_effects(description, described, request);
  all_.push_back(std::move(request));
}

void FrameRequests::add_unknown(const FrameDescription& description, const FrameHostDescription::Unknown& described) {
  attempt(described.line, "unknown", [&] {
    const bool is_line = described.layout.empty();
    if (is_line && !has_lines_)
      throw std::invalid_argument("no request is a line; give the layout of the bytes that are answered");
    if (is_line && std::ranges::any_of(unknown_, [](const FrameUnknown& one) { return !one.form; }))
      throw std::invalid_argument("lines have one answer; give a layout, or leave this answer out");
    FrameUnknown made;
    if (!is_line)
      made.form.emplace(description, described.layout, "unknown", FrameBytes::Role::request, 0, settings_);
    if (made.form && made.form->captures_values())
      throw std::invalid_argument("what is unknown sets nothing; give _:N in place of the value");
    const FrameLine any("{any}", false, settings_);
    made.answer = {
        description, described.answer, "unknown: answer", is_line ? &any : nullptr, is_line ? 0 : made.form->fixed(),
        false,       settings_};
    longest_answer_ = std::max(longest_answer_, made.answer.longest());
    needs_samples_ |= made.answer.has_quantities();
    unknown_.push_back(std::move(made));
  });
}

void FrameRequests::add_effects(const FrameDescription& description, const FrameHostDescription::Request& described,
                                FrameRequest& request) {
  const std::string place = "request \"" + request.title.substr(0, 40) + "\": ";
  for (const FrameHostDescription::Choice& choice : described.when)
    attempt(choice.line, place + "when." + choice.setting,
            [&] { request.when.push_back(settings_.condition(choice)); });
  for (const FrameHostDescription::Choice& choice : described.set)
    attempt(choice.line, place + "set." + choice.setting, [&] {
      const std::size_t setting = settings_.at(choice.setting);
      request.set.push_back({setting, settings_.value_at(setting, choice.values.front())});
    });
  request.sets_captured = described.sets_captured;
  request.saves = described.saves;
  request.restores = described.restores;
  request.resets = described.resets;
  request.streams = described.streams;
  request.delay = std::chrono::milliseconds(described.delay_ms);
  if (described.poll.empty()) return;
  std::vector<std::string> names;
  for (const FrameDescription::Message& message : description.messages) names.push_back(message.name);
  const auto found = std::ranges::find(names, described.poll);
  request.poll = static_cast<std::size_t>(found - names.begin());
  if (found != names.end()) return;
  const std::string meant = nearest(described.poll, names);
  faults_.push_back({described.line, place + "poll",
                     "there is no message \"" + described.poll + "\"" +
                         (meant.empty() ? "; give the name of a [[message]]" : "; did you mean \"" + meant + "\"?")});
}

// Returns a text about input that both requests match; empty if there is none.
std::string FrameRequests::overlap(std::size_t first, std::size_t second,
                                   std::span<const std::vector<std::string>> lines) const {
  const FrameRequest &a = all_[first], &b = all_[second];
  if (exclude(a.when, b.when)) return "";
  if (a.bytes && b.bytes) return a.bytes->overlaps(*b.bytes) ? "the same bytes" : "";
  if (a.bytes) return overlap(second, first, lines);
  FrameCaptures captures;
  if (b.bytes) {
    for (std::string line : lines[first]) {
      line += '\r';
      if (b.bytes->match(line_bytes(line), settings_, captures) == FrameLayout::Match::yes && b.accepts(captures))
        return "\"" + line.substr(0, line.size() - 1) + "\"";
    }
    return "";
  }
  if (is_open(a) && is_open(b)) {
    for (const std::string& one : a.text->beginnings(settings_))
      for (const std::string& other : b.text->beginnings(settings_)) {
        const std::size_t both = std::min(one.size(), other.size());
        if (is_same_text(std::string_view(one).substr(0, both), std::string_view(other).substr(0, both), true))
          return "lines that begin with \"" + one.substr(0, both) + "\"";
      }
    return "";
  }
  if (is_open(a)) return overlap(second, first, lines);
  const bool ignores_case = a.text->ignores_case() || b.text->ignores_case();
  for (const std::string& line : lines[first])
    if (b.text->match(line, ignores_case, settings_, captures) && b.accepts(captures)) return "\"" + line + "\"";
  return "";
}

void FrameRequests::check_overlaps() {
  std::vector<std::vector<std::string>> lines;
  for (const FrameRequest& one : all_)
    lines.push_back(one.text ? one.text->lines(settings_) : std::vector<std::string>());
  for (std::size_t j = 1; j < all_.size(); ++j)
    for (std::size_t i = 0; i < j; ++i)
      if (const std::string both = overlap(i, j, lines); !both.empty()) {
        faults_.push_back({all_[j].line, "request \"" + all_[j].title.substr(0, 40) + "\"",
                           "matches " + both + ", which the request \"" + all_[i].title.substr(0, 40) +
                               "\" in line " + std::to_string(all_[i].line) +
                               " matches, too; let them differ in a constant, or leave one of them out"});
        break;
      }
}

std::vector<std::vector<std::byte>> FrameRequests::examples() const {
  std::vector<std::vector<std::byte>> all;
  for (const FrameUnknown& one : unknown_)
    if (one.form) all.push_back(one.form->example(delivered_, settings_));
  for (const FrameRequest& request : all_) {
    if (request.bytes) {
      all.push_back(request.bytes->example(delivered_, settings_));
      continue;
    }
    for (const std::string& line : request.text->lines(settings_)) {
      const auto bytes = line_bytes(line);
      all.emplace_back(bytes.begin(), bytes.end());
      all.back().push_back(std::byte{'\r'});
    }
  }
  return all;
}

}  // namespace imud
