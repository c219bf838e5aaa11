#include "emulator/watch/top_view.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <sstream>
#include <utility>

#include "emulator/watch/run_text.hpp"
#include "emulator/watch/terminal.hpp"

namespace imud {
namespace {

constexpr std::size_t most_events = 100;

// Returns words for people: "fault.begin broken, imu1, sample 1234".
std::string event_text(const Json& event) {
  std::string text = event.value("event", std::string("?"));
  for (const char* key : {"name", "imu", "text"})
    if (const auto found = event.find(key); found != event.end() && found->is_string())
      text += fmt::format("{}{}", text.find(' ') == text.npos ? " " : ", ", found->get<std::string>());
  if (const auto sample = event.find("sample"); sample != event.end())
    text += fmt::format(", sample {}", sample->dump());
  return text;
}

}  // namespace

void TopView::take(const Json& message, HostTime now) {
  heard_ = now;
  if (const auto error = message.find("error"); error != message.end()) {
    message_ = error->is_object() ? error->value("message", std::string("refused")) : "refused";
    return;
  }
  if (const std::string method = message.value("method", std::string()); !method.empty()) {
    const auto params = message.find("params");
    if (params == message.end() || !params->is_object()) return;
    if (method == "counters") interval_ = *params;
    if (method == "event") {
      events_.push_back(event_text(*params));
      if (events_.size() > most_events) events_.pop_front();
    }
    return;
  }
  const auto result = message.find("result");
  if (result == message.end() || !result->is_object()) return;
  if (result->contains("counters")) status_ = *result;
  if (result->contains("configured_faults")) configured_ = (*result)["configured_faults"];
  if (result->contains("applied")) {
    message_ = "begins";
    for (const Json& one : (*result)["applied"])
      message_ += fmt::format(", {} from sample {}", one.value("imu", std::string("?")),
                              one.value("sample", std::uint64_t{0}));
  }
}

// A number or a name of the list, or the keys of a fault.
Json TopView::execute(const std::string& words) {
  std::istringstream input(words);
  Json params = Json::object();
  for (std::string word; input >> word;) {
    if (const std::size_t equals = word.find('='); equals != word.npos && equals > 0) {
      Json value = Json::parse(word.substr(equals + 1), nullptr, false);
      params[word.substr(0, equals)] = value.is_discarded() ? Json(word.substr(equals + 1)) : value;
      continue;
    }
    for (std::size_t i = 0; i < configured_.size(); ++i)
      if (word == fmt::to_string(i + 1)) word = configured_[i].value("name", word);
    return {{"method", "fault.repeat"}, {"params", {{"name", word}}}};
  }
  if (params.empty()) return {};
  return {{"method", "fault.begin"}, {"params", std::move(params)}};
}

Json TopView::take_key(int key) {
  if (!words_) {
    if (key == 'q' || key == 'Q') quits_ = true;
    if (key == 'f' || key == 'F') words_.emplace();
    if (key == 'c' || key == 'C') return {{"method", "fault.clear"}};
    return {};
  }
  if (key == Terminal::enter) return execute(*std::exchange(words_, std::nullopt));
  if (key == Terminal::escape) words_.reset();
  if (key == Terminal::erase) {
    const auto is_continued = [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; };  // UTF-8
    while (!words_->empty() && is_continued(words_->back())) words_->pop_back();
    if (!words_->empty()) words_->pop_back();
  }
  if (key >= ' ' && key <= 0xFF) *words_ += static_cast<char>(key);
  return {};
}

std::vector<std::string> TopView::lines(HostTime now) const {
  const Json none = Json::object();
  const Json& counters = status_.contains("counters") ? status_["counters"] : none;
  std::vector<std::string> all = {fmt::format("{}: process {}, since {}, for {}, clock {}", name_,
                                              status_.value("pid", 0), status_.value("started", std::string("?")),
                                              run_time_text(counters.value("duration_s", 0.0)),
                                              status_.value("clock", std::string("?")))};
  if (std::string clock = clock_line(counters); !clock.empty()) all.push_back(std::move(clock));
  using namespace std::chrono_literals;
  if (heard_ && now - *heard_ > 3s)
    all.push_back(fmt::format("NO ANSWER for {} s: the run is stopped or too busy",
                              std::chrono::duration_cast<std::chrono::seconds>(now - *heard_).count()));
  const auto add = [&](const std::vector<std::string>& more) { all.insert(all.end(), more.begin(), more.end()); };
  if (words_) {
    all.emplace_back();
    all.emplace_back(
        "a fault begins now: a number or a name of the configuration's, or the keys of another one, such as");
    all.emplace_back("  imu=imu1 target=gyro.x kind=bias value=0.1 for_s=3");
    for (std::size_t i = 0; i < configured_.size(); ++i)
      all.push_back(fmt::format("  {} {}: {}", i + 1, configured_[i].value("name", std::string("?")),
                                configured_[i].value("text", std::string())));
  }
  all.emplace_back();
  all.emplace_back("the last second: " + truth_line(interval_));
  add(imu_lines(status_, interval_));
  all.emplace_back();
  all.emplace_back("the whole run: " + truth_line(counters));
  add(imu_lines(status_, counters));
  add(fault_lines(status_));
  if (!events_.empty()) all.emplace_back();
  for (auto event = events_.rbegin(); event != events_.rend(); ++event) all.push_back(*event);
  return all;
}

std::string TopView::bottom() const {
  if (words_) return fmt::format("fault: {}_   (Enter begins it, Esc leaves it)", *words_);
  return fmt::format("q quit   f begin a fault   c clear faults   {}", message_);
}

}  // namespace imud
