#include "tools/find/capture_kind.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string_view>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/frames/layout/frame_escape.hpp"

namespace imud {
namespace {

using Stream = std::span<const std::byte>;

constexpr std::size_t fewest_escaped = 16;  // frames
constexpr std::size_t fewest_lines = 8;
constexpr std::size_t most_bytes_looked_at = 256 * 1024;

// The share of the frames that have one of the most frequent lengths.
double share_of_lengths(const std::map<std::size_t, std::size_t>& lengths) {
  constexpr std::size_t most_lengths_taken = 8, shortest = 4;
  std::vector<std::size_t> counts;
  std::size_t all = 0, taken = 0;
  for (const auto& [length, count] : lengths) {
    all += count;
    if (length >= shortest) counts.push_back(count);
  }
  std::ranges::sort(counts, std::greater<>{});
  for (std::size_t i = 0; i < std::min(counts.size(), most_lengths_taken); ++i) taken += counts[i];
  return all == 0 ? 0 : static_cast<double>(taken) / static_cast<double>(all);
}

// The number of bytes that stand for another one.
std::size_t escaped_bytes(Stream bytes, FrameEscape escape) {
  const auto pairs = [bytes](unsigned first, unsigned second) {
    std::size_t count = 0;
    for (std::size_t i = 0; i + 1 < bytes.size(); ++i)
      count += bytes[i] == static_cast<std::byte>(first) && bytes[i + 1] == static_cast<std::byte>(second);
    return count;
  };
  switch (escape) {
    case FrameEscape::slip:
      return pairs(0xDB, 0xDC) + pairs(0xDB, 0xDD);
    case FrameEscape::hdlc:
      return pairs(0x7D, 0x5E) + pairs(0x7D, 0x5D);
    case FrameEscape::dle:
      return pairs(0x10, 0x10);
    default:
      return 1;  // COBS has a code in each frame
  }
}

// A character of a number: it may differ from line to line.
bool is_numeric(char c) { return (c >= '0' && c <= '9') || c == '-' || c == '+' || c == '.'; }
bool is_hexadecimal(char c) { return is_numeric(c) || (c >= 'A' && c <= 'F'); }

// Returns the line with `#` in place of each number. `is_digit` returns true for a character that numbers have.
std::string shape_of(std::string_view line, bool (*is_digit)(char)) {
  std::string shape;
  for (const char c : line)
    if (!is_digit(c))
      shape += c;
    else if (shape.empty() || shape.back() != '#')
      shape += '#';
  return shape;
}

// Returns the part of the text that a comment may contain.
std::string shown(std::string_view text) {
  constexpr std::size_t longest_shown = 200;
  std::string all(text.substr(0, longest_shown));
  for (char& c : all)
    if (c < ' ' || c > '~') c = '?';
  return all;
}

// Returns true if the two digits behind the '*' are the exclusive or of what NMEA 0183 checks.
bool has_nmea_check(std::string_view line) {
  const std::size_t star = line.rfind('*');
  if (line.empty() || star == line.npos || star + 3 > line.size()) return false;
  unsigned sum = 0;
  for (const char c : line.substr(1, star - 1)) sum ^= static_cast<unsigned char>(c);
  return line.substr(star + 1, 2) == fmt::format("{:02X}", sum);
}

struct Lines {
  std::size_t count = 0, checked = 0;
  std::string example;
};

// Returns the kinds of lines, by their shapes.
std::map<std::string, Lines> shapes_of(std::span<const std::string_view> lines, bool (*is_digit)(char)) {
  std::map<std::string, Lines> shapes;
  for (const std::string_view line : lines) {
    // The digits of a check may be letters.
    const bool is_checked = has_nmea_check(line);
    Lines& kind = shapes[shape_of(is_checked ? line.substr(0, line.rfind('*') + 1) : line, is_digit)];
    ++kind.count;
    kind.checked += is_checked;
    kind.example = line;
  }
  return shapes;
}

}  // namespace

std::optional<FrameEscape> find_escape(Stream capture) {
  const Stream head = capture.first(std::min(capture.size(), most_bytes_looked_at));
  constexpr double most_skipped = 0.03, least_share = 0.9;
  for (const FrameEscape escape : {FrameEscape::slip, FrameEscape::hdlc, FrameEscape::dle, FrameEscape::cobs}) {
    if (escaped_bytes(head, escape) == 0) continue;
    const auto reader = std::make_unique<EscapeReader>(escape);
    std::map<std::size_t, std::size_t> lengths;
    std::size_t frames = 0;
    for (const std::byte one : head)
      if (reader->take(one)) {
        ++frames;
        ++lengths[reader->content().size()];
      }
    if (frames >= fewest_escaped && share_of_lengths(lengths) >= least_share &&
        static_cast<double>(reader->take_skipped()) <= most_skipped * static_cast<double>(head.size()))
      return escape;
  }
  return std::nullopt;
}

std::vector<std::byte> without_escape(Stream capture, FrameEscape escape) {
  const auto reader = std::make_unique<EscapeReader>(escape);
  std::vector<std::byte> contents;
  for (const std::byte one : capture)
    if (reader->take(one)) contents.insert(contents.end(), reader->content().begin(), reader->content().end());
  return contents;
}

std::string describe_lines(Stream capture, const std::string& source) {
  const Stream head = capture.first(std::min(capture.size(), most_bytes_looked_at));
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  constexpr double least_printable = 0.98;
  const auto printable = std::ranges::count_if(
      text, [](char c) { return (c >= ' ' && c <= '~') || c == '\r' || c == '\n' || c == '\t'; });
  if (text.empty() || static_cast<double>(printable) < least_printable * static_cast<double>(text.size())) return "";
  std::vector<std::string_view> lines;
  // The first line may be incomplete.
  for (std::size_t begin = text.find('\n'), end; begin < text.size(); begin = end) {
    end = text.find('\n', begin + 1);
    if (end == text.npos) break;
    lines.push_back(text.substr(begin + 1, end - begin - 1));
    if (lines.back().ends_with('\r')) lines.back().remove_suffix(1);
  }
  const std::size_t all = lines.size();
  if (all < fewest_lines) return "";
  std::map<std::string, Lines> shapes = shapes_of(lines, is_numeric);
  // Hexadecimal numbers would look like many kinds of lines.
  if (auto others = shapes_of(lines, is_hexadecimal); 4 * others.size() <= shapes.size()) shapes = std::move(others);
  std::vector<const std::pair<const std::string, Lines>*> order;
  for (const auto& one : shapes) order.push_back(&one);
  std::ranges::stable_sort(order, [](const auto* a, const auto* b) { return a->second.count > b->second.count; });
  std::string out = fmt::format(
      "# The capture is text: {} lines are in {}. Write message.text for each kind of line, with {{NAME:FORMAT}} in\n"
      "# place of #; the README of protocols/frames has the formats (\"A line of text\").\n"
      "frame_version = 1\nname = \"unknown\"\n",
      all, source);
  constexpr std::size_t most_kinds = 16;
  for (std::size_t i = 0; i < std::min(order.size(), most_kinds); ++i) {
    const auto& [shape, kind] = *order[i];
    const bool is_checked = kind.checked == kind.count;
    out += fmt::format("\n# {} lines such as: {}\n# [[message]]\n# name = \"line {}\"\n# text = \"{}{}{}\"\n",
                       kind.count, shown(kind.example), i + 1, shown(shape), is_checked ? "{check:xor8}" : "",
                       text.find('\r') == text.npos ? "\\n" : "\\r\\n");
  }
  return out;
}

}  // namespace imud
