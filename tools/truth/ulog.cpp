// Truth from a ULog: PX4's estimate of attitude and local position, or a simulator's ground truth.
//
// | quantity          | estimate               | ground truth                         | fields                      |
// |-------------------|------------------------|--------------------------------------|-----------------------------|
// | attitude          | vehicle_attitude       | vehicle_attitude_groundtruth         | q: w, x, y, z               |
// | position,velocity | vehicle_local_position | vehicle_local_position_groundtruth   | x, y, z; vx, vy, vz         |
// | rate              |                        | vehicle_angular_velocity_groundtruth | xyz, if it is logged        |
//
// q rotates from front-right-down to north-east-down, position and velocity are north-east-down from the local
// origin, m and m/s: N is that local level, and B the body, as they are. The rate, rad/s in B, is taken as relative
// to N. The estimated rate (vehicle_angular_velocity) is the gyro's with its noise, and is not used.
//
// A state is made at the time of each attitude. The other topics are interpolated by cubics: the position with the
// velocities at both ends, velocity and rate with the slopes of the parabolas through three neighbours.
//
// PX4's estimate jumps where its filter resets, and is as smooth as the filter makes it; ground truth does not jump.
//
// Sources: docs.px4.io, uORB message reference: VehicleAttitude, VehicleLocalPosition, VehicleAngularVelocity.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>

#include "tools/input/ulog_reader.hpp"
#include "tools/truth/truth_logs.hpp"

namespace imud {

namespace {

constexpr std::int64_t longest_position_gap_ns = 1'000'000'000;

// Vectors with their times, in the order of time after sort().
class TimedVectors {
 public:
  struct Entry {
    std::int64_t time_ns;
    Vector3 value, slope;  // the slope per second
  };
  void add(const Entry& entry) { entries_.push_back(entry); }
  bool is_empty() const noexcept { return entries_.empty(); }

  // Sorts by time. Keeps only the first of several vectors with the same time.
  void sort() {
    std::ranges::stable_sort(entries_, {}, &Entry::time_ns);
    const auto first = std::unique(entries_.begin(), entries_.end(),
                                   [](const Entry& a, const Entry& b) { return a.time_ns == b.time_ns; });
    entries_.erase(first, entries_.end());
  }
  // Replaces the slopes by the slopes of parabolas through three neighbours.
  void make_slopes() {
    if (entries_.size() < 2) return;
    const auto step_s = [this](std::size_t i) {
      return 1e-9 * static_cast<double>(entries_[i + 1].time_ns - entries_[i].time_ns);
    };
    const auto secant = [&](std::size_t i) -> Vector3 {
      return (entries_[i + 1].value - entries_[i].value) / step_s(i);
    };
    const std::size_t last = entries_.size() - 1;
    if (last == 1) {
      entries_[0].slope = entries_[1].slope = secant(0);
      return;
    }
    for (std::size_t i = 1; i < last; ++i)
      entries_[i].slope = (secant(i - 1) * step_s(i) + secant(i) * step_s(i - 1)) / (step_s(i - 1) + step_s(i));
    entries_[0].slope = 2 * secant(0) - entries_[1].slope;
    entries_[last].slope = 2 * secant(last - 1) - entries_[last - 1].slope;
  }
  // Returns the value at a time; nullopt outside the range of times, and in a gap. Requires that the times of
  // successive calls do not decrease.
  std::optional<Vector3> at(std::int64_t time_ns) {
    while (at_ + 1 < entries_.size() && entries_[at_ + 1].time_ns <= time_ns) ++at_;
    if (entries_.empty() || time_ns < entries_[at_].time_ns) return std::nullopt;
    const Entry& a = entries_[at_];
    if (time_ns == a.time_ns) return a.value;
    if (at_ + 1 == entries_.size()) return std::nullopt;
    const Entry& b = entries_[at_ + 1];
    const std::int64_t step_ns = b.time_ns - a.time_ns;
    if (step_ns > longest_position_gap_ns) return std::nullopt;
    const double h = 1e-9 * static_cast<double>(step_ns);
    const double s = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(step_ns);
    const double up = s * s * (3 - 2 * s);
    return Vector3((1 - up) * a.value + up * b.value + h * s * (1 - s) * ((1 - s) * a.slope - s * b.slope));
  }
  // Returns whether a time is between the first and the last.
  bool spans(std::int64_t time_ns) const {
    return !entries_.empty() && entries_.front().time_ns <= time_ns && time_ns <= entries_.back().time_ns;
  }

 private:
  std::vector<Entry> entries_;
  std::size_t at_ = 0;
};

class UlogTruth final : public UlogReader {
 public:
  LoggedStates states(const std::string& wanted) {
    const std::size_t cut_short = end();
    const Track* track = nullptr;
    for (const Track* one : {&truth_, &estimate_})
      if (track == nullptr && (wanted == "auto" || wanted == one->name) && one->is_whole()) track = one;
    if (track == nullptr) refuse_missing(wanted);
    LoggedStates out = join(*track);
    if (out.states.empty()) refuse("it has no position at the time of any attitude");
    if (cut_short > 0) out.damage = fmt::format("the log ends within a message, of which it has {} bytes", cut_short);
    if (const std::uint64_t count = take_malformed(); count > 0)
      out.damage += fmt::format("{}malformed messages: {}", out.damage.empty() ? "" : ", ", count);
    return out;
  }

 private:
  enum class Kind { attitude, position, rate };
  struct Attitude {
    std::int64_t time_ns;
    Quaternion q;
  };
  struct Track {
    std::string_view name;
    std::vector<Attitude> attitudes;
    TimedVectors positions, velocities, rates;
    bool is_whole() const noexcept { return !attitudes.empty() && !positions.is_empty(); }
  };
  struct Topic {
    std::string name;
    bool has_data = false;
    Kind kind = Kind::attitude;
    Track* track = nullptr;  // null: the topic is not used
    const UlogFormat* format = nullptr;
    std::array<const UlogFormat::Field*, 6> fields = {};
  };

  [[noreturn]] void refuse_missing(const std::string& wanted) const {
    std::set<std::string_view> names;
    for (const auto& [number, topic] : topics_)
      if (topic.has_data) names.insert(topic.name);
    refuse(fmt::format(
        "it has no truth, which would be {}{}{}; its topics are {}{}",
        wanted == "groundtruth" ? "" : "vehicle_attitude and vehicle_local_position", wanted == "auto" ? ", or " : "",
        wanted == "estimate" ? "" : "vehicle_attitude_groundtruth and vehicle_local_position_groundtruth",
        names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", ")),
        invalid_ > 0
            ? fmt::format("; {} of its positions are not valid (xy_valid, z_valid, v_xy_valid, v_z_valid)", invalid_)
            : ""));
  }

  static LoggedStates join(Track track) {
    std::ranges::stable_sort(track.attitudes, {}, &Attitude::time_ns);
    track.positions.sort();
    track.velocities.sort();
    track.velocities.make_slopes();
    track.rates.sort();
    track.rates.make_slopes();
    LoggedStates out;
    out.has_velocity = true;
    out.has_rate = !track.rates.is_empty();
    out.note = fmt::format("{}{}", track.name, out.has_rate ? " with its rate" : ", whose rate is derived");
    for (const Attitude& attitude : track.attitudes) {
      const std::int64_t time_ns = attitude.time_ns;
      const auto position = track.positions.at(time_ns), velocity = track.velocities.at(time_ns);
      const auto rate = out.has_rate ? track.rates.at(time_ns) : Vector3(Vector3::Zero());
      if (position && velocity && rate)
        out.states.push_back({time_ns, attitude.q, *position, *velocity, *rate});
      else if (track.positions.spans(time_ns) && (!out.has_rate || track.rates.spans(time_ns)))
        ++out.without_position;  // attitudes before the first position and after the last are no loss
    }
    return out;
  }

  void on_subscription(std::uint8_t instance, std::uint16_t number, std::string_view name) override {
    Topic& topic = topics_[number] = {.name = std::string(name)};
    constexpr std::string_view truth_suffix = "_groundtruth";
    const bool is_truth = name.ends_with(truth_suffix);
    if (is_truth) name.remove_suffix(truth_suffix.size());
    std::array<std::string_view, 6> wanted;
    if (name == "vehicle_attitude")
      topic.kind = Kind::attitude, wanted = {"q"};
    else if (name == "vehicle_local_position")
      topic.kind = Kind::position, wanted = {"x", "y", "z", "vx", "vy", "vz"};
    else if (name == "vehicle_angular_velocity" && is_truth)
      topic.kind = Kind::rate, wanted = {"xyz"};
    else
      return;
    if (instance != 0) return;
    topic.format = format(topic.name);
    if (topic.format == nullptr) return;
    const std::size_t count = topic.kind == Kind::attitude ? 4 : topic.kind == Kind::rate ? 3 : 1;
    for (std::size_t i = 0; i < wanted.size() && !wanted[i].empty(); ++i) {
      topic.fields[i] = topic.format->find(wanted[i]);
      if (topic.fields[i] == nullptr || !topic.fields[i]->is_real() || topic.fields[i]->count != count)
        refuse(fmt::format("{} has no field {} of {} numbers", topic.name, wanted[i], count));
    }
    topic.track = is_truth ? &truth_ : &estimate_;
  }

  void on_data(std::uint16_t number, std::string_view body) override {
    const auto found = topics_.find(number);
    if (found == topics_.end()) return;
    Topic& topic = found->second;
    topic.has_data = true;
    if (topic.track == nullptr) return;
    const auto in = message(*topic.format, body);
    if (!in) return;
    const auto time = in->time_ns();
    if (!time) return count_malformed();
    const auto& fields = topic.fields;
    Track& track = *topic.track;
    if (topic.kind == Kind::attitude) {
      const auto q = [&](std::size_t i) { return in->real(*fields[0], i); };
      track.attitudes.push_back({*time, Quaternion(q(0), q(1), q(2), q(3))});
    } else if (topic.kind == Kind::rate) {
      const auto rate = [&](std::size_t i) { return in->real(*fields[0], i); };
      track.rates.add({*time, Vector3(rate(0), rate(1), rate(2)), Vector3::Zero()});
    } else {
      // An estimate without GNSS has no position yet.
      for (const std::string_view flag : {"xy_valid", "z_valid", "v_xy_valid", "v_z_valid"})
        if (in->number<std::uint8_t>(flag) == 0) return void(++invalid_);
      const auto at = [&](std::size_t i) { return in->real(*fields[i]); };
      const Vector3 position(at(0), at(1), at(2)), velocity(at(3), at(4), at(5));
      if (!position.allFinite() || !velocity.allFinite()) return void(++invalid_);
      track.positions.add({*time, position, velocity});
      track.velocities.add({*time, velocity, Vector3::Zero()});
    }
  }

  Track truth_{"groundtruth", {}, {}, {}, {}}, estimate_{"estimate", {}, {}, {}, {}};
  std::map<std::uint16_t, Topic> topics_;
  std::uint64_t invalid_ = 0;  // positions
};

constexpr std::string_view ulog_truth_choices[] = {"auto", "groundtruth", "estimate"};
constexpr Setting ulog_truth_settings[] = {
    {.key = "topics",
     .help = "topics to read: the simulator's ground truth, PX4's estimate; auto: the first of these that is logged",
     .initial = ulog_truth_choices[0],
     .choices = ulog_truth_choices},
};

}  // namespace

extern constexpr TruthLog ulog_truth_log = {
    .name = "ulog",
    .extension = ".ulg",
    .settings = ulog_truth_settings,
    .read =
        [](const std::string& path, const Settings& settings) {
          UlogTruth truth;
          read_log(path, [&](std::span<const std::byte> bytes) { truth.read(bytes); });
          return truth.states(settings.text("topics"));
        },
};

}  // namespace imud
