#include "tools/find/found_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "protocols/frames/layout/frame_escape.hpp"
#include "protocols/wire/byte_text.hpp"
#include "tools/find/frame_checks.hpp"
#include "tools/find/handled_frames.hpp"

namespace imud {
namespace {

using Stream = std::span<const std::byte>;

std::string bytes_text(const FrameCheck::Range& range) {
  const auto [begin, end] = range;
  return end - begin == 1 ? fmt::format("byte {}", begin) : fmt::format("bytes {}-{}", begin, end - 1);
}

std::string order_text(std::size_t size, bool is_big) { return size == 1 ? "" : is_big ? " be" : " le"; }

std::string power_text(double log2) { return fmt::format("1 in 2^{:.0f}", std::max(0.0, -log2)); }

// The unit of a clock: if the step is the mean of two, it is measured, and a decimal figure near it is the unit.
double clock_unit(double measured_s, double step) {
  if (step == std::round(step)) return measured_s;
  constexpr double near = 2e-3;
  const double decade = std::pow(10, std::floor(std::log10(measured_s * (1 + near))));
  for (const double figure : {1.0, 2.0, 2.5, 4.0, 5.0, 8.0})
    if (std::abs(measured_s / (figure * decade) - 1) < near) return figure * decade;
  return measured_s;
}

// An element of a layout: the number of its bytes, and its text.
struct Element {
  std::size_t size = 0;
  std::string text;
};

// Writes one message.
class MessageText {
 public:
  MessageText(const FoundFrames& found, std::size_t index, Stream stream, const DescriptionText& text)
      : found_(found), message_(found.messages[index]), index_(index), text_(text), stream_(stream) {
    std::size_t most = 0;
    for (const FoundMessage& message : found.messages) most = std::max(most, message.frames.size());
    divider_ = std::max(1.0, std::round(static_cast<double>(most) / static_cast<double>(message_.frames.size())));
    is_fixed_ = fixed_bytes();
    frame_ = good_frame();
  }

  // `own` has the checks without a name, which the file describes; their names are added.
  std::string write(std::vector<CrcParameters>& own) {
    for (std::size_t i = 0; i < message_.checks.size(); ++i) add_check(message_.checks[i], own);
    if (message_.length_field) add_length(*message_.length_field);
    add_counters();
    add_fields();
    add_constants();
    std::string out = remarks_;
    out += fmt::format("[[message]]\nname = \"message {}\"\n", index_ + 1);
    if (divider_ > 1) out += fmt::format("divider = {:.0f}\n", divider_);
    out += "layout = [\n";
    for (std::size_t at = 0; at <= message_.length;) {
      if (labels_.contains(at)) out += fmt::format("  \"@byte{}\",\n", at);
      if (at == message_.length) break;
      const auto element = elements_.find(at);
      if (element != elements_.end()) {
        out += fmt::format("  \"{}\",\n", element->second.text);
        at += element->second.size;
        continue;
      }
      std::size_t end = at + 1;
      const auto goes_on = [&] {
        return end < message_.length && !elements_.contains(end) && !labels_.contains(end);
      };
      // Bytes that are always the same stand apart.
      if (constants_from(at) > 1)
        end = std::min(end + constants_from(at) - 1, message_.length);
      else
        while (goes_on() && constants_from(end) < 2) ++end;
      for (std::size_t i = at + 1; i < end; ++i)
        if (elements_.contains(i) || labels_.contains(i)) end = i;
      out += fmt::format("  \"_:{}\",", end - at) + constant_remark(at, end) + "\n";
      at = end;
    }
    out += "]\n";
    if (frame_.empty()) return out;
    out += "test_frame = \"" + hex_text(frame_) + "\"\n";
    if (!values_.empty()) out += "test_values = {" + values_ + "}\n";
    return out;
  }

 private:
  void remark(const std::string& line) { remarks_ += "# " + line + "\n"; }

  bool is_free(std::size_t at, std::size_t size) const {
    return std::ranges::all_of(
        elements_, [&](const auto& one) { return one.first >= at + size || one.first + one.second.size <= at; });
  }
  void add(std::size_t at, std::size_t size, std::string element) {
    if (is_free(at, size)) elements_[at] = {size, std::move(element)};
  }
  void add_value(const std::string& name, double value) {
    values_ += fmt::format("{}{} = {}", values_.empty() ? "" : ", ", name, value);
  }
  // Adds the value of a field in the test frame. A product of numbers with few digits is written with few digits.
  void add_value(const FoundField& field) {
    const double value = (field.is_negative ? -1 : 1) * (field.lsb_value * value_in(frame_, field.at, field.type));
    constexpr std::size_t few_bytes = 4;
    if (field.type.is_float() || field.type.bytes > few_bytes)
      add_value(field.name, value);
    else
      values_ += fmt::format("{}{} = {:.13g}", values_.empty() ? "" : ", ", field.name, value);
  }

  // Returns a frame whose checks all agree, from the middle of the stream; empty if there is no such frame.
  Stream good_frame() const {
    const auto frames = frames_of(message_, stream_);
    const FrameChecks checks(message_);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const Stream frame = frames[(i + frames.size() / 2) % frames.size()];
      bool is_good = checks.hold(frame);
      for (std::size_t at = 0; at < message_.length; ++at)
        is_good = is_good && (!is_fixed_[at] || frame[at] == message_.usual[at]);
      if (is_good) return frame;
    }
    return {};
  }

  void add_check(const FoundCheck& check, std::vector<CrcParameters>& own) {
    const FoundCheck::Form& form = check.forms.front();
    std::string name = form.name;
    if (form.own) {
      const auto is_same = [&](const CrcParameters& one) {
        return one.width == form.own->width && one.poly == form.own->poly && one.init == form.own->init &&
               one.xorout == form.own->xorout && one.refin == form.own->refin && one.refout == form.own->refout;
      };
      const auto known = std::ranges::find_if(own, is_same);
      name = fmt::format("own{}", known - own.begin() + 1);
      if (known == own.end()) own.push_back(*form.own);
    }
    std::string ranges, bytes;
    for (const auto& [begin, end] : check.ranges_of(form)) {
      if (begin == end) continue;
      labels_.insert(begin);
      ranges += fmt::format("{}@byte{}..", ranges.empty() ? "" : ",", begin);
      if (end == message_.length)
        ranges += "@";
      else if (end != check.at) {
        ranges += fmt::format("@byte{}", end);
        labels_.insert(end);
      }
      bytes += (bytes.empty() ? "" : " and ") + bytes_text({begin, end});
    }
    std::string element = "check:" + name + ":" + ranges;
    if (!form.extra.empty()) element += ":+" + hex_text(form.extra);
    add(check.at, check.size, element + order_text(check.size, check.is_big));
    remark(fmt::format("{}: {} of {}{}; {} of {} frames agree, by chance {}; {} different frames decide",
                       bytes_text({check.at, check.at + check.size}), name, bytes,
                       form.extra.empty() ? "" : " and then of " + hex_text(form.extra), check.agreeing,
                       check.compared, power_text(check.chance_log2), check.deciding));
    constexpr double seldom_log2 = -10;
    if (check.chance_log2 > seldom_log2)
      remark("  it is the check of the other messages: here, too few bytes change for a search");
    if (form.own)
      remark(fmt::format("  {}: {}", name,
                         form.own->init == 0 && form.own->xorout == 0
                             ? "the generator is certain"
                             : "the generator is certain; initial value and final XOR are one pair of those that are "
                               "right for this length; frames of another length would decide"));
    constexpr std::size_t most_told = 6;
    std::string others;
    for (std::size_t i = 1; i < check.forms.size() && i < most_told; ++i) {
      const FoundCheck::Form& other = check.forms[i];
      others += fmt::format("{}{} from byte {}", i == 1 ? "" : ", ", other.name, other.begin);
    }
    if (!others.empty())
      remark(
          fmt::format("  as good: {}{}; frames in which the bytes between change, or have other values, would decide",
                      others, check.forms.size() > most_told ? ", ..." : ""));
  }

  void add_length(const FoundLength& length) {
    labels_.insert(length.from);
    std::string range = fmt::format("@byte{}..@", length.from);
    if (length.to != message_.length) {
      range += fmt::format("byte{}", length.to);
      labels_.insert(length.to);
    }
    if (length.plus != 0) range += fmt::format("{:+}", length.plus);
    if (is_free(length.at, length.size)) {
      add(length.at, length.size,
          fmt::format("length:u{}:{}{}", 8 * length.size, range, order_text(length.size, length.is_big)));
      remark(fmt::format("{}: {} the length of {}", bytes_text({length.at, length.at + length.size}),
                         length.is_certain ? "are" : "may be (all frames are as long; another length would decide)",
                         bytes_text({length.from, length.to})));
    }
  }

  void add_counters() {
    // One field has the counter of the frames; the other fields have a phase that nothing here explains.
    const FoundCounter* counter = nullptr;
    for (const FoundCounter& one : message_.counters)
      if (one.is_counter() && (counter == nullptr || one.size > counter->size)) counter = &one;
    bool has_clock = false;
    for (const FoundCounter& one : message_.counters) {
      if (!is_free(one.at, one.size)) continue;
      const std::string place = bytes_text({one.at, one.at + one.size});
      const std::string type = fmt::format("{}{}", one.is_float ? "f" : "u", 8 * one.size);
      const std::string modulus = one.modulus == 0 ? "" : fmt::format(", modulo {}", one.modulus);
      if (&one == counter) {
        remark(
            fmt::format("{}: {} counts the frames{} ({:.1f} % of the steps)", place, type, modulus, 100 * one.share));
        add(one.at, one.size,
            "alive_counter" + (one.modulus == 0 ? "" : fmt::format("%{}", one.modulus)) + ":" + type +
                order_text(one.size, one.is_big));
        if (!frame_.empty())
          add_value("alive_counter", static_cast<double>(number_at(frame_, one.at, one.size, one.is_big)));
        continue;
      }
      const std::string unit = add_clock(one, type, has_clock);
      remark(fmt::format("{}: {}{} rises by {:.6g}{} ({:.1f} % of the steps): {}", place, type,
                         order_text(one.size, one.is_big), one.step, modulus, 100 * one.share, unit));
    }
  }

  // Adds a clock whose unit is known, if there is no clock yet. Returns a text about the clock's unit.
  std::string add_clock(const FoundCounter& one, const std::string& type, bool& has_clock) {
    const double rate_hz = text_.rate_hz / divider_;
    if (!(rate_hz > 0)) return fmt::format("a clock, of {:.6g} units a frame; --rate-hz gives the unit", one.step);
    const double lsb_s = clock_unit(1 / (rate_hz * one.step), one.step), lsb_ns = std::round(1e9 * lsb_s);
    std::string unit = fmt::format("a clock in units of {:.4g} s", lsb_s);
    const bool is_whole = lsb_ns >= 1 && std::abs(1e9 * lsb_s - lsb_ns) < 1e-3;
    const bool is_second = std::abs(lsb_s - 1) < 1e-3;
    if (has_clock || (one.is_float ? !is_second : !is_whole)) return unit;
    has_clock = true;
    const std::string name = one.is_float ? "time_s" : "time_ns";
    const std::string modulus = one.modulus == 0 ? "" : fmt::format("%{}", static_cast<double>(one.modulus) * lsb_ns);
    add(one.at, one.size,
        name + modulus + ":" + type + (one.is_float || lsb_ns == 1 ? "" : fmt::format("*{}", lsb_ns)) +
            order_text(one.size, one.is_big));
    if (frame_.empty()) return unit;
    if (one.is_float)
      add_value(name, float_at(frame_, one.at, one.size, one.is_big));
    else
      add_value(name, static_cast<double>(number_at(frame_, one.at, one.size, one.is_big)) * lsb_ns);
    return unit;
  }

  void add_fields() {
    for (const FoundField& field : message_.fields) {
      const bool is_unsigned = field.type.format == FrameNumber::Format::unsigned_integer;
      const std::string type = fmt::format("{}{}",
                                           field.type.is_float() ? "f"
                                           : is_unsigned         ? "u"
                                                                 : "i",
                                           8 * field.type.bytes);
      add(field.at, field.type.bytes,
          fmt::format("{}{}:{}{}{}{}", field.is_negative ? "-" : "", field.name, type,
                      field.lsb == "1" ? "" : "*" + field.lsb,
                      field.offset == 0 ? "" : fmt::format("{:+}", field.offset),
                      order_text(field.type.bytes, field.type.is_big)));
      if (!frame_.empty()) add_value(field);
    }
    for (const std::string& note : message_.notes) remark(note);
  }

  // The header, and the bytes behind it that distinguish this message from the others.
  std::vector<bool> fixed_bytes() const {
    std::vector<bool> is_fixed(message_.length);
    for (std::size_t at = 0; at < message_.header; ++at) is_fixed[at] = true;
    for (std::size_t at = 0; at < message_.length; ++at) {
      bool differs = false, are_constant = true;
      std::size_t alike = 0;
      for (const FoundMessage& other : found_.messages) {
        are_constant = are_constant && at < other.length && other.constant[at];
        differs |= are_constant && other.usual[at] != message_.usual[at];
        alike += are_constant && other.usual[at] == message_.usual[at];
      }
      if (!are_constant) break;
      if (differs) is_fixed[at] = true;
      if (differs && alike == 1) break;  // what follows may be data
    }
    return is_fixed;
  }

  void add_constants() {
    for (std::size_t at = 0; at < message_.length; ++at) {
      if (!is_fixed_[at] || !is_free(at, 1)) continue;
      std::size_t end = at + 1;
      while (end < message_.length && is_fixed_[end] && is_free(end, 1) && !labels_.contains(end)) ++end;
      add(at, end - at, hex_text(Stream(message_.usual).subspan(at, end - at)));
      at = end - 1;
    }
  }

  std::size_t constants_from(std::size_t at) const {
    std::size_t end = at;
    while (end < message_.length && message_.constant[end]) ++end;
    return end - at;
  }

  std::string constant_remark(std::size_t begin, std::size_t end) const {
    for (std::size_t at = begin; at < end; ++at)
      if (!message_.constant[at]) return "";
    constexpr std::size_t most = 16;
    return fmt::format("  # always {}{}",
                       hex_text(Stream(message_.usual).subspan(begin, std::min(end - begin, most))),
                       end - begin > most ? " ..." : "");
  }

  const FoundFrames& found_;
  const FoundMessage& message_;
  std::size_t index_;
  const DescriptionText& text_;
  Stream stream_;
  Stream frame_;
  std::vector<bool> is_fixed_;  // bytes that are given as constants
  double divider_ = 1;
  std::map<std::size_t, Element> elements_;
  std::set<std::size_t> labels_;
  std::string remarks_, values_;
};

}  // namespace

std::string describe_frames(const FoundFrames& found, Stream stream, const DescriptionText& text) {
  std::string messages;
  std::vector<CrcParameters> own;
  for (std::size_t i = 0; i < found.messages.size(); ++i) {
    const FoundMessage& message = found.messages[i];
    messages += fmt::format("\n# {} bytes: {} frames\n", message.length, message.frames.size());
    if (message.checks.empty())
      messages += "# no check was found: what a decoder takes for a frame may be another one, or damaged\n";
    messages += MessageText(found, i, stream, text).write(own);
  }
  std::string out = fmt::format(
      "# The beginning of a description, from {}: {:.1f} % of {} bytes are in frames. Give name and document, and\n"
      "# the meaning of what is _:N; then compare `imud check`'s table with what is known of the unit.\n",
      text.source, 100 * found.coverage, stream.size());
  if (!found.other_begins.empty()) {
    out += "# Where a frame begins is not certain: as good, or nearly, are";
    constexpr std::size_t most = 4;
    for (std::size_t i = 0; i < std::min(most, found.other_begins.size()); ++i) {
      const std::ptrdiff_t later = found.other_begins[i];
      out += fmt::format("{} {} {}", i == 0 ? "" : ",", std::abs(later), later < 0 ? "earlier" : "later");
    }
    out += std::string(found.other_begins.size() > most ? ", ..." : "") + " (bytes).\n";
  }
  for (const std::string& line : text.remarks) out += "# " + line + "\n";
  out += "frame_version = 1\nname = \"unknown\"\n";
  if (text.escape != FrameEscape::none) out += fmt::format("escape = \"{}\"\n", escape_name(text.escape));
  for (std::size_t i = 0; i < own.size(); ++i) {
    const CrcParameters& one = own[i];
    out += fmt::format(
        "\n[check.own{}]\nwidth = {}\npoly = 0x{:X}\ninit = 0x{:X}\nxorout = 0x{:X}\nrefin = {}\nrefout = {}\n",
        i + 1, one.width, one.poly, one.init, one.xorout, one.refin, one.refout);
  }
  return out + messages;
}

}  // namespace imud
