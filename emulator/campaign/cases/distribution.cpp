#include "emulator/campaign/cases/distribution.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "core/numbers/elementary.hpp"
#include "core/numbers/random.hpp"

namespace imud {
namespace {

constexpr double largest_drawn = 1e300;
constexpr double largest_integer = 0x1p53;

// Returns the normal distribution function at x <= 0 by bisection of its inverse, which has the same bits everywhere.
double normal_cdf_below(double x) noexcept {
  auto low = std::bit_cast<std::uint64_t>(1e-300), high = std::bit_cast<std::uint64_t>(0.5);
  while (high - low > 1) {
    const std::uint64_t middle = low + (high - low) / 2;
    (inverse_normal_cdf(std::bit_cast<double>(middle)) < x ? low : high) = middle;
  }
  return std::bit_cast<double>(high);
}

double normal_cdf(double x) noexcept { return x <= 0 ? normal_cdf_below(x) : 1 - normal_cdf_below(-x); }

// Reads a number that must be there.
double required_number(TableReader& table, std::string_view key, double min, std::string_view what_it_is) {
  require(table, key, what_it_is);
  return table.real(key, std::max(min, 0.0), min, largest_drawn);
}

}  // namespace

std::string toml_value(const toml::node& node) {
  if (const auto* text = node.as_string()) return nlohmann::json(text->get()).dump();
  if (const auto* integer = node.as_integer()) return fmt::to_string(integer->get());
  if (const auto* flag = node.as_boolean()) return fmt::to_string(flag->get());
  if (const auto* real = node.as_floating_point()) {
    std::string text = fmt::to_string(real->get());
    return text.find_first_not_of("-0123456789") == text.npos ? text + ".0" : text;
  }
  if (const auto* array = node.as_array()) {
    std::vector<std::string> items;
    for (const toml::node& item : *array) items.push_back(toml_value(item));
    return fmt::format("[{}]", fmt::join(items, ", "));
  }
  if (node.is_table()) throw std::invalid_argument("give no table in a list");
  std::ostringstream text;  // a date, or a time
  node.visit([&](const auto& value) {
    if constexpr (toml::is_date<decltype(value)> || toml::is_time<decltype(value)> ||
                  toml::is_date_time<decltype(value)>)
      text << value;
  });
  return text.str();
}

void Distribution::read_bounds(TableReader& table, double smallest) {
  from_ = required_number(table, "from", smallest, "the least value");
  to_ = required_number(table, "to", smallest, "the greatest value");
  if (table.has("from") && table.has("to") && !(from_ < to_)) table.fault("to", "must be above from");
}

void Distribution::truncate(TableReader& table) {
  const double low = (from_ - middle_) / spread_, high = (to_ - middle_) / spread_;
  is_mirrored_ = low > 0;
  lower_ = normal_cdf(is_mirrored_ ? -high : low);
  upper_ = normal_cdf(is_mirrored_ ? -low : high);
  if (!(upper_ - lower_ > 1e-290))
    table.fault("from", "the values from here to `to` lie too far from the mean: none would ever be drawn");
}

Distribution::Distribution(TableReader& table) {
  static constexpr auto words = std::to_array<Word<Kind>>({{Kind::normal, "normal"},
                                                           {Kind::truncated_normal, "truncated_normal"},
                                                           {Kind::log_normal, "log_normal"},
                                                           {Kind::uniform, "uniform"},
                                                           {Kind::log_uniform, "log_uniform"},
                                                           {Kind::uniform_integer, "uniform_integer"},
                                                           {Kind::exponential, "exponential"},
                                                           {Kind::triangular, "triangular"},
                                                           {Kind::choice, "choice"}});
  constexpr double tiny = 1e-300;
  const std::string word = table.text("distribution", "");
  std::vector<std::string> known;
  for (const auto& [kind, name] : words) known.emplace_back(name);
  const auto found = std::ranges::find(words, word, &Word<Kind>::word);
  if (found == words.end()) {
    if (!table.has("distribution"))
      table.fault("distribution", fmt::format("missing; give one of \"{}\"", fmt::join(known, "\", \"")));
    else if (is_text(table, "distribution"))
      table.fault("distribution", fmt::format("there is no \"{}\"; {}", word, suggestion(word, known)));
    return;
  }
  kind_ = found->value;
  constexpr std::size_t most_components = 100;
  components_ = table.unsigned_integer("components", 0, most_components);
  switch (kind_) {
    case Kind::normal:
    case Kind::truncated_normal:
      middle_ = table.real("mean", 0, -largest_drawn, largest_drawn);
      spread_ = required_number(table, "standard_deviation", tiny, "the standard deviation, above 0");
      if (kind_ == Kind::normal) break;
      read_bounds(table, -largest_drawn);
      if (table.has("from") && table.has("to") && table.has("standard_deviation") && from_ < to_) truncate(table);
      break;
    case Kind::log_normal:
      middle_ = required_number(table, "median", tiny, "the median, above 0");
      spread_ = required_number(table, "standard_deviation_of_log", tiny,
                                "the standard deviation of the natural logarithm, above 0");
      break;
    case Kind::uniform:
      read_bounds(table, -largest_drawn);
      break;
    case Kind::log_uniform:
      read_bounds(table, tiny);
      break;
    case Kind::uniform_integer:
      read_bounds(table, -largest_integer);
      if (from_ != std::floor(from_) || to_ != std::floor(to_) || to_ - from_ >= largest_integer)
        table.fault("from", "give whole numbers as from and to, less than 2^53 apart");
      break;
    case Kind::exponential:
      middle_ = required_number(table, "mean", tiny, "the mean, above 0");
      break;
    case Kind::triangular:
      read_bounds(table, -largest_drawn);
      middle_ = required_number(table, "mode", -largest_drawn, "the most probable value");
      if (table.has("mode") && (middle_ < from_ || middle_ > to_))
        table.fault("mode", "must lie between from and to");
      break;
    case Kind::choice: {
      const toml::node* values = table.node("values");
      const toml::array* list = values == nullptr ? nullptr : values->as_array();
      if (list == nullptr || list->empty()) {
        table.fault("values", "give a list of the values, which are equally probable");
        break;
      }
      try {
        for (const toml::node& value : *list) choices_.push_back(toml_value(value));
      } catch (const std::invalid_argument& error) {
        table.fault("values", error.what());
      }
      break;
    }
  }
  table.finish();
}

double Distribution::quantile(double p) const noexcept {
  switch (kind_) {
    case Kind::normal:
      return middle_ + spread_ * inverse_normal_cdf(p);
    case Kind::truncated_normal: {
      const double share = lower_ + (is_mirrored_ ? 1 - p : p) * (upper_ - lower_);
      if (!(share < 1)) return to_;
      const double deviate = inverse_normal_cdf(share);
      return std::clamp(middle_ + spread_ * (is_mirrored_ ? -deviate : deviate), from_, to_);
    }
    case Kind::log_normal:
      return middle_ * elementary::exp(spread_ * inverse_normal_cdf(p));
    case Kind::uniform:
      return std::clamp(from_ + p * (to_ - from_), from_, to_);
    case Kind::log_uniform:
      return std::clamp(elementary::exp(elementary::log(from_) + p * (elementary::log(to_) - elementary::log(from_))),
                        from_, to_);
    case Kind::uniform_integer:
      return std::clamp(from_ + std::floor(p * (to_ - from_ + 1)), from_, to_);
    case Kind::exponential:
      return -middle_ * elementary::log(1 - p);
    case Kind::triangular: {
      const double width = to_ - from_, rise = middle_ - from_, fall = to_ - middle_;
      // The square of a width may exceed the largest number.
      if (p * width < rise) return from_ + std::sqrt(p * (rise / width)) * width;
      return to_ - std::sqrt((1 - p) * (fall / width)) * width;
    }
    case Kind::choice: {
      const auto count = static_cast<double>(choices_.size());
      return std::min(std::floor(p * count), count - 1);
    }
  }
  return 0;
}

std::string Distribution::text(double p) const {
  const double value = quantile(p);
  return kind_ == Kind::choice ? choices_[static_cast<std::size_t>(value)] : fmt::to_string(value);
}

}  // namespace imud
