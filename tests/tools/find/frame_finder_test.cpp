// The finder recovers what the shipped descriptions say from captures alone.
#include "tools/find/frame_finder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "protocols/frames/host/frame_requests.hpp"
#include "tests/tools/find/find_unit.hpp"

namespace imud {
namespace {

// A check as the rows of a layout have it: "check sum8 of 2-17".
std::string row_of(const FoundCheck& check) {
  std::string text = "check " + check.forms.front().name + " of";
  for (const auto& [begin, end] : check.ranges_of(check.forms.front())) text += fmt::format(" {}-{}", begin, end - 1);
  if (!check.forms.front().extra.empty()) text += fmt::format(", then {} bytes", check.forms.front().extra.size());
  return text;
}

std::string number_row(std::size_t at, std::size_t size, bool is_big, std::string_view what) {
  return fmt::format("{}+{}{} {}", at, size, size == 1 ? "" : is_big ? " be" : " le", what);
}

const FoundMessage* message_of(const FoundFrames& found, std::size_t length) {
  const auto it = std::ranges::find(found.messages, length, &FoundMessage::length);
  return it == found.messages.end() ? nullptr : &*it;
}

// Each length, check, counter and clock of the description is found, where it is.
void expect_described(const FoundFrames& found, std::string_view name, bool is_whole) {
  const auto description = read_frames(std::string(name));
  const std::vector<FrameValue> as_delivered = FrameRequests(*description).delivered();
  for (const FrameMessage& message : frame_messages(*description)) {
    SCOPED_TRACE(message.name);
    if (!message.by_settings.is_on(as_delivered)) continue;
    const FoundMessage* got = message_of(found, message.layout->longest());
    ASSERT_NE(got, nullptr);
    std::vector<std::string> wanted_checks, checks;
    for (const FoundCheck& check : got->checks) {
      checks.push_back(number_row(check.at, check.size, check.is_big, row_of(check)));
      if (is_whole) {
        EXPECT_EQ(check.agreeing, check.compared);
      }
    }
    for (const MessageLayout::Row& row : message.layout->rows()) {
      const std::size_t offset = row.offset.value_or(0);
      const bool is_big = row.type.ends_with("be");
      if (row.name.starts_with("check")) wanted_checks.push_back(number_row(offset, row.size, is_big, row.name));
      if (row.name.starts_with("length")) {
        ASSERT_TRUE(got->length_field);
        EXPECT_EQ(number_row(got->length_field->at, got->length_field->size, got->length_field->is_big, ""),
                  number_row(offset, row.size, is_big, ""));
      }
      const bool counts = row.name.find("counter") != row.name.npos && row.type != "u8 be";
      if (!counts && !row.name.starts_with("time") && !row.name.starts_with("gps_time_of_week")) continue;
      const auto counter = std::ranges::find_if(got->counters, [&](const FoundCounter& one) {
        // A number whose high bytes do not change is seen by its low ones only.
        const std::size_t low = one.is_big ? one.at + one.size - 1 : one.at;
        return low == (is_big ? offset + row.size - 1 : offset) && one.size <= row.size &&
               (one.size == 1 || one.is_big == is_big);
      });
      EXPECT_NE(counter, got->counters.end()) << row.name;
      if (counts && counter != got->counters.end()) {
        EXPECT_EQ(counter->step, 1) << row.name;
        EXPECT_EQ(counter->modulus, row.name.ends_with("%128") ? 128U : 0U) << row.name;
      }
    }
    EXPECT_EQ(checks, wanted_checks);
  }
}

TEST(FrameFinder, FindsShippedDescriptionsAtRest) {
  for (const std::string_view shipped : captured_descriptions) {
    SCOPED_TRACE(shipped);
    const Capture capture = shipped_capture(shipped, Handling::rest);
    const auto found = find_frames(capture.bytes);
    ASSERT_TRUE(found);
    EXPECT_GT(found->coverage, 0.99);
    EXPECT_TRUE(found->is_checked);
    expect_described(*found, shipped, true);
    // Frames begin where they begin.
    for (const FoundMessage& message : found->messages)
      for (const FrameSplit::Place& frame : message.frames)
        ASSERT_TRUE(std::ranges::binary_search(capture.begins, frame.at)) << frame.at;
  }
}

TEST(FrameFinder, FindsShippedDescriptionsInDamagedCaptures) {
  for (const std::string_view shipped : captured_descriptions) {
    SCOPED_TRACE(shipped);
    const auto found = find_frames(damaged(shipped_capture(shipped, Handling::turned), 25));
    ASSERT_TRUE(found);
    EXPECT_GT(found->coverage, 0.85);
    expect_described(*found, shipped, false);
  }
}

// A capture begins anywhere.
TEST(FrameFinder, FindsWhereFramesBegin) {
  for (const std::string_view shipped : captured_descriptions) {
    SCOPED_TRACE(shipped);
    Capture capture = shipped_capture(shipped, Handling::turned, 400);
    const std::size_t lost = capture.begins[1] / 3 + 2;
    capture.bytes.erase(capture.bytes.begin(), capture.bytes.begin() + static_cast<std::ptrdiff_t>(lost));
    const auto found = find_frames(capture.bytes);
    ASSERT_TRUE(found);
    for (const FoundMessage& message : found->messages)
      for (const FrameSplit::Place& frame : message.frames)
        ASSERT_TRUE(std::ranges::binary_search(capture.begins, frame.at + lost)) << frame.at;
  }
}

// Constant bytes that end text or mark an end, and could be no header, do not begin a frame.
TEST(FrameFinder, FindsFramesThatConstantBytesEnd) {
  for (const char* elements :
       {"@begin\n55 "
        "AA\nalive_counter:u8\nrate_x_deg_per_s:i16*0.01\nspecific_force_z_mg:i16\nrate_y_deg_per_s:i16*0.01\n"
        "check:sum8:@begin..\n",
        "55 AA\n@begin\nalive_counter:u8\nrate_x_deg_per_s:i16*0.01\nspecific_force_z_mg:i16\n"
        "check:crc16/xmodem:@begin..\n",
        "55 AA\n@begin\nrate_x_deg_per_s:i16*0.01\nspecific_force_z_mg:i16\nspecific_force_y_mg:i16\n"})
    for (const char* end : {"0D", "0D 0A", "03", ""}) {
      SCOPED_TRACE(std::string(elements) + end);
      Line line = frame_line(one_message(std::string(elements) + end));
      const Capture capture = capture_of(line, handled_samples(Handling::turned, 400, 100));
      const auto found = find_frames(capture.bytes);
      ASSERT_TRUE(found);
      ASSERT_EQ(found->messages.size(), 1U);
      EXPECT_EQ(found->messages[0].frames.front().at, 0U);
    }
}

// Two captures of one sensor: a counter that begins again in the second one has no modulus.
TEST(FrameFinder, CountsInEachOfTwoCaptures) {
  const Capture one = shipped_capture("dmu", Handling::turned, 400);
  std::vector<std::byte> both = one.bytes;
  both.insert(both.end(), one.bytes.begin(), one.bytes.end());
  const auto found = find_frames(both, one.bytes.size());
  ASSERT_TRUE(found);
  ASSERT_EQ(found->messages.size(), 1U);
  ASSERT_FALSE(found->messages[0].counters.empty());
  EXPECT_EQ(found->messages[0].counters[0].modulus, 0U);
  EXPECT_EQ(found->messages[0].counters[0].share, 1);
}

struct Product {
  const char *name, *settings;
  double rate_hz;
  std::vector<const char*> checks;
};

TEST(FrameFinder, FindsProducts) {
  const Product products[] = {
      {"stim300", "", 2000, {"check crc32/mpeg-2 of 0-54, then 1 bytes"}},
      {"stim300",
       "acceleration=false inclination=false temperature=false",
       2000,
       {"check crc32/mpeg-2 of 0-13, then 2 bytes"}},
      {"vectornav", "async_type=0 binary_1=1,8,01,0129", 800, {"check crc16/xmodem of 1-47"}},
      {"mip", "", 1000, {"check fletcher8 of 0-51"}},
  };
  for (const Product& product : products) {
    SCOPED_TRACE(std::string(product.name) + " " + product.settings);
    for (const Handling handling : {Handling::rest, Handling::turned}) {
      const Capture capture = product_capture(product.name, product.settings, handling, 1, product.rate_hz);
      const auto found = find_frames(capture.bytes);
      ASSERT_TRUE(found);
      ASSERT_EQ(found->messages.size(), 1U);
      std::vector<std::string> checks;
      for (const FoundCheck& check : found->messages[0].checks) checks.push_back(row_of(check));
      EXPECT_EQ(checks, std::vector<std::string>(product.checks.begin(), product.checks.end()));
      EXPECT_TRUE(std::ranges::binary_search(capture.begins, found->messages[0].frames.front().at));
    }
  }
}

TEST(FrameFinder, FindsNothingInRandomBytes) {
  std::mt19937_64 random(5);
  EXPECT_FALSE(find_frames(random_bytes(200'000, random)));
  EXPECT_FALSE(find_frames({}));
  EXPECT_FALSE(find_frames(std::vector<std::byte>(100'000)));
}

// A product without a check: the frames are found, and no check is.
TEST(FrameFinder, FindsNoCheckWhereThereIsNone) {
  Line line =
      frame_line(one_message("55 AA\nalive_counter:u8\nrate_x_deg_per_s:i16*0.01\nrate_y_deg_per_s:i16*0.01\n"
                             "rate_z_deg_per_s:i16*0.01\nspecific_force_x_mg:i16\nspecific_force_y_mg:i16\n"
                             "specific_force_z_mg:i16\n_:2"));
  for (const Handling handling : {Handling::rest, Handling::turned}) {
    const Capture capture = capture_of(line, handled_samples(handling, 1000, 100));
    const auto found = find_frames(capture.bytes);
    ASSERT_TRUE(found);
    EXPECT_FALSE(found->is_checked);
    ASSERT_EQ(found->messages.size(), 1U);
    const FoundMessage& message = found->messages[0];
    EXPECT_EQ(message.length, 17U);
    EXPECT_TRUE(message.checks.empty()) << row_of(message.checks.front());
    EXPECT_EQ(message.frames.front().at, 0U);
    ASSERT_EQ(message.counters.size(), 1U);
    EXPECT_EQ(message.counters[0].at, 2U);
  }
}

}  // namespace
}  // namespace imud
