// Truth from a recording of ROS 2 as MCAP: nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped, by cdr.
//
// By REP 103 the world is east-north-up and the body front-left-up, m and rad; q rotates from body to world axes, and
// is written x, y, z, w. `level` and `body` are for others. The twist of an odometry is in the body's axes
// (child_frame_id): velocity and rate of the body relative to the world. The time is header.stamp. N is the world's
// local level, north-east-down.
//
// Sources: REP 103; the definitions of the messages in common_interfaces.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <set>

#include "protocols/quantities/pose_table.hpp"
#include "tools/input/mcap_reader.hpp"
#include "tools/truth/truth_logs.hpp"

namespace imud {

namespace {

constexpr std::string_view odometry_schema = "nav_msgs/msg/Odometry", pose_schema = "geometry_msgs/msg/PoseStamped";

class McapTruth final : public McapReader {
 public:
  explicit McapTruth(const Settings& settings)
      : topic_(settings.text("topic")), uses_twist_(settings.text("twist") == "auto") {
    out_.axes.is_enu = settings.text(world_setting.key) == level_choices[1];
    out_.axes.is_flu = settings.text(body_setting.key) == body_choices[1];
  }

  LoggedStates states() {
    const std::size_t cut_short = end();
    const Damage damage = take_damage();
    if (cut_short > 0)
      out_.damage = fmt::format("the file ends within a record, of which it has {} bytes", cut_short);
    for (const auto& [count, what] :
         {std::pair{damage.malformed, "malformed"}, {damage.checksum, "with a wrong CRC"}})
      if (count > 0) out_.damage += fmt::format("{}records {}: {}", out_.damage.empty() ? "" : ", ", what, count);
    if (out_.states.empty())
      refuse(fmt::format("it has no truth, which would be {} or {} by cdr{}; its topics are {}{}", odometry_schema,
                         pose_schema, topic_.empty() ? "" : fmt::format(" with the topic {}", topic_),
                         topics_.empty() ? "none" : fmt::format("{}", fmt::join(topics_, ", ")),
                         out_.damage.empty() ? "" : fmt::format(" ({})", out_.damage)));
    // Many sources of odometry leave the twist at zero.
    bool has_twist = false;
    for (const LoggedStates::State& state : out_.states)
      has_twist = has_twist || !state.v_BN_N.isZero(0) || !state.rate_B.isZero(0);
    out_.has_velocity = out_.has_rate = uses_twist_ && is_odometry_ && has_twist;
    out_.note = chosen_name_ + (out_.has_rate ? " with its twist" : ", whose rate is derived");
    if (candidates_.size() > 1)
      out_.note += fmt::format("; --set topic=... chooses another of {}", fmt::join(candidates_, ", "));
    return std::move(out_);
  }

 private:
  void on_channel(std::uint16_t number, std::string_view schema, std::string_view topic,
                  std::string_view encoding) override {
    topics_.insert(fmt::format("{} ({}, {})", topic, schema, encoding));
    if (encoding != "cdr" || (schema != odometry_schema && schema != pose_schema)) return;
    candidates_.emplace(topic);
    if (chosen_ || (!topic_.empty() && topic != topic_)) return;
    chosen_ = number;
    chosen_name_ = topic;
    is_odometry_ = schema == odometry_schema;
  }

  void on_message(std::uint16_t channel, std::uint64_t, std::string_view data) override {
    if (chosen_ != channel) return;
    CdrFields fields(data);
    LoggedStates::State state{};
    state.time_ns = fields.header_ns();
    if (is_odometry_) fields.skip_text();
    const auto read_vector = [&](Vector3& vector) {
      for (double& axis : vector) axis = fields.number<double>();
    };
    read_vector(state.r_BN_N);
    for (double& part : state.q_NB.coeffs()) part = fields.number<double>();  // x, y, z, w
    if (is_odometry_) {
      constexpr int covariance = 36;
      for (int i = 0; i < covariance; ++i) fields.number<double>();
      Vector3 v_B;
      read_vector(v_B);
      state.v_BN_N = state.q_NB.normalized() * v_B;
      read_vector(state.rate_B);
    }
    if (!fields.is_good()) return count_malformed();
    out_.states.push_back(state);
  }

  const std::string topic_;
  const bool uses_twist_;
  LoggedStates out_;
  std::optional<std::uint16_t> chosen_;
  std::string chosen_name_;
  bool is_odometry_ = false;
  std::set<std::string> topics_, candidates_;
};

constexpr std::string_view twist_choices[] = {"auto", "none"};
constexpr Setting mcap_truth_settings[] = {
    {.key = "topic", .help = "topic of the channel; default: the first that fits", .initial = std::string_view()},
    {.key = "twist",
     .help = "velocity and rate of an odometry; auto: those of its twist, unless it is always zero; none: they are "
             "derived from the poses",
     .initial = twist_choices[0],
     .choices = twist_choices},
    world_setting,
    {.key = body_setting.key, .help = body_setting.help, .initial = std::string_view("flu"), .choices = body_choices},
};

}  // namespace

extern constexpr TruthLog mcap_truth_log = {
    .name = "mcap",
    .extension = ".mcap",
    .settings = mcap_truth_settings,
    .read =
        [](const std::string& path, const Settings& settings) {
          McapTruth truth(settings);
          read_log(path, [&](std::span<const std::byte> bytes) { truth.read(bytes); });
          return truth.states();
        },
};

}  // namespace imud
