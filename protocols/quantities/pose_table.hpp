// Pose tables: rows of text without header row, whose columns are quantities in a known order.
#pragma once

#include <span>
#include <string_view>

#include "protocols/quantities/mapped_columns.hpp"

namespace imud {

// The setting `columns` of a pose table replaces the format's order of columns.
inline constexpr Setting column_order_setting = list_setting(
    "columns",
    "quantities of the columns in their order, if it is another one: time_s, q_NB_w, ...; _ is not used, a "
    "minus changes the sign");
// The setting `level` of pose tables of robots, whose world has its z axis up.
inline constexpr Setting world_setting =
    text_setting(level_setting.key, "axes of the world: \"enu\" if its z axis points up, \"ned\" if it points down",
                 "enu", level_choices);

// Makes the decoder of rows with the columns of the setting `columns`, or if the setting is empty, with `columns`.
// Throws as MappedColumns does.
inline std::unique_ptr<TruthDecoder> make_pose_table(const Settings& settings,
                                                     std::span<const std::string_view> columns) {
  const std::vector<std::string>& order = settings.list(column_order_setting.key);
  TruthMap map = order.empty() ? truth_order(columns) : parse_truth_order(order);
  return std::make_unique<MappedColumnDecoder>(MappedColumns(std::move(map), TruthAssembly::axes(settings)));
}

}  // namespace imud
