// How much of the shipped descriptions is found in captures of them, at rest and turned.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "emulator/frames/frame_file.hpp"
#include "tests/tools/find/find_unit.hpp"
#include "tools/find/capture_kind.hpp"
#include "tools/find/field_search.hpp"
#include "tools/find/found_description.hpp"

namespace imud {
namespace {

constexpr double survey_rate_hz = 100;
constexpr std::size_t survey_turned = 2500, survey_rest = 600;

// Samples with attitude, magnetic field, pressure and place, which change as a real unit's do.
std::vector<Sample> lifelike_samples(Handling handling, std::size_t count) {
  std::vector<Sample> samples = handled_samples(handling, count, survey_rate_hz);
  std::mt19937_64 random(77);
  std::normal_distribution<double> noise;
  const auto noisy = [&](double sigma) {
    return Vector3(sigma * Vector3(noise(random), noise(random), noise(random)));
  };
  Quaternion q = Quaternion::FromTwoVectors(Vector3(0.02, -0.03, 1), Vector3::UnitZ());
  for (Sample& sample : samples) {
    const Vector3 turn = sample.rate / survey_rate_hz;
    if (handling == Handling::turned)
      q = (q * Quaternion(Eigen::AngleAxisd(turn.norm(), turn.normalized()))).normalized();
    sample.q_LP = q;
    sample.magnetic_field = q.conjugate() * Vector3(2e-5, 1e-6, 4e-5) + noisy(1e-7);
    sample.pressure += 2 * noise(random);
    sample.navigation.height = 100 + 0.1 * noise(random);
    sample.navigation.latitude += 1e-9 * noise(random);
    sample.navigation.longitude += 1e-9 * noise(random);
    sample.navigation.v_L = noisy(0.01);
  }
  return samples;
}

Capture survey_capture(const std::string& name, Handling handling) {
  Line line(protocol_named("frame"), frame_settings(read_frames(name)));
  return capture_of(line, lifelike_samples(handling, handling == Handling::turned ? survey_turned : survey_rest));
}

std::vector<Measurement> measured(Line& line, const std::vector<std::byte>& bytes) {
  Recording recording;
  line.decoder->feed({bytes, {}}, recording);
  line.decoder->finish(recording);
  return std::move(recording.measurements);
}

struct SurveyQuantity {
  const char* name;
  std::uint32_t field;
  Vector3 Sample::*value;
};
constexpr SurveyQuantity survey_quantities[] = {
    {"rate", Measurement::rate, &Sample::rate},
    {"force", Measurement::specific_force, &Sample::specific_force},
    {"delta-angle", Measurement::delta_angle, &Sample::delta_angle},
    {"delta-velocity", Measurement::delta_velocity, &Sample::delta_velocity}};

std::vector<Vector3> values_of(const std::vector<Measurement>& all, const SurveyQuantity& quantity) {
  std::vector<Vector3> values;
  for (const Measurement& one : all)
    if ((one.fields & quantity.field) != 0) values.push_back(one.sample.*quantity.value);
  return values;
}

// Returns true if they are the same within 1e-3, in other axes with other signs.
bool are_alike(const std::vector<Vector3>& found, const std::vector<Vector3>& truth) {
  if (found.size() + 2 < truth.size() || truth.empty()) return false;
  const std::size_t count = std::min(found.size(), truth.size());
  double all = 0;
  for (const Vector3& one : truth) all += one.squaredNorm();
  double squares = 0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index j = 0; j < 3; ++j)
      for (const double sign : {1.0, -1.0}) {
        double sum = 0;
        for (std::size_t k = 0; k < count; ++k) sum += std::pow(found[k](j) - sign * truth[k](i), 2);
        least = std::min(least, sum);
      }
    squares += least;
  }
  return squares < 1e-6 * all;
}

class Misses {
 public:
  void add(bool is_right, const std::string& what) {
    if (!is_right && all_.insert(what).second) text_ += (text_.empty() ? "" : ", ") + what;
  }
  const std::string& text() const { return text_; }

 private:
  std::set<std::string> all_;
  std::string text_;
};

// The bytes of the description's rows that have a check, by place in a frame of this length; behind optional elements
// they are counted from its end.
std::map<std::size_t, std::size_t> checks_of(const MessageLayout& layout, std::size_t length) {
  std::map<std::size_t, std::size_t> checks;
  std::size_t at = 0;
  for (const MessageLayout::Row& row : layout.rows()) {
    if (row.name.starts_with("check")) checks[row.offset.value_or(at + length - layout.longest())] = row.size;
    at += row.size;
  }
  return checks;
}

void compare_message(const MessageLayout& layout, const FoundMessage& found, Misses& misses) {
  std::map<std::size_t, std::size_t> checks;
  for (const FoundCheck& check : found.checks) checks[check.at] = check.size;
  misses.add(checks == checks_of(layout, found.length), "check");
  for (const MessageLayout::Row& row : layout.rows()) {
    const bool counts =
        row.name.find("counter") != row.name.npos && row.name.find('=') == row.name.npos && row.size > 0;
    const bool is_clock = row.name.starts_with("time_") || row.name.starts_with("gps_time_of_week");
    const std::size_t offset = row.offset.value_or(0);
    if (counts || is_clock) {
      const bool is_big = row.type.ends_with("be");
      misses.add(std::ranges::any_of(found.counters,
                                     [&](const FoundCounter& one) {
                                       return (one.is_big ? one.at + one.size : one.at) ==
                                                  (is_big ? offset + row.size : offset) ||
                                              (one.size == 1 && one.at == (is_big ? offset + row.size - 1 : offset));
                                     }),
                 counts ? "counter" : "clock");
    }
    if (row.name.starts_with("length"))
      misses.add(found.length_field && found.length_field->at == offset, "length field");
  }
}

// Returns what is not found; empty if all is.
std::string survey(const std::string& name) {
  const Capture turned = survey_capture(name, Handling::turned), rest = survey_capture(name, Handling::rest);
  const auto description = read_frames(name);
  Misses misses;
  if (const std::string lines = describe_lines(rest.bytes, name); !lines.empty()) {
    std::size_t found = 0, checked = 0, wanted = 0, wanted_checks = 0;
    for (std::size_t at = 0; (at = lines.find("[[message]]", at)) != lines.npos; ++at) ++found;
    for (std::size_t at = 0; (at = lines.find("{check:", at)) != lines.npos; ++at) ++checked;
    for (const FrameMessage& message : frame_messages(*description)) {
      wanted += message.by_settings.is_streamed;
      wanted_checks += message.by_settings.is_streamed && message.layout->has_check();
    }
    misses.add(found == wanted, "lines");
    misses.add(checked == wanted_checks, "check");
    return misses.text();
  }
  std::vector<std::byte> stream = turned.bytes;
  stream.insert(stream.end(), rest.bytes.begin(), rest.bytes.end());
  auto found = find_frames(stream, turned.bytes.size());
  if (!found) return "all";
  std::size_t most = 0;
  for (const FoundMessage& message : found->messages) {
    most = std::max(most, message.frames.size());
    for (const FrameSplit::Place& frame : message.frames)
      misses.add(frame.at >= turned.bytes.size() || std::ranges::binary_search(turned.begins, frame.at), "begin");
  }
  // The mean rate of the most frequent message, which is counted.
  const double rate_hz = survey_rate_hz * static_cast<double>(most) / (survey_turned + survey_rest);
  DescriptionText text{name, std::abs(rate_hz / survey_rate_hz - 1) < 0.01 ? survey_rate_hz : rate_hz};
  text.remarks = find_fields(*found, stream, turned.bytes.size(), text.rate_hz);
  std::vector<bool> is_taken(found->messages.size());
  const std::vector<FrameValue> delivered = FrameSettings(*description).delivered();
  for (const FrameMessage& message : frame_messages(*description)) {
    if (!message.by_settings.is_on(delivered)) continue;
    // It has this length, with the same constants.
    bool is_found = false;
    for (std::size_t m = 0; m < found->messages.size() && !is_found; ++m) {
      const FoundMessage& one = found->messages[m];
      const auto frames = frames_of(one, stream);
      const auto [match, size] = message.layout->match(frames[frames.size() / 2]);
      if (is_taken[m] || match != MessageLayout::Match::yes || size != one.length) continue;
      is_taken[m] = is_found = true;
      compare_message(*message.layout, one, misses);
    }
    misses.add(is_found, "message");
  }
  Line own(protocol_named("frame"), frame_settings(description));
  const auto truth = measured(own, turned.bytes);
  Line line = frame_line(describe_frames(*found, stream, text));
  const auto mine = measured(line, turned.bytes);
  for (const SurveyQuantity& quantity : survey_quantities)
    if (const auto values = values_of(truth, quantity); !values.empty())
      misses.add(are_alike(values_of(mine, quantity), values), quantity.name);
  return misses.text();
}

// The README of tools has this list with the reasons. A description that is not listed is found wholly.
TEST(FindSurvey, FindsShippedDescriptions) {
  const std::map<std::string_view, std::string_view> known = {
      {"anpp", "begin, message"}, {"applanix-gsof", "rate"},       {"hg1120", "rate, force, delta-velocity"},
      {"hg4930", "rate, force"},  {"kvh1775", "message"},          {"mavlink-hil", "message"},
      {"mavlink-imu", "message"}, {"novatel-raw", "length field"}, {"stim210", "rate"},
  };
  std::size_t right = 0;
  for (const ShippedFrames& shipped : shipped_frames()) {
    SCOPED_TRACE(shipped.name);
    const std::string misses = survey(std::string(shipped.name));
    const auto one = known.find(shipped.name);
    EXPECT_EQ(misses, one == known.end() ? "" : one->second);
    right += misses.empty();
  }
  EXPECT_EQ(right, 25U);
  EXPECT_EQ(shipped_frames().size(), 34U);
}

}  // namespace
}  // namespace imud
