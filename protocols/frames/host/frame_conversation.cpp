// The settings and requests of a description as tables for people, and its test requests.
#include <algorithm>
#include <memory>
#include <utility>

#include "protocols/frames/host/frame_host.hpp"
#include "protocols/wire/byte_text.hpp"

namespace imud {
namespace {

using Host = FrameHostDescription;

// A unit without a sample.
class Idle final : public FrameHost::Unit {
 public:
  Reading newest() const noexcept override { return {sample_}; }
  void poll_message(std::size_t, FrameBuffer&) noexcept override {}
  void switch_messages() noexcept override {}
  void restart(DeviceTime) noexcept override {}

 private:
  Sample sample_;
};

std::string quoted_text(std::string_view text) { return '"' + visible_text(text) + '"'; }

std::vector<std::byte> copied(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

// Returns the bytes of a test; nullopt if its text is no sequence of hexadecimal bytes.
std::optional<std::vector<std::byte>> test_bytes(const std::string& text, bool is_text) {
  return is_text ? copied(text) : hex_bytes_in(text);
}

std::string difference(std::span<const std::byte> got, std::span<const std::byte> wanted, bool is_text) {
  const auto shown = [is_text](std::span<const std::byte> bytes) {
    if (bytes.empty()) return std::string("nothing");
    return is_text ? quoted_text({reinterpret_cast<const char*>(bytes.data()), bytes.size()}) : hex_text(bytes);
  };
  const auto at = std::ranges::mismatch(got, wanted).in1 - got.begin();
  return "the unit answers " + shown(got) + ", not " + shown(wanted) + ": they differ at byte " + std::to_string(at);
}

// Returns the fault of a test; nullopt if there is none. `line` is the line of the test's request, or of its copies
// for each row; with nullopt the bytes must match no request.
std::optional<std::string> fault_of(const std::shared_ptr<const FrameRequests>& requests,
                                    std::optional<std::uint32_t> line, bool is_text, bool is_text_answer,
                                    const Host::Test& test) {
  auto sent = test_bytes(test.request, is_text);
  if (!sent || sent->empty()) return "must be bytes in hexadecimal, such as \"AA 55 01\"";
  if (is_text && !test.request.ends_with('\r') && !test.request.ends_with('\n')) sent->push_back(std::byte{'\r'});
  FrameHost host(requests);
  Idle unit;
  const auto replies = std::make_unique<FrameBuffer>();
  host.receive(*sent, {}, unit, *replies);
  while (const auto due = host.deadline()) host.poll(*due, unit, *replies);
  const auto newest = host.newest_request();
  if ((newest ? std::optional(requests->all()[*newest].line) : std::nullopt) != line ||
      (line && host.unknown_bytes() != 0))
    return (is_text ? quoted_text(test.request) : test.request) +
           (line ? " is no request of this form" : " is a known request");
  std::vector<std::byte> got;
  for (const Frame& frame : replies->frames()) got.insert(got.end(), frame.bytes.begin(), frame.bytes.end());
  const auto wanted = test_bytes(test.answer, is_text_answer);
  if (!wanted) return "test_answer must be bytes in hexadecimal, such as \"AA 55 01\"";
  if (got == *wanted) return std::nullopt;
  return difference(got, *wanted, is_text_answer);
}

using Row = std::vector<std::string>;

// Adds the rows as lines, with all cells of a column padded to the same width.
void add_table(std::vector<std::string>& lines, const std::vector<Row>& rows) {
  std::vector<std::size_t> widths(rows.front().size());
  for (const Row& row : rows)
    for (std::size_t i = 0; i + 1 < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i];
      if (i + 1 < row.size()) line.append(widths[i] + 2 - row[i].size(), ' ');
    }
    line.erase(line.find_last_not_of(' ') + 1);
    lines.push_back(std::move(line));
  }
}

std::string joined(const std::vector<std::string>& words, const char* separator) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

std::string elements(const std::vector<Host::Text>& layout) {
  std::vector<std::string> words;
  for (const Host::Text& element : layout)
    if (!element.text.starts_with('@')) words.push_back(element.text);
  return joined(words, " ");
}

std::string text_of(const Host::Request& request) {
  if (request.text) return request.text->text;
  std::string text = elements(request.layout);
  const char* word = ", items ";
  for (const std::vector<Host::Text>& item : request.items) text += std::exchange(word, " or ") + elements(item);
  return text;
}

std::string text_of(const Host::Answer& answer) {
  if (!answer.text) return elements(answer.layout);
  std::string text;
  for (const char c : answer.text->text) text += c == '\r' ? "\\r" : c == '\n' ? "\\n" : std::string(1, c);
  return text;
}

std::string values_of(const Host::Setting& setting) {
  if (setting.is_range) return std::to_string(setting.lowest) + " to " + std::to_string(setting.highest);
  std::vector<std::string> words;
  for (std::size_t i = 0; i < setting.values.size(); ++i)
    words.push_back(setting.values[i] + (setting.codes.empty() ? "" : " (" + std::to_string(setting.codes[i]) + ")"));
  return joined(words, ", ");
}

std::string effect_of(const Host::Request& request) {
  std::vector<std::string> words;
  for (const Host::Choice& one : request.when)
    words.push_back("while " + one.setting + " = " + joined(one.values, "/"));
  for (const Host::Choice& one : request.set) words.push_back(one.setting + " = " + one.values.front());
  if (request.sets_captured) words.push_back("sets it");
  if (request.restores) words.push_back("settings as delivered");
  if (request.saves) words.push_back("saves the settings");
  if (request.streams) words.push_back(*request.streams ? "stream on" : "stream off");
  if (!request.poll.empty()) words.push_back("sends \"" + request.poll + "\"");
  if (request.resets) words.push_back("restarts");
  if (request.delay_ms != 0) words.push_back("after " + std::to_string(request.delay_ms) + " ms");
  return joined(words, ", ");
}

}  // namespace

void test_frame_requests(const FrameDescription& description) {
  const auto requests = std::make_shared<const FrameRequests>(description);
  std::vector<FrameFault> faults;
  for (std::size_t i = 0; i < description.host.requests.size(); ++i) {
    const Host::Request& described = description.host.requests[i];
    const bool is_text = described.layout.empty();
    const bool is_text_answer = is_text && described.answer.layout.empty() && described.otherwise.layout.empty();
    for (const Host::Test& test : described.tests)
      if (auto fault = fault_of(requests, described.line, is_text, is_text_answer, test))
        faults.push_back({test.line, "request \"" + requests->all()[i].title.substr(0, 40) + "\": test_request",
                          std::move(*fault)});
  }
  for (const Host::Unknown& described : description.host.unknown)
    for (const Host::Test& test : described.tests)
      if (auto fault = fault_of(requests, std::nullopt, false, false, test))
        faults.push_back({test.line, "unknown: test_request", std::move(*fault)});
  if (!faults.empty()) throw FrameFaults(description.file, std::move(faults));
}

std::vector<std::string> frame_request_rows(const FrameDescription& description) {
  std::vector<std::string> lines;
  const Host& host = description.host;
  if (!host.settings.empty()) {
    lines.push_back(description.name + ", settings:");
    std::vector<Row> rows = {{"name", "delivered", "without power", "allowed"}};
    const FrameSettings settings(description);
    for (std::size_t i = 0; i < settings.size(); ++i) {
      const Host::Setting& one = settings[i];
      FrameSettings::Room room;
      rows.push_back({one.name, std::string(settings.text({i, one.delivered}, room)),
                      one.is_kept ? "kept" : "lost unless saved", values_of(one)});
    }
    add_table(lines, rows);
  }
  if (!host.requests.empty()) {
    std::size_t conversations = 0;
    for (const Host::Request& one : host.requests) conversations += one.tests.size();
    lines.push_back(description.name + ", requests; " + std::to_string(conversations) +
                    (conversations == 1 ? " test conversation agrees:" : " test conversations agree:"));
    std::vector<Row> rows = {{"request", "effect", "answer"}};
    for (const Host::Request& one : host.requests) {
      rows.push_back({text_of(one), effect_of(one), text_of(one.answer)});
      if (one.otherwise.is_given()) rows.push_back({"", "a value that is not allowed", text_of(one.otherwise)});
    }
    for (const Host::Unknown& other : host.unknown)
      rows.push_back({other.layout.empty() ? "any other line" : "any other " + elements(other.layout), "",
                      text_of(other.answer)});
    add_table(lines, rows);
  }
  return lines;
}

}  // namespace imud
