#include "protocols/frames/layout/frame_parts.hpp"

#include <cmath>
#include <stdexcept>

#include "core/numbers/nearest.hpp"
#include "core/numbers/number_text.hpp"
#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

// Reads a number, a fraction such as 600/2^20, or a power of two from the beginning of the text, and removes it.
double take_fraction(std::string_view& text, std::string_view what) {
  const auto take = [&] {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{})
      refuse_element("the " + std::string(what) + " must be a number, such as 0.01, 1/62500 or 600/2^20");
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    if (!text.starts_with('^')) return value;
    text.remove_prefix(1);
    int exponent = 0;
    const auto [last, fault] = std::from_chars(text.data(), text.data() + text.size(), exponent);
    if (fault != std::errc{} || value != 2 || std::abs(exponent) > 1000)
      refuse_element("a power in the " + std::string(what) + " must be one of two, such as 2^20 or 2^-16");
    text.remove_prefix(static_cast<std::size_t>(last - text.data()));
    return std::ldexp(1.0, exponent);
  };
  double value = take();
  if (text.starts_with('/')) {
    text.remove_prefix(1);
    value /= take();
  }
  if (!std::isfinite(value)) refuse_element("the " + std::string(what) + " must be a finite number");
  return value;
}

// Reads QUANTITY_UNIT[%MODULUS].
FrameSource remainder_in(std::string_view text) {
  const std::size_t percent = text.find('%');
  const std::string_view name = text.substr(0, percent);
  auto source = find_frame_source(name);
  if (!source) refuse_element(unknown_frame_source(name));
  if (percent == text.npos) return *source;
  const auto modulus = finite_number_in(text.substr(percent + 1));
  if (!modulus || *modulus <= 0) refuse_element("the modulus after % must be a positive number, as in yaw_deg%360");
  if (source->kind == FrameSource::Kind::status) refuse_element("a bit of the status has no modulus");
  source->modulus = *modulus;
  return *source;
}

}  // namespace

std::string in_quotes(std::string_view text) { return "\"" + std::string(text) + "\""; }

FrameSource source_in(std::string_view text) {
  const std::size_t bar = text.find('|');
  if (bar == text.npos) return remainder_in(text);
  FrameSource source = remainder_in(text.substr(0, bar));
  const auto otherwise = number_in<double>(text.substr(bar + 1));
  if (source.kind == FrameSource::Kind::status && !otherwise) {
    const FrameSource other = source_in(text.substr(bar + 1));
    if (other.kind != source.kind)
      refuse_element("only bits of the status are joined by |, as in not_valid|starting");
    source.bits |= other.bits;
    source.name = text;
    return source;
  }
  if (!otherwise || !std::isfinite(*otherwise))
    refuse_element("after | comes the number that is sent without a solution of the unit's own, as in gnss_fix|1");
  if (source.kind != FrameSource::Kind::quantity || source.in.quantity->kind != MeasuredQuantity::Kind::number ||
      source.modulus != 0)
    refuse_element("only a quantity that is a number, without a modulus, has another one after |");
  source.otherwise = source.in.factor * *otherwise + source.in.offset;
  return source;
}

bool is_counting(const FrameSource& source) {
  return source.kind == FrameSource::Kind::alive_counter || source.kind == FrameSource::Kind::frame_counter ||
         (source.kind == FrameSource::Kind::quantity &&
          (source.in.quantity->kind == MeasuredQuantity::Kind::counter ||
           source.in.quantity->kind == MeasuredQuantity::Kind::status));
}

void check_modulus(const FrameSource& source) {
  if (is_counting(source) && (source.modulus != std::floor(source.modulus) || source.modulus > 0x1p53))
    refuse_element("the modulus of a counter must be a whole number");
}

FrameElement::Range range_in(std::string_view text) {
  const std::size_t dots = text.find("..");
  const auto label = [&](std::string_view name) {
    if (!name.starts_with('@'))
      refuse_element(in_quotes(text) + ": a range is @FROM..@TO, of labels, or @FROM..@ up to the end");
    return std::string(name.substr(1));
  };
  if (dots == text.npos)
    refuse_element(in_quotes(text) + ": a range is @FROM..@TO, of labels, or @FROM..@ up to the end");
  FrameElement::Range range;
  range.from = label(text.substr(0, dots));
  const std::string_view to = text.substr(dots + 2);
  if (!to.empty()) {
    range.to = label(to);
    range.is_to_end = range.to.empty();
  }
  if (range.from.empty()) refuse_element(in_quotes(text) + ": give the label at which the range begins");
  return range;
}

std::pair<double, double> take_scale(std::string_view& text) {
  double lsb = 1, offset = 0;
  if (text.starts_with('*')) {
    text.remove_prefix(1);
    lsb = take_fraction(text, "LSB after *");
    if (lsb == 0) refuse_element("the LSB after * must not be 0");
  }
  if (text.starts_with('+') || text.starts_with('-')) {
    const double sign = text.front() == '-' ? -1 : 1;
    text.remove_prefix(1);
    offset = sign * take_fraction(text, "offset");
  }
  return {lsb, offset};
}

std::string_view take_condition(std::string_view& text) noexcept {
  const std::string_view condition = text.substr(0, text.find('?'));
  if (condition.size() == text.size() || condition.find_first_of(" \":@{") != condition.npos) return {};
  text = trim(text.substr(condition.size() + 1));
  return condition;
}

std::string label_in(std::string_view text) {
  const std::string_view label = text.substr(1);
  constexpr std::string_view letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
  if (label.empty() || label.find_first_not_of(letters) != label.npos)
    refuse_element("a label is @ and a name of letters, digits and underscores");
  return std::string(label);
}

FrameCheck check_named(std::string_view name, std::span<const FrameDescription::Check> own) {
  if (auto check = FrameCheck::find(name, own)) return *std::move(check);
  const std::string meant = nearest(name, FrameCheck::names(own));
  refuse_element("there is no check " + in_quotes(name) + "; " +
                 (meant.empty() ? "" : "did you mean " + in_quotes(meant) + "? ") +
                 "imud list checks prints all; of a wrong one the test_frame says which are right");
}

}  // namespace imud
