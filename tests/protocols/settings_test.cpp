#include "protocols/settings.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace imud {
namespace {

constexpr std::string_view colours[] = {"red", "green"};
constexpr std::string_view initial_list[] = {"a", "b"};
constexpr Setting declared[] = {
    {.key = "flag", .help = "", .initial = true},
    {.key = "integer", .help = "", .initial = std::int64_t{5}, .min = -10, .max = 0x7FF},
    {.key = "real", .help = "", .initial = 1.5, .min = 0.5, .max = 2},
    {.key = "free_real", .help = "", .initial = 0.0},
    {.key = "text", .help = "", .initial = std::string_view("hello")},
    {.key = "colour", .help = "", .initial = std::string_view("red"), .choices = colours},
    {.key = "list", .help = "", .initial = std::span<const std::string_view>(initial_list)},
};
using List = std::vector<std::string>;

// Returns the message of the refusal of `change`; "" if it is accepted.
template <class Change>
std::string refusal(Change change) {
  Settings settings(declared);
  try {
    change(settings);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Settings, BeginWithTheInitialValues) {
  const Settings settings(declared);
  EXPECT_TRUE(settings.flag("flag"));
  EXPECT_EQ(settings.integer("integer"), 5);
  EXPECT_EQ(settings.real("real"), 1.5);
  EXPECT_EQ(settings.text("text"), "hello");
  EXPECT_EQ(settings.list("list"), (List{"a", "b"}));
}

TEST(Settings, TakeValues) {
  Settings settings(declared);
  settings.set("flag", false);
  settings.set("integer", std::int64_t{-10});
  settings.set("real", 2.0);
  settings.set("text", std::string());
  settings.set("colour", std::string("green"));
  settings.set("list", List{});
  EXPECT_FALSE(settings.flag("flag"));
  EXPECT_EQ(settings.integer("integer"), -10);
  EXPECT_EQ(settings.real("real"), 2.0);
  EXPECT_EQ(settings.text("text"), "");
  EXPECT_EQ(settings.text("colour"), "green");
  EXPECT_TRUE(settings.list("list").empty());
  settings.set("real", std::int64_t{1});
  EXPECT_EQ(settings.real("real"), 1.0);
}

TEST(Settings, TakeTexts) {
  Settings settings(declared);
  settings.set_text("flag", "false");
  settings.set_text("integer", "0x7F");
  settings.set_text("real", "0.75");
  settings.set_text("free_real", "-1e300");
  settings.set_text("text", "a,b ");
  settings.set_text("list", "time_ns, sigma 1 ,,x");
  EXPECT_FALSE(settings.flag("flag"));
  EXPECT_EQ(settings.integer("integer"), 127);
  EXPECT_EQ(settings.real("real"), 0.75);
  EXPECT_EQ(settings.real("free_real"), -1e300);
  EXPECT_EQ(settings.text("text"), "a,b ");
  EXPECT_EQ(settings.list("list"), (List{"time_ns", "sigma 1", "", "x"}));
  settings.set_text("integer", "-0xA");
  EXPECT_EQ(settings.integer("integer"), -10);
  settings.set_text("list", "");
  EXPECT_TRUE(settings.list("list").empty());
}

TEST(Settings, RefusalsNameTheValidValues) {
  EXPECT_EQ(refusal([](Settings& s) { s.set("colr", true); }),
            "unknown setting \"colr\"; the settings are flag, integer, real, free_real, text, colour, list");
  EXPECT_EQ(refusal([](Settings& s) { s.set_text("colr", "1"); }),
            "unknown setting \"colr\"; the settings are flag, integer, real, free_real, text, colour, list");
  EXPECT_EQ(refusal([](Settings& s) { s.set("flag", std::int64_t{1}); }), "flag: must be true or false");
  EXPECT_EQ(refusal([](Settings& s) { s.set("integer", std::int64_t{2048}); }),
            "integer: must be an integer from -10 to 2047");
  EXPECT_EQ(refusal([](Settings& s) { s.set("real", 0.25); }), "real: must be a finite number from 0.5 to 2");
  EXPECT_EQ(refusal([](Settings& s) { s.set("colour", std::string("blue")); }), "colour: must be one of red, green");
  EXPECT_EQ(refusal([](Settings& s) { s.set("text", true); }), "text: must be a text");
  EXPECT_EQ(refusal([](Settings& s) { s.set("list", std::string("a")); }),
            "list: must be a list of texts, such as [\"a\", \"b\"]");
  Settings none;
  EXPECT_THROW(none.set("x", true), std::invalid_argument);
}

TEST(Settings, RefuseOtherTypesAndTexts) {
  for (const SettingValue& wrong : {SettingValue(true), SettingValue(1.0), SettingValue(std::string("1"))})
    EXPECT_NE(refusal([&](Settings& s) { s.set("integer", wrong); }), "");
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    EXPECT_NE(refusal([&](Settings& s) { s.set("free_real", wrong); }), "");
  for (const std::string_view wrong : {"", "1.5", "0x", "--1", "0x-1", "-0x-1", "1 ", "99999999999999999999", "abc"})
    EXPECT_NE(refusal([&](Settings& s) { s.set_text("integer", wrong); }), "") << wrong;
  for (const std::string_view wrong : {"", "1,5", "nan", "inf", "1e999", "x"})
    EXPECT_NE(refusal([&](Settings& s) { s.set_text("free_real", wrong); }), "") << wrong;
  EXPECT_NE(refusal([](Settings& s) { s.set_text("flag", "yes"); }), "");
}

TEST(Settings, ARefusedValueChangesNothing) {
  Settings settings(declared);
  EXPECT_THROW(settings.set("integer", std::int64_t{5000}), std::invalid_argument);
  EXPECT_EQ(settings.integer("integer"), 5);
}

TEST(Settings, ReadingWhatIsNotDeclaredIsAProgrammingError) {
  const Settings settings(declared);
  EXPECT_THROW(settings.flag("nothing"), std::logic_error);
  EXPECT_THROW(settings.flag("integer"), std::logic_error);
  EXPECT_THROW(settings.real("integer"), std::logic_error);
}

}  // namespace
}  // namespace imud
