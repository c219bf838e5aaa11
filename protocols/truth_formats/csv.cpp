// Truth as rows of text: a header row, then a row per state. The columns may have any order. Their names are
// Basilisk's names, or quantities of truth with their units, or, with the setting `columns`, any names
// (protocols/quantities/mapped_columns.hpp).
//
// By Basilisk's names, `time_ns`, `sigma_BN_1..3` (MRP of any norm) and `omega_BN_B_x..z` (rad/s) are required.
// `r_BN_N_x..z` (m), `v_BN_N_x..z` (m/s), `omegaDot_BN_B_x..z` (rad/s^2), `nonConservativeAccelpntB_B_x..z` (specific
// force, m/s^2) and `TotalAccumDV_BN_B_x..z` (m/s) are used if all three columns are present, and so is
// `temperature_c`. Lines that begin with '#' are ignored, and so are other columns, which describe() names. All names
// but the last are from Basilisk's SCStatesMsgPayload. The header row sets the separator: commas, semicolons or tabs.
// The decimal sign is a point.
#include <algorithm>

#include "protocols/quantities/columns.hpp"
#include "protocols/quantities/mapped_columns.hpp"

namespace imud {
namespace {

// clang-format off
enum Column : std::size_t {
  time_ns = 0, sigma_BN = 1, omega_BN_B = 4, r_BN_N = 7, v_BN_N = 10, omegaDot_BN_B = 13, specific_force_B = 16,
  accumulated_dv_B = 19, temperature_c = 22,
};

constexpr std::string_view names[] = {
    "time_ns",
    "sigma_BN_1", "sigma_BN_2", "sigma_BN_3",
    "omega_BN_B_x", "omega_BN_B_y", "omega_BN_B_z",
    "r_BN_N_x", "r_BN_N_y", "r_BN_N_z",
    "v_BN_N_x", "v_BN_N_y", "v_BN_N_z",
    "omegaDot_BN_B_x", "omegaDot_BN_B_y", "omegaDot_BN_B_z",
    "nonConservativeAccelpntB_B_x", "nonConservativeAccelpntB_B_y", "nonConservativeAccelpntB_B_z",
    "TotalAccumDV_BN_B_x", "TotalAccumDV_BN_B_y", "TotalAccumDV_BN_B_z",
    "temperature_c",
};
// clang-format on
constexpr std::string_view quantities[] = {
    // clang-format off
    "time_ns",
    "sigma_BN_1", "sigma_BN_2", "sigma_BN_3",
    "p_rad_per_s", "q_rad_per_s", "r_rad_per_s",
    "r_BN_N_x_m", "r_BN_N_y_m", "r_BN_N_z_m",
    "v_BN_N_x_m_per_s", "v_BN_N_y_m_per_s", "v_BN_N_z_m_per_s",
    "p_dot_rad_per_s2", "q_dot_rad_per_s2", "r_dot_rad_per_s2",
    "specific_force_x_m_per_s2", "specific_force_y_m_per_s2", "specific_force_z_m_per_s2",
    "accumulated_dv_x_m_per_s", "accumulated_dv_y_m_per_s", "accumulated_dv_z_m_per_s",
    "temperature_c",
    // clang-format on
};
static_assert(std::size(quantities) == std::size(names));
constexpr ColumnGroup group(Column first, std::size_t size, std::string_view help,
                            ColumnGroup::Need need = ColumnGroup::optional) {
  return {std::span(names).subspan(first, size), help, need};
}

constexpr ColumnGroup column_groups[] = {
    group(time_ns, 1, "simulation time, ns", ColumnGroup::required),
    group(sigma_BN, 3, "attitude of B relative to N, MRP of any norm", ColumnGroup::required),
    group(omega_BN_B, 3, "rate of B relative to N, in B, rad/s", ColumnGroup::required),
    group(r_BN_N, 3, "position of B's origin, in N, m"),
    group(v_BN_N, 3, "velocity of B's origin, in N, m/s"),
    group(omegaDot_BN_B, 3, "angular acceleration, in B, rad/s^2"),
    group(specific_force_B, 3, "specific force of B's origin, in B, m/s^2"),
    group(accumulated_dv_B, 3, "accumulated velocity of B's origin without gravity, m/s; see accumulated_dv"),
    group(temperature_c, 1, "temperature of the sensor's surroundings, degrees Celsius; see [imu.temperature]"),
};
constexpr ColumnNames column_names = {names, quantities, column_groups,
                                      "time_ns, sigma_BN_1 to _3, omega_BN_B_x to _z"};

class BasiliskColumns final : public ColumnTruthDecoder {
 public:
  explicit BasiliskColumns(const Settings& settings)
      : ColumnTruthDecoder(column_names,
                           [](std::string_view given, std::string_view wanted) { return given == wanted; },
                           {.accumulated_dv = TruthAssembly::accumulation(settings)}) {
    configure(settings);
  }
  using ColumnTruthDecoder::decode;
  static bool is_header(std::string_view row) noexcept {
    if (row.find(names[time_ns]) == std::string_view::npos) return false;
    const char delimiter = delimiter_of(row);
    for (std::string_view rest = row; rest.data() != nullptr;)
      if (unquoted(take_field(rest, delimiter)) == names[time_ns]) return true;
    return false;
  }

 private:
  Kind kind(std::string_view& row) const noexcept override {
    if (row.front() == '#') return Kind::remark;
    return is_header(row) ? Kind::header : Kind::state;
  }
};

// The names of a header row, or of the setting `columns`.
class NamesSeen {
 public:
  void add(std::string_view name) noexcept {
    const bool is_basilisk = std::ranges::find(names, name) != std::end(names), is_quantity = is_known(name);
    has_basilisk_ = has_basilisk_ || (is_basilisk && !is_quantity);
    has_quantity_ = has_quantity_ || (is_quantity && !is_basilisk);
  }
  // Some names have both meanings, such as time_ns and sigma_BN_1. Returns true if they are quantities of truth.
  bool are_quantities() const noexcept { return has_quantity_ && !has_basilisk_; }

 private:
  static bool is_known(std::string_view name) noexcept { return find_signed_field(name).has_value(); }

  bool has_basilisk_ = false, has_quantity_ = false;
};

// Reads rows by Basilisk's names until a header row has names of quantities.
class CsvTruthDecoder final : public LineTruthDecoder {
 public:
  explicit CsvTruthDecoder(const Settings& settings) : basilisk_(settings), mapped_(TruthAssembly::axes(settings)) {}

  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override {
    if (!is_mapped_ && result == TruthResult::no_columns) return describe_columns(room);
    if (!is_mapped_) return basilisk_.describe(result, room);
    RemarkWriter out(room);
    mapped_.describe(result, out);
    return out.size();
  }
  void finish() noexcept override {
    LineTruthDecoder::finish();
    mapped_.begin();
  }

 private:
  // Each truth has a time. Rows of numbers do not name one, and need no search.
  static bool has_quantities(std::string_view row) noexcept {
    if (row.find("time") == row.npos && row.find("utc") == row.npos) return false;
    const char delimiter = delimiter_of(row);
    std::size_t count = 0;
    NamesSeen seen;
    for (std::string_view rest = row; rest.data() != nullptr && count < Columns::max_columns; ++count)
      seen.add(unquoted(take_field(rest, delimiter)));
    return seen.are_quantities();
  }
  // Describes the last row, which is no header row with all of Basilisk's columns. It may name quantities without a
  // time, or among Basilisk's names.
  std::size_t describe_columns(std::span<char> room) const noexcept {
    std::string_view quantity;
    NamesSeen seen;
    std::size_t count = 0;
    const char delimiter = delimiter_of(row_);
    for (std::string_view rest = row_; rest.data() != nullptr && count < Columns::max_columns; ++count) {
      const std::string_view name = unquoted(take_field(rest, delimiter));
      NamesSeen one;
      one.add(name);
      seen.add(name);
      if (quantity.empty() && one.are_quantities()) quantity = name;
    }
    if (seen.are_quantities()) {
      RemarkWriter out(room);
      (out << "the time is missing; give time_s, unix_time_s, utc or another: ").quote(row_);
      return out.size();
    }
    const std::size_t size = basilisk_.describe(TruthResult::no_columns, room);
    RemarkWriter out(room.subspan(size));
    if (!quantity.empty())
      (out << "; a quantity such as ").quote(quantity, 64) << " is not used beside Basilisk's names";
    return size + out.size();
  }
  TruthResult decode(std::string_view line, Truth& truth) noexcept override {
    const std::string_view row = without_order_mark(line);
    // A remark that names some quantities is no header row.
    const auto is_remark = [row] { return trim(row).starts_with('#'); };
    if (has_quantities(row))
      is_mapped_ = is_mapped_ || !is_remark() || mapped_.is_header(row);
    else if (is_mapped_ && BasiliskColumns::is_header(row))
      is_mapped_ = is_remark();
    row_ = trim(row);
    return is_mapped_ ? mapped_.decode(line, truth) : basilisk_.decode(line, truth);
  }

  BasiliskColumns basilisk_;
  MappedColumns mapped_;
  bool is_mapped_ = false;
  std::string_view row_;  // the last row
};

std::unique_ptr<TruthDecoder> make(const Settings& settings) {
  const std::vector<std::string>& columns = settings.list(columns_setting.key);
  const TruthAssembly::Axes axes = TruthAssembly::axes(settings);
  if (is_truth_map(columns))
    return std::make_unique<MappedColumnDecoder>(MappedColumns(parse_truth_map(columns), axes));
  NamesSeen seen;
  for (const std::string& name : columns) seen.add(unquoted(name));
  if (seen.are_quantities())
    return std::make_unique<MappedColumnDecoder>(MappedColumns(parse_truth_order(columns), axes));
  return std::make_unique<CsvTruthDecoder>(settings);
}

constexpr Setting settings[] = {
    accumulated_dv_setting,
    list_setting(columns_setting.key,
                 "names of the columns in their order, if there is no header row or imud starts after it; or a table "
                 "of quantities with the names "
                 "of their columns, {time_s = \"t\", q_NB_w = \"qw\", ...}, or their numbers from 0"),
    level_setting,
    body_setting,
};

}  // namespace

extern constexpr TruthFormat csv_truth_format = {
    .name = "csv",
    .summary = "rows of text, columns by the names of Basilisk's spacecraft states, of quantities, or by a map",
    .document = "protocols/truth_formats/csv.cpp; Basilisk SCStatesMsgPayload",
    .delimits_itself = true,
    .settings = settings,
    .columns = column_groups,
    .make = make,
    .force_from =
        "the columns specific_force_x_m_per_s2 to _z_m_per_s2, or beside Basilisk's names "
        "nonConservativeAccelpntB_B_x to _z or TotalAccumDV_BN_B_x to _z",
    .maps_quantities = true,
    .position_from = "the columns r_BN_N_x_m to _z_m (Basilisk's r_BN_N_x to _z)",
    .velocity_from = "the columns v_BN_N_x_m_per_s to _z_m_per_s (Basilisk's v_BN_N_x to _z)",
};

}  // namespace imud
