#include "protocols/frames/frame_requests.hpp"

#include <algorithm>
#include <stdexcept>

namespace imud {

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
  const auto longest_value = [](const FrameSettings::Setting& setting) {
    std::size_t longest = 0;
    for (const std::string& value : setting.values) longest = std::max(longest, value.size());
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
    std::size_t longest = FrameHostDescription::longest_request;
    if (name == "setting" || name == "value") {
      part.kind = name == "setting" ? Kind::setting : Kind::value;
      if (request == nullptr || (!request->captures_setting() && !(is_refusal_ && part.kind == Kind::value)))
        refuse("the request captures no {setting}; the value of one setting is {NAME}");
      if (!is_refusal_) {
        longest = 0;
        for (std::size_t i = 0; i < settings.size(); ++i)
          longest =
              std::max(longest, part.kind == Kind::setting ? settings[i].name.size() : longest_value(settings[i]));
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
      longest = longest_value(settings[part.setting]);
    }
    longest_ += longest;
    parts_.push_back(std::move(part));
  }
}

std::string_view FrameAnswer::text_of(const Part& part, const FrameCaptures& captures,
                                      const FrameAnswering& with) const noexcept {
  switch (part.kind) {
    case Kind::text:
      return part.text;
    case Kind::setting:
      return captures.setting ? with.settings[*captures.setting].name : std::string_view();
    case Kind::value:
      if (is_refusal_ || !captures.setting) return captures.value;
      return with.settings[*captures.setting].values[with.values[*captures.setting]];
    case Kind::named:
      return with.settings[part.setting].values[with.values[part.setting]];
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
    bytes_->write({with.newest}, captures.bytes, with.values, with.settings, out.first(bytes_->size()));
    return bytes_->size();
  }
  std::size_t size = 0;
  for (const Part& part : parts_) {
    const auto text = std::as_bytes(std::span(text_of(part, captures, with)));
    std::ranges::copy(text, out.begin() + static_cast<std::ptrdiff_t>(size));
    size += text.size();
  }
  return size;
}

}  // namespace imud
