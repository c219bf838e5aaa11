#include "emulator/ground/table_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <optional>
#include <system_error>

#include "core/numbers/nearest.hpp"
#include "core/numbers/number_text.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {

std::string Faults::text(std::uint32_t line, std::string_view key, std::string_view what) const {
  if (file_.empty()) return fmt::format("{}: {}", key, what);
  return line > 0 ? fmt::format("{}:{}: {}: {}", file_, line, key, what)
                  : fmt::format("{}: {}: {}", file_, key, what);
}

std::vector<std::string> Faults::by_line() const {
  std::vector<std::size_t> order(all_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [this](std::size_t i) { return lines_[i]; });
  std::vector<std::string> sorted;
  for (const std::size_t i : order) sorted.push_back(all_[i]);
  return sorted;
}

// Returns the value of `key`, also where the table spells the key otherwise (is_same_key); nullptr if it is absent.
const toml::node* TableReader::find(std::string_view key) const {
  if (table_ == nullptr) return nullptr;
  if (const toml::node* found = table_->get(key)) return found;
  for (const auto& [other, value] : *table_)
    if (is_same_key(other.str(), key)) return &value;
  return nullptr;
}

const toml::node* TableReader::node(std::string_view key) {
  known_.emplace(key);
  return find(key);
}

std::uint32_t TableReader::line_of(std::string_view key) const {
  const toml::node* found = find(key);
  return found == nullptr ? line_ : found->source().begin.line;
}

void TableReader::fault(std::string_view key, std::string_view what) {
  faults_.add(line_of(key), path_ + std::string(key), what);
}

void TableReader::warn(std::string_view key, std::string_view what) {
  faults_.warn(line_of(key), path_ + std::string(key), what);
}

std::string file_named(TableReader& table, std::string_view key, const std::string& path) {
  if (path.empty()) return path;
  const std::string& file = table.faults_.file();
  std::string named = path;
  if (!file.empty() && file != "-") {
    const std::filesystem::path beside = std::filesystem::path(file).parent_path() / path;
    std::error_code none;
    if (std::filesystem::exists(beside, none) || !std::filesystem::exists(path, none)) {
      named = beside.string();
      table.resolve(key, named);
    }
  }
  table.faults_.add_named_file(table.path_ + std::string(key), named);
  return named;
}

std::string name_in(TableReader& table, std::string fallback) {
  std::string name = table.text("name", std::move(fallback));
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '\x7F'; };
  const auto is_begin_of_character = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; };
  if (name.empty()) table.fault("name", "give a name that is not empty");
  if (std::ranges::any_of(name, is_control))
    table.fault("name", "has a line feed or another control character; give a name in one line of text");
  if (const auto size = std::ranges::count_if(name, is_begin_of_character); size > std::ptrdiff_t{longest_name})
    table.fault("name", fmt::format("has {} characters; give at most {}", size, longest_name));
  return name;
}

void require(TableReader& table, std::string_view key, std::string_view what_it_is) {
  if (!table.has(key)) table.fault(key, fmt::format("missing; give {}", what_it_is));
}

namespace {

std::optional<double> number(const toml::node& node) {
  const std::optional<double> value = node.value<double>();
  if (!value || !node.is_number() || !std::isfinite(*value)) return std::nullopt;
  return value;
}

// Returns a list of three numbers from `min` to `max`, or, if `or_one`, a number that counts for all of them.
std::optional<Vector3> three(const toml::node& node, bool or_one = false,
                             double min = std::numeric_limits<double>::lowest(),
                             double max = std::numeric_limits<double>::max()) {
  const toml::array* array = node.as_array();
  if (array == nullptr ? !or_one : array->size() != 3) return std::nullopt;
  Vector3 all;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto value = number(array == nullptr ? node : (*array)[i]);
    if (!value || *value < min || *value > max) return std::nullopt;
    all[static_cast<Eigen::Index>(i)] = *value;
  }
  return all;
}

toml::array array_of(const Vector3& v) { return toml::array{v[0], v[1], v[2]}; }

}  // namespace

double TableReader::real(std::string_view key, double fallback, double min, double max) {
  const toml::node* found = node(key);
  resolve(key, fallback);
  if (found == nullptr) return fallback;
  const std::optional<double> value = number(*found);
  if (value && *value >= min && *value <= max) {
    resolve(key, *value);
    return *value;
  }
  fault(key, fmt::format("{}; give a number from {} to {}",
                         value ? fmt::format("{} is out of range", *value) : "not a finite number", min, max));
  return fallback;
}

std::uint64_t TableReader::unsigned_integer(std::string_view key, std::uint64_t fallback, std::uint64_t max) {
  constexpr std::uint64_t largest_of_toml = 0x7FFF'FFFF'FFFF'FFFFULL;
  const auto result = [&](std::uint64_t value) {
    if (value <= largest_of_toml)
      resolve(key, static_cast<std::int64_t>(value));
    else
      resolve(key, std::to_string(value));
    return value;
  };
  const toml::node* found = node(key);
  if (found == nullptr) return result(fallback);
  if (const auto* integer = found->as_integer();
      integer != nullptr && integer->get() >= 0 && static_cast<std::uint64_t>(integer->get()) <= max)
    return result(static_cast<std::uint64_t>(integer->get()));
  if (const auto* text = found->as_string())  // for numbers above the largest of TOML
    if (const auto value = number_in<std::uint64_t>(text->get()); value && *value <= max) return result(*value);
  fault(key, fmt::format("give a whole number from 0 to {}{}", max,
                         max > largest_of_toml ? " (in quotes above 9223372036854775807)" : ""));
  return fallback;
}

std::int64_t utc_s(TableReader& table, std::string_view key, const toml::date_time& fallback, int first_year,
                   int last_year) {
  toml::date_time given = fallback;
  if (const toml::node* found = table.node(key); found != nullptr) {
    const auto* at = found->as_date_time();
    if (at != nullptr && at->get().date.year >= first_year && at->get().date.year <= last_year)
      given = at->get();
    else
      table.fault(key, fmt::format("give a date and time from {} to {}, such as 2025-01-01T00:00:00Z, without quotes",
                                   first_year, last_year));
  }
  table.resolve(key, given);
  const std::chrono::sys_days day = std::chrono::year(given.date.year) / given.date.month / given.date.day;
  const std::int64_t s = std::chrono::duration_cast<std::chrono::seconds>(day.time_since_epoch()).count() +
                         given.time.hour * 3600 + given.time.minute * 60 + given.time.second;
  return s - (given.offset ? given.offset->minutes * 60 : 0);
}

bool TableReader::flag(std::string_view key, bool fallback) {
  const toml::node* found = node(key);
  resolve(key, fallback);
  if (found == nullptr) return fallback;
  if (const auto* value = found->as_boolean()) {
    resolve(key, value->get());
    return value->get();
  }
  fault(key, "give true or false");
  return fallback;
}

std::string TableReader::text(std::string_view key, std::string fallback) {
  const toml::node* found = node(key);
  const bool is_plain = found != nullptr && found->is_value() && !found->is_string();
  const std::string* given = is_plain ? faults_.given_text(found) : nullptr;
  if (const auto* value = found == nullptr ? nullptr : found->as_string())
    fallback = value->get();
  else if (given != nullptr)
    fallback = *given;
  resolve(key, fallback);
  if (found != nullptr && !found->is_string() && given == nullptr) fault(key, "give text in quotes");
  return fallback;
}

std::size_t TableReader::choice(std::string_view key, std::span<const std::string_view> words, std::size_t fallback) {
  const toml::node* found = node(key);
  resolve(key, words[fallback]);
  if (found == nullptr) return fallback;
  if (const auto* value = found->as_string()) {
    const auto at = std::find(words.begin(), words.end(), value->get());
    if (at != words.end()) {
      resolve(key, *at);
      return static_cast<std::size_t>(at - words.begin());
    }
  }
  fault(key, fmt::format("give one of \"{}\"", fmt::join(words, "\", \"")));
  return fallback;
}

Vector3 TableReader::vector3(std::string_view key, const Vector3& fallback) {
  const toml::node* found = node(key);
  const auto value = found == nullptr ? fallback : three(*found);
  if (!value) fault(key, "give three finite numbers, [x, y, z]");
  resolve(key, array_of(value.value_or(fallback)));
  return value.value_or(fallback);
}

Vector3 TableReader::per_axis(std::string_view key, const Vector3& fallback, double min, double max) {
  const toml::node* found = node(key);
  const auto value = found == nullptr ? fallback : three(*found, true, min, max);
  if (!value) fault(key, fmt::format("give three numbers, [x, y, z], from {} to {}, or one for all axes", min, max));
  resolve(key, array_of(value.value_or(fallback)));
  return value.value_or(fallback);
}

std::vector<double> TableReader::numbers(std::string_view key, double min, double max) {
  const toml::node* found = node(key);
  resolve(key, toml::array{});
  if (found == nullptr) return {};
  std::vector<double> all;
  if (const toml::array* array = found->as_array())
    for (const toml::node& element : *array)
      if (const auto value = number(element); value && *value >= min && *value <= max) all.push_back(*value);
  if (!found->is_array() || all.size() != found->as_array()->size()) {
    fault(key, fmt::format("give a list of numbers from {} to {}", min, max));
    return {};
  }
  resolve(key, *found->as_array());
  return all;
}

std::vector<Vector3> rows(TableReader& table, std::string_view key) {
  const toml::node* found = table.node(key);
  table.resolve(key, toml::array{});
  if (found == nullptr) return {};
  std::vector<Vector3> all;
  if (const toml::array* array = found->as_array())
    for (const toml::node& element : *array)
      if (const auto row = three(element)) all.push_back(*row);
  if (!found->is_array() || all.size() != found->as_array()->size()) {
    table.fault(key, "give a list of rows of three finite numbers: [[x, y, z], ..]");
    return {};
  }
  table.resolve(key, *found->as_array());
  return all;
}

Matrix3 TableReader::matrix3(std::string_view key, const Matrix3& fallback, bool diagonal) {
  const auto result = [&](const Matrix3& m) {
    toml::array all;
    for (Eigen::Index i = 0; i < 3; ++i) all.push_back(array_of(m.row(i)));
    resolve(key, std::move(all));
    return m;
  };
  const toml::node* found = node(key);
  if (found == nullptr) return result(fallback);
  const std::string_view shape =
      diagonal ? "give three finite numbers (the diagonal), or three rows of three: [[..], [..], [..]]"
               : "give three rows of three finite numbers: [[..], [..], [..]]";
  const toml::array* rows = found->as_array();
  if (rows != nullptr && rows->size() == 3) {
    Matrix3 m = Matrix3::Zero();
    bool good = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      if (const auto numbers = three((*rows)[i])) {
        m.row(row) = *numbers;
      } else if (const auto value = number((*rows)[i]); value && diagonal) {
        m(row, row) = *value;
      } else {
        good = false;
      }
    }
    const bool mixed =
        (*rows)[0].is_array() != (*rows)[1].is_array() || (*rows)[1].is_array() != (*rows)[2].is_array();
    if (good && !mixed) return result(m);
  }
  fault(key, shape);
  return fallback;
}

TableReader TableReader::child(std::string_view key) {
  const toml::node* found = node(key);
  if (found != nullptr && !found->is_table()) fault(key, fmt::format("give a table, [{}{}]", path_, key));
  return {found == nullptr ? nullptr : found->as_table(), fmt::format("{}{}.", path_, key), line_of(key), faults_,
          *resolved_.insert(key, toml::table{}).first->second.as_table()};
}

std::vector<TableReader> children(TableReader& table, std::string_view key, std::string_view heading) {
  std::vector<TableReader> readers;
  const toml::node* found = table.node(key);
  if (found == nullptr) return readers;
  const toml::array* list = found->as_array();
  if (list == nullptr || !(list->empty() || list->is_array_of_tables())) {
    table.fault(key, fmt::format("give tables, each as [[{}]]", heading));
    return readers;
  }
  toml::array& resolved = *table.resolved_.insert(key, toml::array{}).first->second.as_array();
  for (std::size_t i = 0; i < list->size(); ++i) {
    const toml::table& one = *(*list)[i].as_table();
    readers.push_back(TableReader(&one, fmt::format("{}{}.{}.", table.path_, key, i), one.source().begin.line,
                                  table.faults_, resolved.emplace_back<toml::table>()));
  }
  return readers;
}

void TableReader::finish() {
  if (table_ == nullptr) return;
  for (const auto& [key, value] : *table_) {
    const std::string_view given = key.str();
    const auto is_spelt_otherwise = [this, given](std::string_view known) {
      return is_same_key(known, given) && !table_->contains(known);
    };
    if (known_.contains(given) || std::any_of(known_.begin(), known_.end(), is_spelt_otherwise)) continue;
    const std::string hint =
        suggestion(key.str(), {known_.begin(), known_.end()}, fmt::format("known here: {}", fmt::join(known_, ", ")));
    faults_.add(key.source().begin.line, path_ + std::string(key.str()), fmt::format("unknown key; {}", hint));
  }
}

std::string suggestion(std::string_view word, const std::vector<std::string>& words, const std::string& otherwise) {
  if (const std::string meant = nearest(word, words); !meant.empty())
    return fmt::format("did you mean \"{}\"?", meant);
  return otherwise.empty() ? fmt::format("known: {}", fmt::join(words, ", ")) : otherwise;
}

}  // namespace imud
