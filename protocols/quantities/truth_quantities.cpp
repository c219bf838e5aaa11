#include "protocols/quantities/truth_quantities.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <functional>

#include "core/numbers/number_text.hpp"
#include "protocols/quantities/columns.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {
namespace {

using Kind = QuantityKind;
using Names = std::string_view[];

// clang-format off
constexpr Names time_names{"time"}, unix_time{"unix_time"}, gps_time_of_week{"gps_time_of_week"},
    time_of_day{"time_of_day"}, utc{"utc"}, gps_week{"gps_week"}, day{"day"},
    q_NB{"q_NB_w", "q_NB_x", "q_NB_y", "q_NB_z"}, q_BN{"q_BN_w", "q_BN_x", "q_BN_y", "q_BN_z"},
    q_LB{"q_LB_w", "q_LB_x", "q_LB_y", "q_LB_z"}, q_BL{"q_BL_w", "q_BL_x", "q_BL_y", "q_BL_z"},
    q_EB{"q_EB_w", "q_EB_x", "q_EB_y", "q_EB_z"}, q_BE{"q_BE_w", "q_BE_x", "q_BE_y", "q_BE_z"},
    sigma_BN{"sigma_BN_1", "sigma_BN_2", "sigma_BN_3"}, sigma_BL{"sigma_BL_1", "sigma_BL_2", "sigma_BL_3"},
    sigma_BE{"sigma_BE_1", "sigma_BE_2", "sigma_BE_3"},
    dcm_BN{"dcm_BN_11", "dcm_BN_12", "dcm_BN_13", "dcm_BN_21", "dcm_BN_22", "dcm_BN_23", "dcm_BN_31", "dcm_BN_32", "dcm_BN_33"},
    dcm_NB{"dcm_NB_11", "dcm_NB_12", "dcm_NB_13", "dcm_NB_21", "dcm_NB_22", "dcm_NB_23", "dcm_NB_31", "dcm_NB_32", "dcm_NB_33"},
    dcm_BL{"dcm_BL_11", "dcm_BL_12", "dcm_BL_13", "dcm_BL_21", "dcm_BL_22", "dcm_BL_23", "dcm_BL_31", "dcm_BL_32", "dcm_BL_33"},
    dcm_LB{"dcm_LB_11", "dcm_LB_12", "dcm_LB_13", "dcm_LB_21", "dcm_LB_22", "dcm_LB_23", "dcm_LB_31", "dcm_LB_32", "dcm_LB_33"},
    dcm_BE{"dcm_BE_11", "dcm_BE_12", "dcm_BE_13", "dcm_BE_21", "dcm_BE_22", "dcm_BE_23", "dcm_BE_31", "dcm_BE_32", "dcm_BE_33"},
    dcm_EB{"dcm_EB_11", "dcm_EB_12", "dcm_EB_13", "dcm_EB_21", "dcm_EB_22", "dcm_EB_23", "dcm_EB_31", "dcm_EB_32", "dcm_EB_33"},
    euler_L{"yaw", "pitch", "roll"}, euler_N{"yaw_BN", "pitch_BN", "roll_BN"}, euler_E{"yaw_BE", "pitch_BE", "roll_BE"},
    r_BN_N{"r_BN_N_x", "r_BN_N_y", "r_BN_N_z"}, r_BE_E{"r_BE_E_x", "r_BE_E_y", "r_BE_E_z"},
    geodetic{"latitude", "longitude"}, height{"height"}, horizontal{"north", "east"}, down{"down"}, up{"up"},
    v_BN_N{"v_BN_N_x", "v_BN_N_y", "v_BN_N_z"}, v_BE_E{"v_BE_E_x", "v_BE_E_y", "v_BE_E_z"},
    v_BE_B{"v_BE_B_x", "v_BE_B_y", "v_BE_B_z"}, v_horizontal{"v_north", "v_east"}, v_down{"v_down"}, v_up{"v_up"},
    rate_N{"p", "q", "r"}, rate_E{"p_BE", "q_BE", "r_BE"}, euler_rate{"yaw_rate", "pitch_rate", "roll_rate"},
    angular_acceleration{"p_dot", "q_dot", "r_dot"},
    specific_force{"specific_force_x", "specific_force_y", "specific_force_z"},
    acceleration_B{"acceleration_x", "acceleration_y", "acceleration_z"},
    acceleration_N{"a_BN_N_x", "a_BN_N_y", "a_BN_N_z"},
    acceleration_horizontal{"acceleration_north", "acceleration_east"}, acceleration_down{"acceleration_down"},
    acceleration_up{"acceleration_up"},
    accumulated_dv{"accumulated_dv_x", "accumulated_dv_y", "accumulated_dv_z"}, temperature{"temperature"},
    magnetic_field{"magnetic_field_x", "magnetic_field_y", "magnetic_field_z"}, pressure{"pressure"},
    rotor_speed{"rotor_speed"}, throttle{"throttle"}, airspeed{"airspeed"}, dynamic_pressure{"dynamic_pressure"},
    current{"current"}, earth_angle{"earth_angle"}, vehicle{"vehicle"}, sequence{"sequence"};

// In the order of TruthGroup.
constexpr std::array<QuantityGroup, truth_group_count> without_index = {{
    {time_names, Kind::time, "time since the simulator's start"},
    {unix_time, Kind::time, "time since 1970-01-01, UTC without leap seconds"},
    {gps_time_of_week, Kind::time, "time since the GPS week began; needs gps_week"},
    {time_of_day, Kind::time, "time since the day began; with or without day"},
    {utc, Kind::text, "date and time: 2026-01-31T12:00:00.5Z, or with the day of the year 2026-031-12:00:00.5"},
    {gps_week, Kind::number, "GPS week, since 1980-01-06"},
    {day, Kind::number, "day, of any count"},
    {q_NB, Kind::number, "attitude as a quaternion, v_N = q_NB v_B"},
    {q_BN, Kind::number, "attitude as a quaternion, v_B = q_BN v_N"},
    {q_LB, Kind::number, "attitude relative to the local level as a quaternion, v_L = q_LB v_B"},
    {q_BL, Kind::number, "attitude relative to the local level as a quaternion, v_B = q_BL v_L"},
    {q_EB, Kind::number, "attitude relative to the Earth as a quaternion, v_E = q_EB v_B"},
    {q_BE, Kind::number, "attitude relative to the Earth as a quaternion, v_B = q_BE v_E"},
    {sigma_BN, Kind::number, "attitude as modified Rodrigues parameters"},
    {sigma_BL, Kind::number, "attitude relative to the local level as modified Rodrigues parameters"},
    {sigma_BE, Kind::number, "attitude relative to the Earth as modified Rodrigues parameters"},
    {dcm_BN, Kind::number, "attitude as a matrix by rows, v_B = dcm_BN v_N"},
    {dcm_NB, Kind::number, "attitude as a matrix by rows, v_N = dcm_NB v_B"},
    {dcm_BL, Kind::number, "attitude relative to the local level as a matrix by rows, v_B = dcm_BL v_L"},
    {dcm_LB, Kind::number, "attitude relative to the local level as a matrix by rows, v_L = dcm_LB v_B"},
    {dcm_BE, Kind::number, "attitude relative to the Earth as a matrix by rows, v_B = dcm_BE v_E"},
    {dcm_EB, Kind::number, "attitude relative to the Earth as a matrix by rows, v_E = dcm_EB v_B"},
    {euler_L, Kind::angle, "attitude relative to the local level as 3-2-1 Euler angles"},
    {euler_N, Kind::angle, "attitude as 3-2-1 Euler angles"},
    {euler_E, Kind::angle, "attitude relative to the Earth as 3-2-1 Euler angles"},
    {r_BN_N, Kind::length, "position in N"},
    {r_BE_E, Kind::length, "position in Earth-fixed axes"},
    {geodetic, Kind::angle, "geodetic place, WGS 84"},
    {height, Kind::length, "height above the ellipsoid, 0 if it is not given; needs latitude and longitude"},
    {horizontal, Kind::length, "position in a local level; needs down or up"},
    {down, Kind::length, "position below the local level's origin"},
    {up, Kind::length, "position above the local level's origin"},
    {v_BN_N, Kind::speed, "velocity in N"},
    {v_BE_E, Kind::speed, "velocity relative to the Earth, in Earth-fixed axes"},
    {v_BE_B, Kind::speed, "velocity relative to the Earth, in body axes"},
    {v_horizontal, Kind::speed, "velocity relative to the Earth, in the local level; needs v_down or v_up"},
    {v_down, Kind::speed, "velocity relative to the Earth, down"},
    {v_up, Kind::speed, "velocity relative to the Earth, up"},
    {rate_N, Kind::rate, "rate relative to N, in body axes"},
    {rate_E, Kind::rate, "rate relative to the Earth, in body axes; the Earth's own is added"},
    {euler_rate, Kind::rate, "derivatives of yaw, pitch, roll, taken as relative to the Earth; the Earth's rate is added"},
    {angular_acceleration, Kind::angular_acceleration, "derivative of the rate, in body axes"},
    {specific_force, Kind::acceleration, "specific force, in body axes: at rest it points up"},
    {acceleration_B, Kind::acceleration, "acceleration relative to the Earth, in body axes: at rest it is 0; gravity is subtracted"},
    {acceleration_N, Kind::acceleration, "acceleration in N; gravitation is subtracted"},
    {acceleration_horizontal, Kind::acceleration, "acceleration relative to the Earth, in the local level; needs acceleration_down or _up"},
    {acceleration_down, Kind::acceleration, "acceleration relative to the Earth, down: at rest it is 0"},
    {acceleration_up, Kind::acceleration, "acceleration relative to the Earth, up"},
    {accumulated_dv, Kind::speed, "accumulated specific force, in body axes; see accumulated_dv"},
    {temperature, Kind::temperature, "temperature of the sensor's surroundings"},
    {magnetic_field, Kind::magnetic_field, "magnetic field, in body axes"},
    {pressure, Kind::pressure, "pressure of the air"},
    {rotor_speed, Kind::rate, "speed of a rotor or an engine; see [imu.vibration]"},
    {throttle, Kind::number, "throttle, 0 to 1; see [imu.vibration]"},
    {airspeed, Kind::speed, "true airspeed; see [imu.vibration] and [imu.barometer]"},
    {dynamic_pressure, Kind::pressure, "dynamic pressure of the air; see [imu.vibration] and [imu.barometer]"},
    {current, Kind::current, "electric current; see [imu.magnetometer]"},
    {earth_angle, Kind::angle, "angle from N's x axis to the prime meridian; without it the Earth's rate times the time"},
    {vehicle, Kind::number, "number of the vehicle (truth.stream)"},
    {sequence, Kind::number, "number of the truth, one more with each"},
}};
// clang-format on

constexpr auto groups = [] {
  auto all = without_index;
  std::size_t next = 0;
  for (QuantityGroup& group : all) {
    group.first = next;
    next += group.names.size();
  }
  return all;
}();
static_assert(groups.back().first + groups.back().names.size() <= quantity_count);

constexpr KeyUnit no_unit[] = {{""}};

// The units of each kind, and the largest magnitude of its numbers; in the order of QuantityKind.
struct KindRow {
  Kind kind;
  std::span<const KeyUnit> units = no_unit;
  double largest = 1e9;  // of quaternions, days, vehicles, ...
};
constexpr KindRow kinds[] = {
    {Kind::number},
    {Kind::time, key_units::time},
    {Kind::text},
    {Kind::angle, key_units::angle, 1e5},  // the limit of elementary::sincos
    {Kind::length, key_units::length, truth_limit::position},
    {Kind::speed, key_units::speed, truth_limit::velocity},
    {Kind::rate, key_units::rate, truth_limit::rate},
    {Kind::angular_acceleration, key_units::angular_acceleration, truth_limit::angular_acceleration},
    {Kind::acceleration, key_units::acceleration, truth_limit::specific_force},
    {Kind::temperature, key_units::temperature, truth_limit::temperature},
    {Kind::magnetic_field, key_units::magnetic_field},
    {Kind::pressure, key_units::pressure},
    {Kind::current, key_units::current},
};
static_assert(std::ranges::is_sorted(kinds, std::ranges::less_equal{}, &KindRow::kind) &&
              std::size(kinds) == static_cast<std::size_t>(Kind::current) + 1);
constexpr std::span<const KeyUnit> units_of(Kind kind) noexcept {
  return kinds[static_cast<std::size_t>(kind)].units;
}

constexpr std::int64_t powers_of_ten[] = {1,       10,        100,        1'000,       10'000,
                                          100'000, 1'000'000, 10'000'000, 100'000'000, 1'000'000'000};

// Returns 10^exponent * `number`; nullopt if the result is beyond the range of a time.
std::optional<std::int64_t> scaled(std::int64_t number, int exponent) noexcept {
  std::int64_t result = 0;
  if (__builtin_mul_overflow(number, powers_of_ten[exponent], &result)) return std::nullopt;
  return result;
}

// Reads the whole of `text` as a decimal number, and returns it in ns, rounded. `exponent`: 9 for seconds, 6 for
// milliseconds, and so on. Returns nullopt if the text is no number, or has an exponent.
std::optional<std::int64_t> decimal_ns(std::string_view text, int exponent) noexcept {
  const bool negative = text.starts_with('-');
  if (negative || text.starts_with('+')) text.remove_prefix(1);
  const std::size_t point = text.find('.');
  std::string_view whole = text.substr(0, point), fraction = point == text.npos ? "" : text.substr(point + 1);
  const auto is_digits = [](std::string_view s) { return s.find_first_not_of("0123456789") == s.npos; };
  if ((whole.empty() && fraction.empty()) || !is_digits(whole) || !is_digits(fraction)) return std::nullopt;
  const auto high = number_in<std::int64_t>(whole.empty() ? "0" : whole);
  if (!high) return std::nullopt;
  const auto digits = static_cast<std::size_t>(exponent);  // up to 1 ns
  const bool is_rounded_up = fraction.size() > digits && fraction[digits] >= '5';
  fraction = fraction.substr(0, digits);
  const std::int64_t low =
      number_in<std::int64_t>(fraction).value_or(0) * powers_of_ten[exponent - static_cast<int>(fraction.size())] +
      (is_rounded_up ? 1 : 0);
  const auto ns = scaled(*high, exponent);
  std::int64_t sum = 0;
  if (!ns || __builtin_add_overflow(*ns, low, &sum)) return std::nullopt;
  return negative ? -sum : sum;
}

// Removes a number of `digits` digits, followed by `after`, from the begin of `text`. Returns the number; nullopt if
// the text does not begin so.
std::optional<int> take_number(std::string_view& text, std::size_t digits, std::string_view after) noexcept {
  int number = 0;
  if (text.size() < digits || text.substr(0, digits).find_first_not_of("0123456789") != text.npos) return {};
  std::from_chars(text.data(), text.data() + digits, number);
  text.remove_prefix(digits);
  if (after.empty()) return number;
  if (text.empty() || after.find(text.front()) == after.npos) return {};
  text.remove_prefix(1);
  return number;
}

// Reads a date and a time. Returns ns since 1970-01-01; nullopt if the text is no date.
std::optional<std::int64_t> date_ns(std::string_view text) noexcept {
  using namespace std::chrono;
  const auto year_number = take_number(text, 4, "-");
  if (!year_number || *year_number < 1900 || *year_number > 2200) return {};  // whose ns fit into 64 bits
  sys_days date;
  if (text.size() > 3 && text[2] == '-') {
    const auto month_number = take_number(text, 2, "-"), day_number = take_number(text, 2, "T ");
    if (!month_number || !day_number) return {};
    const year_month_day given{std::chrono::year(*year_number), month(static_cast<unsigned>(*month_number)),
                               std::chrono::day(static_cast<unsigned>(*day_number))};
    if (!given.ok()) return {};
    date = given;
  } else {
    const auto day_of_year = take_number(text, 3, "-T ");
    const std::chrono::year year(*year_number);
    if (!day_of_year || *day_of_year < 1 || *day_of_year > (year.is_leap() ? 366 : 365)) return {};
    date = sys_days(year / 1 / 1) + days(*day_of_year - 1);
  }
  const auto hour = take_number(text, 2, ":"), minute = take_number(text, 2, ":");
  if (!hour || !minute || *hour > 23 || *minute > 59) return {};
  constexpr std::string_view utc_offsets[] = {"Z", "+00:00"};
  for (const std::string_view offset : utc_offsets)
    if (text.ends_with(offset)) {
      text.remove_suffix(offset.size());
      break;
    }
  const auto second = decimal_ns(text, 9);
  constexpr std::int64_t largest_second = 61'000'000'000;
  if (!second || *second < 0 || *second >= largest_second || text.starts_with('-')) return {};
  const std::int64_t whole = (date.time_since_epoch().count() * 24LL + *hour) * 60 + *minute;
  return whole * 60 * 1'000'000'000 + *second;
}

}  // namespace

std::span<const QuantityGroup, truth_group_count> quantity_groups() noexcept { return groups; }

double largest_number_of(QuantityKind kind) noexcept { return kinds[static_cast<std::size_t>(kind)].largest; }

std::string_view quantity_name(std::size_t quantity) noexcept {
  for (const QuantityGroup& group : groups)
    if (quantity < group.first + group.names.size()) return group.names[quantity - group.first];
  return {};
}

std::span<const std::string_view> unit_suffixes(QuantityKind kind) noexcept {
  static constexpr std::size_t most = 8;
  static const auto all = [] {
    std::array<std::array<std::string_view, most>, std::size(kinds)> suffixes;
    for (std::size_t i = 0; i < std::size(kinds); ++i)
      std::ranges::transform(units_of(static_cast<Kind>(i)), suffixes[i].begin(), &KeyUnit::suffix);
    return suffixes;
  }();
  const std::size_t count = units_of(kind).front().suffix.empty() ? 0 : units_of(kind).size();
  return std::span(all[static_cast<std::size_t>(kind)]).first(count);
}

std::optional<TruthField> find_truth_field(std::string_view name) noexcept {
  for (const QuantityGroup& group : groups)
    for (std::size_t i = 0; i < group.names.size(); ++i) {
      if (!name.starts_with(group.names[i])) continue;
      if (const KeyUnit* unit = find_unit(units_of(group.kind), name.substr(group.names[i].size())))
        return TruthField{group.first + i, group.kind, unit->factor, unit->offset, unit->exponent};
    }
  return std::nullopt;
}

std::vector<std::string> names_in(std::string_view name) {
  const std::size_t open = name.find('{'), close = name.find('}');
  if (open == name.npos) return {std::string(name)};
  std::vector<std::string> names;
  for (std::string_view words = name.substr(open + 1, close - open - 1); words.data() != nullptr;)
    names.push_back(std::string(name.substr(0, open)).append(take_field(words)).append(name.substr(close + 1)));
  return names;
}

std::string unknown_quantity(std::string_view name) {
  std::string text = "unknown quantity \"" + std::string(name) + "\"";
  for (const QuantityGroup& group : groups)
    for (const std::string_view known : group.names) {
      const auto suffixes = unit_suffixes(group.kind);
      const bool lacks_unit = name == known && !suffixes.empty();
      const bool wrong_unit = name.size() > known.size() && name.starts_with(known) && name[known.size()] == '_' &&
                              !find_truth_field(std::string(known) + std::string(name.substr(known.size())));
      if (!lacks_unit && !wrong_unit) continue;
      text += lacks_unit ? "; it needs a unit:" : "; its units are:";
      for (const std::string_view suffix : suffixes) text.append(" ").append(known).append(suffix);
      return text;
    }
  return text + "; `imud list csv` prints all";
}

TruthResult TruthReading::set(const TruthField& field, double number) noexcept {
  if (!std::isfinite(number)) return TruthResult::not_finite;
  if (field.kind == Kind::time) {
    const double ns = number * static_cast<double>(powers_of_ten[field.exponent]);
    if (std::abs(ns) >= truth_limit::time_ns) return TruthResult::out_of_range;
    time_ns_ = std::llround(ns);
  } else {
    values_[field.quantity] = field.factor * number + field.offset;
  }
  return TruthResult::ok;
}

TruthResult TruthReading::set(const TruthField& field, std::int64_t number) noexcept {
  if (field.kind != Kind::time) return set(field, static_cast<double>(number));
  const auto ns = scaled(number, field.exponent);
  if (!ns) return TruthResult::out_of_range;
  time_ns_ = *ns;
  return TruthResult::ok;
}

TruthResult TruthReading::set(const TruthField& field, std::string_view text) noexcept {
  if (field.kind == Kind::text || field.kind == Kind::time) {
    text = unquoted(text);
    const auto ns = field.kind == Kind::text ? date_ns(text) : decimal_ns(text, field.exponent);
    if (ns) time_ns_ = *ns;
    if (ns) return TruthResult::ok;
    if (field.kind == Kind::text) return TruthResult::bad_number;
  }
  std::optional<double> number = parse_real(text);
  if (!number) number = parse_real(unquoted(text));
  return number ? set(field, *number) : TruthResult::bad_number;
}

}  // namespace imud
