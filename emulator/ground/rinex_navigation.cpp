#include "emulator/ground/rinex_navigation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/gps_time.hpp"
#include "core/numbers/number_text.hpp"

namespace imud {
namespace rinex {  // its names are short ones
namespace {

// A number of a record that is read: its name in the tables of the format, its line after the first one, its place in
// the line, and its range.
struct Field {
  std::string_view name;
  int line, place;
  double min, max;
};
enum Number : std::size_t {
  crs,
  delta_n,
  m0,
  cuc,
  e,
  cus,
  root_a,
  toe,
  cic,
  omega0,
  cis,
  i0,
  crc,
  omega,
  omega_dot,
  idot,
  gps_week,
  sv_health
};
constexpr double angle = 7, harmonic = 1e-3, distance = 1e4, rate = 1e-6;  // rad, rad, m, rad/s
constexpr Field fields[] = {{"Crs", 1, 1, -distance, distance},
                            {"Delta n", 1, 2, -rate, rate},
                            {"M0", 1, 3, -angle, angle},
                            {"Cuc", 2, 0, -harmonic, harmonic},
                            {"e", 2, 1, 0, 0.1},
                            {"Cus", 2, 2, -harmonic, harmonic},
                            {"sqrt(A)", 2, 3, 2000, 1e4},
                            {"Toe", 3, 0, 0, 604'799},
                            {"Cic", 3, 1, -harmonic, harmonic},
                            {"OMEGA0", 3, 2, -angle, angle},
                            {"Cis", 3, 3, -harmonic, harmonic},
                            {"i0", 4, 0, 0, 3.2},
                            {"Crc", 4, 1, -distance, distance},
                            {"omega", 4, 2, -angle, angle},
                            {"OMEGA DOT", 4, 3, -rate, rate},
                            {"IDOT", 5, 0, -rate, rate},
                            {"GPS week", 5, 2, 0, 1e4},
                            {"SV health", 6, 1, 0, 511}};
constexpr std::size_t field_count = std::size(fields);
using Numbers = std::array<double, field_count>;
constexpr int record_lines = 7;  // of a record of GPS, after its first

struct Columns {
  std::pair<int, int> satellite, epoch[6];  // begin and width: year, month, day, hour, minute, second
  int numbers;                              // where the first one of a line that follows begins
};
constexpr int number_width = 19;
constexpr Columns columns_of_2{{0, 2}, {{3, 2}, {6, 2}, {9, 2}, {12, 2}, {15, 2}, {17, 5}}, 3};
constexpr Columns columns_of_3{{1, 2}, {{4, 4}, {9, 2}, {12, 2}, {15, 2}, {18, 2}, {21, 2}}, 4};
constexpr int label_column = 60;

// Returns these columns of a line without blanks around them; empty if the line ends before.
std::string_view cut(std::string_view line, int begin, int width) {
  std::string_view text = line.substr(std::min(line.size(), static_cast<std::size_t>(begin)));
  text = text.substr(0, static_cast<std::size_t>(width));
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

// Returns a number of Fortran, whose exponent may begin with D; none if the text is not one, or outside its range.
std::optional<double> fortran_number(std::string_view text, double min, double max) {
  if (text.starts_with('+')) text.remove_prefix(1);
  std::string with_e(text);
  for (char& c : with_e)
    if (c == 'D' || c == 'd') c = 'e';
  const auto value = number_in<double>(with_e);
  return value && *value >= min && *value <= max ? value : std::nullopt;
}

bool is_blank(std::string_view line) { return line.find_first_not_of(" \r") == line.npos; }

// The lines of a text one after the other, with their numbers.
class Text {
 public:
  explicit Text(std::string_view text) : rest_(text) {}

  bool ended() const { return rest_.empty(); }
  int number() const { return number_; }  // of the last line that was taken
  std::string_view next() const { return rest_.substr(0, rest_.find('\n')); }
  std::string_view take() {
    const std::string_view line = next();
    rest_.remove_prefix(std::min(rest_.size(), line.size() + 1));
    ++number_;
    return line;
  }
  std::runtime_error fault(std::string_view what) const {
    return std::runtime_error(fmt::format("line {}: {}", number_, what));
  }

 private:
  std::string_view rest_;
  int number_ = 0;
};

const Columns& columns_by_header(Text& text) {
  const std::string_view first = text.take();
  const std::optional<double> version = fortran_number(cut(first, 0, 9), 0, 100);
  if (!version || *version < 2 || *version >= 4)
    throw text.fault(fmt::format("the version {:?} is not read; give a file of RINEX 2 or 3", cut(first, 0, 9)));
  if (const std::string_view type = cut(first, 20, 1); type != "N")
    throw text.fault(fmt::format(
        "a file of the type {:?} has no ephemerides of GPS; give a navigation file, of the type \"N\"", type));
  while (!text.ended())
    if (cut(text.take(), label_column, 20) == "END OF HEADER") return *version < 3 ? columns_of_2 : columns_of_3;
  throw text.fault("the header has no end; give a line \"END OF HEADER\" in column 61");
}

// Returns the time of a record's first line, s since the epoch of GPS.
double epoch_in(const Text& text, std::string_view line, const Columns& columns) {
  constexpr std::pair<double, double> ranges[] = {{0, 2099}, {1, 12}, {1, 31}, {0, 23}, {0, 59}, {0, 59.9}};
  double of[6];
  bool is_good = true;
  for (int i = 0; i < 6; ++i) {
    const auto [begin, width] = columns.epoch[i];
    const std::optional<double> value = fortran_number(cut(line, begin, width), ranges[i].first, ranges[i].second);
    is_good = is_good && value && (i == 5 || *value == std::floor(*value));
    of[i] = value.value_or(0);
  }
  if (columns.epoch[0].second == 2) of[0] += of[0] < 80 ? 2000 : 1900;
  const std::chrono::year_month_day date(std::chrono::year(static_cast<int>(of[0])),
                                         std::chrono::month(static_cast<unsigned>(of[1])),
                                         std::chrono::day(static_cast<unsigned>(of[2])));
  if (!is_good || of[0] < 1981 || !date.ok())
    throw text.fault(
        fmt::format("give year, month, day, hour, minute and second, from 1981 to 2099, in columns {} to {}",
                    columns.epoch[0].first + 1, columns.epoch[5].first + columns.epoch[5].second));
  const std::chrono::days days = std::chrono::sys_days(date) - gps_epoch;
  return 86400.0 * static_cast<double>(days.count()) + 3600 * of[3] + 60 * of[4] + of[5];
}

// Takes the lines of a record after its first.
Numbers take_numbers(Text& text, const Columns& columns, int prn) {
  Numbers values = {};
  for (int line = 1; line <= record_lines; ++line) {
    if (text.ended() || !is_blank(text.next().substr(0, static_cast<std::size_t>(columns.numbers))))
      throw text.fault(
          fmt::format("the record of satellite {} ends here; give {} lines after its first, which begin "
                      "with {} blanks",
                      prn, record_lines, columns.numbers));
    const std::string_view taken = text.take();
    for (std::size_t i = 0; i < field_count; ++i) {
      const Field& field = fields[i];
      if (field.line != line) continue;
      const int begin = columns.numbers + number_width * field.place;
      const std::optional<double> value = fortran_number(cut(taken, begin, number_width), field.min, field.max);
      if (!value)
        throw text.fault(fmt::format("{}, columns {} to {}: give a number from {} to {}", field.name, begin + 1,
                                     begin + number_width, field.min, field.max));
      values[i] = *value;
    }
  }
  return values;
}

AlmanacOrbit ephemeris_of(int prn, std::int64_t week, const Numbers& of) {
  return {.prn = prn,
          .is_healthy = of[sv_health] == 0,
          .reference_ns = week * gps_week_ns + std::llround(1e9 * of[toe]),
          .eccentricity = of[e],
          .inclination = of[i0],
          .node_rate = of[omega_dot],
          .root_axis = of[root_a],
          .node = of[omega0],
          .perigee = of[omega],
          .mean_anomaly = of[m0],
          .motion = of[delta_n],
          .inclination_rate = of[idot],
          .of_latitude = {of[cuc], of[cus]},
          .of_radius = {of[crc], of[crs]},
          .of_inclination = {of[cic], of[cis]}};
}

AlmanacOrbit take_record(Text& text, const Columns& columns) {
  const std::string_view first = text.take();
  const auto [begin, width] = columns.satellite;
  const std::optional<double> satellite = fortran_number(cut(first, begin, width), 1, 63);
  if (!satellite || *satellite != std::floor(*satellite))
    throw text.fault(
        fmt::format("give the number of a satellite, from 1 to 63, in columns {} and {}", begin + 1, begin + width));
  const auto prn = static_cast<int>(*satellite);
  const double epoch_s = epoch_in(text, first, columns);
  const Numbers of = take_numbers(text, columns, prn);
  // The time of the ephemeris is the one that is nearest to the epoch. Files have its week, the one of the epoch, and
  // either of them modulo 1024.
  const auto week = static_cast<std::int64_t>(std::floor((epoch_s - of[toe]) / gps_week_s + 0.5));
  constexpr std::int64_t rollover = 1024;
  if ((static_cast<std::int64_t>(of[gps_week]) - week + 1 + 16 * rollover) % rollover > 2)
    throw text.fault(fmt::format("the record of satellite {} has the week {}; give {}, the one of its epoch", prn,
                                 of[gps_week], week));
  return ephemeris_of(prn, week, of);
}

}  // namespace
}  // namespace rinex

bool is_rinex(std::string_view text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  return rinex::cut(line, rinex::label_column, 20) == "RINEX VERSION / TYPE";
}

std::vector<AlmanacOrbit> rinex_navigation(const std::string& whole) {
  rinex::Text text(whole);
  const rinex::Columns& columns = rinex::columns_by_header(text);
  const bool has_systems = columns.satellite.first == 1;
  std::vector<AlmanacOrbit> orbits;
  while (!text.ended()) {
    const std::string_view line = text.next();
    if (rinex::is_blank(line)) {
      text.take();
    } else if (!has_systems || line.front() == 'G') {
      orbits.push_back(rinex::take_record(text, columns));
    } else if (constexpr std::string_view others = "RECJIS"; others.find(line.front()) == others.npos) {
      text.take();
      throw text.fault("give a record, whose first column is the letter of its system, G for GPS");
    } else {
      text.take();
      while (!text.ended() && text.next().starts_with(' ')) text.take();
    }
  }
  if (orbits.empty()) throw text.fault("there is no satellite of GPS; give a file with records of GPS");
  std::ranges::stable_sort(orbits, {}, &AlmanacOrbit::prn);
  // Satellites without a healthy orbit.
  for (auto begin = orbits.begin(); begin != orbits.end();) {
    const int prn = begin->prn;
    const auto end = std::find_if(begin, orbits.end(), [prn](const AlmanacOrbit& orbit) { return orbit.prn != prn; });
    begin = std::any_of(begin, end, [](const AlmanacOrbit& orbit) { return orbit.is_healthy; })
                ? end
                : orbits.erase(begin, end);
  }
  if (orbits.empty()) throw text.fault("no satellite is healthy; give another file");
  return orbits;
}

}  // namespace imud
