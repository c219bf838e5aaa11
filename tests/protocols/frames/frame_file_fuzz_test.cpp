// Small descriptions that are put together at random from parts of the shipped ones, and changed. The environment
// variable IMUD_FUZZ_INPUTS sets their number. The seed is fixed.
#include <cstdlib>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/frames/host/frame_requests.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/random_changes.hpp"

namespace imud {
namespace {

// Parts of descriptions, as they stand in their files.
struct DescriptionParts {
  std::vector<std::string> elements;       // of layouts, with their quotation marks
  std::vector<std::string> message_lines;  // text = "...", rate_hz = ..., when = ...
  std::vector<std::string> tables;         // [line], [setting], [[request]] ...
};

// Appends the strings of the array that begins at `at`, and returns its end.
std::size_t take_strings(std::string_view text, std::size_t at, std::vector<std::string>& strings) {
  for (; at < text.size() && text[at] != ']'; ++at) {
    if (text[at] != '"') continue;
    const std::size_t first = at++;
    while (text[at] != '"') at += text[at] == '\\' ? 2 : 1;
    strings.emplace_back(text.substr(first, at + 1 - first));
  }
  return at;
}

void take_parts(std::string_view text, DescriptionParts& parts) {
  for (std::size_t at = text.find("\n["); at != text.npos;) {
    const std::size_t next = text.find("\n[", at + 1);
    const std::string_view table = text.substr(at + 1, next == text.npos ? next : next - at);
    at = next;
    if (table.find("[[message]]") != 0) {
      if (table.size() < 400) parts.tables.emplace_back(table);
      continue;
    }
    if (const std::size_t layout = table.find("\nlayout = ["); layout != table.npos)
      take_strings(table, layout + 10, parts.elements);
    for (const std::string_view key : {"\ntext = ", "\nrate_hz = ", "\nwhen = ", "\ndivider = ", "\npolled = "}) {
      const std::size_t line = table.find(key);
      if (line != table.npos)
        parts.message_lines.emplace_back(table.substr(line + 1, table.find('\n', line + 1) - line));
    }
  }
}

template <class Random>
std::string small_description(const DescriptionParts& parts, Random& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const auto any_of = [&](const std::vector<std::string>& some) -> const std::string& {
    return some[below(some.size())];
  };
  std::string text = "frame_version = 1\nname = \"t\"\n";
  if (below(4) == 0) text += "byte_order = \"big\"\n";
  if (below(3) == 0) text += any_of(parts.tables);
  for (std::size_t messages = 1 + below(2); messages > 0; --messages) {
    text += "[[message]]\nname = \"m" + std::to_string(messages) + "\"\n";
    if (below(4) == 0) text += any_of(parts.message_lines);
    if (below(8) == 0) continue;
    text += "layout = [\"@begin\", \"55 AA\", ";
    for (std::size_t elements = 1 + below(6); elements > 0; --elements) text += any_of(parts.elements) + ", ";
    text += "]\n";
  }
  if (below(3) == 0) text += any_of(parts.tables);
  return text;
}

// Each is read, or refused with a text, and what is read can be sent, decoded and asked.
TEST(FrameFileFuzz, AnySmallFileIsReadOrRefused) {
  DescriptionParts parts;
  for (const ShippedFrames& shipped : shipped_frames()) take_parts(shipped.text, parts);
  ASSERT_GE(parts.elements.size(), 500U);
  ASSERT_GE(parts.message_lines.size(), 50U);
  ASSERT_GE(parts.tables.size(), 60U);

  const char* wanted = std::getenv("IMUD_FUZZ_INPUTS");
  const long inputs = wanted != nullptr ? std::atol(wanted) : 4'000;
  constexpr std::string_view characters[] = {"@", ":", "..", "*", "+", "-", "%", "/", "^", "{", "}", "\"", "0", "99"};
  std::mt19937_64 random(17);
  const auto replies = std::make_unique<FrameBuffer>();
  long accepted = 0;
  for (long i = 0; i < inputs; ++i) {
    std::string text = small_description(parts, random);
    for (std::size_t changes = random() % 3; changes > 0 && !text.empty(); --changes)
      change_randomly(text, 8, characters, random);
    try {
      const auto description = frames_of_text(text, "test.toml");
      Line line(protocol_named("frame"), frame_settings(description));
      Recording recording;
      for (const Frame& frame : line.encode({})) line.decoder->feed(frame, recording);
      for (const std::vector<std::byte>& bytes : FrameRequests(*description).examples())
        line.device->receive({bytes}, {}, *replies);
      line.decoder->finish(recording);
      ++accepted;
    } catch (const ConfigError& error) {
      ASSERT_FALSE(error.faults.empty()) << text;
    }
  }
  EXPECT_GT(accepted, inputs / 20);
}

}  // namespace
}  // namespace imud
