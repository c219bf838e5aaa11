// Truth as JSON objects: paths, refusals, and the same values as another parser finds, in mutated texts, too.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>

#include "protocols/quantities/json_fields.hpp"
#include "tests/support/decode_truth.hpp"

namespace imud {
namespace {

class JsonTruth : public testing::Test {
 protected:
  void make(const std::vector<std::string>& columns = {}) {
    const TruthFormat& format = *find_truth_format("json");
    Settings settings(format.settings);
    settings.set("columns", columns);
    decoder_ = format.make(settings);
  }
  TruthResult decode(std::string_view text) {
    return decode_truth(*decoder_, std::as_bytes(std::span(text)), truth_);
  }
  std::string remark_on(std::string_view text) { return remark(*decoder_, decode(text)); }
  std::vector<TruthResult> all_of(std::string_view text, TruthInput input) {
    decoder_->feed(std::as_bytes(std::span(text)), input, {});
    std::vector<TruthResult> all;
    while (const auto result = decoder_->next(truth_)) all.push_back(*result);
    return all;
  }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
};

const std::vector<std::string> json_map = {
    "time_s=t",       "q_NB_w=att.q.0",       "q_NB_x=att.q.1",       "q_NB_y=att.q.2",
    "q_NB_z=att.q.3", "p_deg_per_s=gyro.0.x", "q_deg_per_s=gyro.0.y", "r_deg_per_s=gyro.0.z"};

TEST_F(JsonTruth, PathsLeadThroughObjectsAndArrays) {
  make(json_map);
  EXPECT_EQ(remark(*decoder_, TruthResult::no_state), "");
  ASSERT_EQ(decode(R"({"gyro":[{"z":0,"y":-90,"x":"1.8e2","w":[]},{"x":7}], "other":{"t":[1,{"a":null}]},
                       "att": {"q":[1,0.0,0e0,-0]},
                       "t": 1.500000001})"),
            TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'500'000'001);
  EXPECT_LE((truth_.omega_BN_B - Vector3(3.14159265358979323846, -1.57079632679489661923, 0)).norm(), 1e-15);
  EXPECT_FALSE(truth_.has_specific_force);
}

TEST_F(JsonTruth, NamesOfQuantitiesNeedNoMap) {
  make();
  ASSERT_EQ(decode(R"({"time_us": 5, "yaw_deg": 90, "pitch_deg": 0, "roll_deg": 0, "x": {"yaw_deg": 1}})"),
            TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 5000);
  EXPECT_FALSE(truth_.has_rate);
  ASSERT_EQ(decode(R"({"time_us":5,"yaw_deg":9,"pitch_deg":0,"roll_deg":0,"p_rpm":0,"q_rpm":0,"r_rpm":0})"),
            TruthResult::ok);
  EXPECT_TRUE(truth_.has_rate);
  ASSERT_EQ(decode(R"({"utc":"1970-01-01T00:00:02Z","yaw_deg":9,"pitch_deg":0,"roll_deg":0})"), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 2'000'000'000);
  EXPECT_EQ(remark_on(R"({"utc":"1970-01-01 00:00","yaw_deg":9,"pitch_deg":0,"roll_deg":0})"),
            R"(utc has "1970-01-01 00:00"; a date is UTC, in the form 2026-01-31T12:00:00.5Z)");
  EXPECT_EQ(remark_on(R"({"time_us": 5, "yaw_deg": 90})"),
            "with yaw, pitch, roll belong together, and missing are pitch, roll");
}

TEST_F(JsonTruth, EveryCauseAndItsRemark) {
  make(json_map);
  const std::string good = R"({"gyro":[{"x":0,"y":0,"z":0}],"att":{"q":[1,0,0,0]},"t":1})";
  EXPECT_EQ(decode(good), TruthResult::ok);
  EXPECT_EQ(remark_on(" \r\n"), "");
  EXPECT_EQ(remark_on(R"({"status":"ready"})"), R"(an object has no quantity of truth: "{"status":"ready"}")");
  EXPECT_EQ(remark_on(R"({"gyro":[{"x":0,"y":0}],"att":{"q":[1,0,0,0]}})"),
            R"(an object lacks "t" (time_s), "gyro.0.z" (r_deg_per_s))");
  EXPECT_EQ(remark_on(good.substr(0, 40)), "the text ends within an object: \"" + good.substr(0, 40) + "\"");
  EXPECT_EQ(remark_on("[1]"), "no JSON object, or something after it, at character 0: \"[1]\"");
  EXPECT_EQ(remark_on(R"({"t":nan})"), R"(no JSON object, or something after it, at character 5: "{"t":nan}")");
  EXPECT_EQ(remark_on(R"({"t":-N})"), R"(no JSON object, or something after it, at character 6: "{"t":-N}")");
  EXPECT_EQ(remark_on(R"({"T":1,"gyro":[{"x":0,"y":0,"z":0}],"att":{"q":[1,0,0,0]}})"),
            R"(an object lacks "t" (time_s; is it "T"?))");
  EXPECT_EQ(decode(good + "x"), TruthResult::not_this_kind);
  for (const std::string_view value : {"null", "true", "\"fast\"", "{}", "[1]", "1e999"}) {
    std::string bad = good;
    bad.replace(bad.find("\"y\":0") + 4, 1, value);
    EXPECT_EQ(decode(bad), TruthResult::bad_number) << bad;
    EXPECT_TRUE(remark(*decoder_, TruthResult::bad_number).starts_with("q has \"")) << bad;
  }
  EXPECT_EQ(remark_on(R"({"gyro":[{"x":1e9,"y":0,"z":0}],"att":{"q":[1,0,0,0]},"t":1})").substr(0, 10), "p is 17453");
  EXPECT_EQ(decode(R"({"gyro":[{"x":0,"y":0,"z":0}],"att":{"q":[1,1,0,0]},"t":1})"), TruthResult::out_of_range);
}

// Python's json.dumps() writes NaN and Infinity.
TEST_F(JsonTruth, NumbersThatAreNotFiniteAreNamed) {
  make(json_map);
  for (const std::string_view value : {"NaN", "Infinity", "-Infinity"}) {
    const std::string text =
        fmt::format(R"({{"gyro":[{{"x":0,"y":{},"z":0}}],"att":{{"q":[1,0,0,0]}},"t":1,"other":{}}})", value, value);
    EXPECT_EQ(decode(text), TruthResult::not_finite) << text;
    EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), fmt::format("q has \"{}\"", value));
  }
  make();
  const std::string none = R"({"time_s":1,"yaw_deg":0,"pitch_deg":0,"roll_deg":0,"fuel":-Infinity})";
  EXPECT_EQ(decode(none), TruthResult::ok);
  EXPECT_EQ(remark_on(R"({"time_s":1,"yaw_deg":NaN,"pitch_deg":0,"roll_deg":0})"), "yaw has \"NaN\"");
}

TEST_F(JsonTruth, AQuantityThatIsGivenTwiceIsRefused) {
  make();
  const std::string pose = R"({"time_s":1,"yaw_deg":0,"pitch_deg":0,"roll_deg":0,"q_rad_per_s":0,"r_rad_per_s":0,)";
  EXPECT_EQ(decode(pose + R"("p_rad_per_s":1})"), TruthResult::ok);
  for (const std::string again : {R"("p_deg_per_s":2)", R"("p_rad_per_s":2)"}) {
    const std::string text = pose + R"("p_rad_per_s":1,)" + again + "}";
    EXPECT_EQ(decode(text), TruthResult::no_columns) << again;
    EXPECT_EQ(remark(*decoder_, TruthResult::no_columns), "an object has p twice; the second is \"2\"");
  }
  make(json_map);
  EXPECT_EQ(remark_on(R"({"t":1,"gyro":[{"x":0,"y":0,"z":0}],"att":{"q":[1,0,0,0]},"t":2})"),
            "an object has time twice; the second is \"2\"");
}

TEST_F(JsonTruth, AMisspeltNameIsNamed) {
  make();
  EXPECT_EQ(remark_on(R"({"tim_s":1,"yaw_deg":0,"pitch_deg":0,"roll_deg":0})"),
            "the time is missing; give time_s, unix_time_s, utc or another; "
            "\"tim_s\" is no quantity (did you mean \"time_s\"?)");
  EXPECT_EQ(remark_on(R"({"time_s":1,"yaw":0,"pitch_deg":0,"roll_degs":0,"fuel":1})"),
            "with yaw, pitch, roll belong together, and missing are yaw, roll; "
            "\"yaw\" is no quantity (did you mean \"yaw_rad\"?); "
            "\"roll_degs\" is no quantity (did you mean \"roll_deg\"?)");
}

TEST_F(JsonTruth, RecordsOfAStreamAreLinesAndThoseOfADatagramObjects) {
  make();
  const std::string one = R"({"time_s":1,"yaw_deg":0,"pitch_deg":0,"roll_deg":0})";
  std::string spread = one;
  for (std::size_t at = 0; (at = spread.find(',', at)) != spread.npos; at += 2) spread.insert(at + 1, "\n");
  using enum TruthResult;
  using Results = std::vector<TruthResult>;
  EXPECT_EQ(all_of(one + "\n" + one + " \r\n\n" + one, TruthInput::datagram), (Results{ok, ok, ok}));
  EXPECT_EQ(all_of(spread + "\n" + one, TruthInput::datagram), (Results{ok, ok}));
  EXPECT_EQ(all_of(one + "x\n" + one, TruthInput::datagram), (Results{not_this_kind, ok}));
  EXPECT_EQ(all_of("", TruthInput::datagram), (Results{no_state}));
  EXPECT_EQ(all_of(one + "\n" + one + one + "\n" + one, TruthInput::stream), (Results{ok, not_this_kind}));
  EXPECT_EQ(all_of("\n", TruthInput::stream), (Results{ok}));
  EXPECT_EQ(all_of(spread + "\n", TruthInput::stream).size(), 4U);
}

// As Windows writes a file in UTF-8; RFC 8259, 8.1, lets a parser ignore the mark.
TEST_F(JsonTruth, AByteOrderMarkIsIgnored) {
  make();
  const std::string marked = "\xEF\xBB\xBF{\"time_s\":1,\"yaw_deg\":0,\"pitch_deg\":0,\"roll_deg\":0}";
  for (const TruthInput input : {TruthInput::stream, TruthInput::datagram})
    EXPECT_EQ(all_of(marked + "\r\n", input), std::vector{TruthResult::ok});
  EXPECT_EQ(all_of("\xEF\xBB\xBF\r\n", TruthInput::stream), std::vector{TruthResult::no_state});
  EXPECT_EQ(decode(marked.substr(1)), TruthResult::not_this_kind);
}

TEST_F(JsonTruth, AMapThatIsWrongIsRefused) {
  const auto fault = [&](const std::vector<std::string>& columns) -> std::string {
    try {
      make(columns);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_EQ(fault({"time_s=t"}),
            "columns: the attitude is missing; give q_NB_w to _z, yaw, pitch and roll, or another");
  EXPECT_EQ(fault({"time_s=t", "yaw_deg=a", "pitch_deg=a.b", "roll_deg=c"}),
            "columns: \"a.b\" is given twice, or is a part of another one's path");
  EXPECT_EQ(fault({"time_s=t", "yaw_deg=a.b", "pitch_deg=a", "roll_deg=c"}),
            "columns: \"a\" is given twice, or is a part of another one's path");
  EXPECT_EQ(fault({"time_s"}),
            "columns: \"time_s\" lacks the name that the simulator has; give our name = \"their name\"");
}

// A text that another parser accepts is read alike, with the same values; any other one is no whole object.
TEST_F(JsonTruth, AMutatedObjectIsReadAsByAnotherParser) {
  const std::string seed =
      R"({"a": {"b": [1, -2.5e-3, 30]}, "c": 0.125, "d": [[], {}, "x\n\u00e4", true, false, null, {"e": 1E+2}], "f": 7})";
  const std::string characters = "{}[]\",:.-+eE0123456789abcdeftrunls\\/ \t\n";
  const std::pair<const char*, const char*> paths[] = {
      {"r_BN_N_x_m", "/a/b/0"}, {"r_BN_N_y_m", "/a/b/1"}, {"r_BN_N_z_m", "/c"}, {"v_BN_N_x_m_per_s", "/d/6/e"}};
  std::vector<std::string> texts;
  for (const auto& [ours, path] : paths) {
    std::string theirs = path + 1;
    std::ranges::replace(theirs, '/', '.');
    texts.push_back(std::string(ours) + "=" + theirs);
  }
  JsonFields fields(parse_truth_map(texts));
  std::mt19937_64 random(3);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  std::size_t whole = 0, faulty = 0, values = 0;
  for (std::size_t n = wanted == nullptr ? 30'000 : std::strtoull(wanted, nullptr, 10); n > 0; --n) {
    std::string text = seed;
    for (std::size_t changes = below(4); changes > 0; --changes) {
      const std::size_t at = below(text.size());
      const std::size_t kind = below(3);
      if (kind == 0) text[at] = characters[below(characters.size())];
      if (kind == 1) text.insert(at, 1, characters[below(characters.size())]);
      if (kind == 2) text.erase(at, 1 + below(3));
    }
    const auto other = nlohmann::json::parse(text, nullptr, false);
    TruthReading reading;
    const auto outcome = fields.read(text, reading);
    const bool is_whole = (outcome == JsonFields::Outcome::whole || outcome == JsonFields::Outcome::refused) &&
                          text.find_first_not_of(" \t\r\n", fields.position()) == text.npos;
    ASSERT_EQ(is_whole, other.is_object()) << text;
    if (!is_whole) {
      ++faulty;
      continue;
    }
    ++whole;
    if (outcome == JsonFields::Outcome::refused || text.find('\\') != text.rfind('\\') - 2) continue;
    for (const auto& [ours, path] : paths) {
      const nlohmann::json::json_pointer pointer(path);
      const std::size_t quantity = find_truth_field(ours)->quantity;
      if (!fields.given()[quantity]) continue;  // of a name that is twice in its object, others may differ
      ++values;
      if (other.contains(pointer) && other[pointer].is_number()) {
        ASSERT_EQ(reading[quantity], other[pointer].get<double>()) << text << " at " << path;
      }
    }
  }
  EXPECT_GT(whole, faulty / 10);
  EXPECT_GT(faulty, 1000U);
  EXPECT_GT(values, 10'000U);
}

}  // namespace
}  // namespace imud
