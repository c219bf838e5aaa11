#include "emulator/watch/run_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

namespace imud {
namespace {

std::string text_of(const Json& object, const char* key) { return object.value(key, std::string("?")); }

std::string count(const Json& object, const char* key) { return fmt::to_string(object.value(key, std::uint64_t{0})); }

double number(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : 0.0;
}

// Returns the reason why frames of the imu do not reach their reader; empty if they do.
std::string hindrance(const Json& imu) {
  std::string state = imu.value("port_state", std::string("ready"));
  std::replace(state.begin(), state.end(), '_', ' ');
  std::string text = state == "ready" ? "" : ", " + state;
  if (imu.value("power", std::string("on")) != "on") text += ", power off";
  if (imu.value("paused", false)) text += ", paused";
  return text;
}

}  // namespace

std::string printable(std::string text) {
  const auto byte_at = [&text](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned byte = byte_at(i), next = byte_at(i + 1);
    if (byte == 0xC2 && next >= 0x80 && next < 0xA0) text.replace(i, 2, "?");  // in UTF-8
    if ((byte < 0x20 && byte != '\n') || byte == 0x7F) text[i] = '?';
  }
  return text;
}

std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows,
                                     const std::vector<std::size_t>& left) {
  std::vector<std::string> lines;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      std::size_t width = 0;
      for (const auto& other : rows) width = std::max(width, other[i].size());
      const bool is_left = std::ranges::find(left, i) != left.end();
      if (i > 0) line += "  ";
      line += is_left ? fmt::format("{:<{}}", row[i], width) : fmt::format("{:>{}}", row[i], width);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    lines.push_back(std::move(line));
  }
  return lines;
}

std::string run_time_text(double duration_s) {
  const auto all = static_cast<std::uint64_t>(std::max(0.0, duration_s));
  constexpr std::uint64_t day = 86400, hour = 3600, minute = 60;
  return fmt::format("{}{}:{:02}:{:02}", all < day ? "" : fmt::format("{} d ", all / day), all % day / hour,
                     all % hour / minute, all % minute);
}

std::vector<std::string> imu_lines(const Json& status, const Json& counters) {
  std::vector<std::vector<std::string>> rows = {{"IMU", "PRODUCT", "HZ SET", "HZ", "SAMPLES", "SENT", "DROPPED",
                                                 "MISSED", "LATE P50", "P99", "MAX us", "PORT"}};
  const Json none = Json::object(), no_imus = Json::array();
  const Json& figures = counters.contains("imus") ? counters["imus"] : no_imus;
  const double duration_s = number(counters, "duration_s");
  for (const Json& imu : status.contains("imus") ? status["imus"] : no_imus) {
    const std::string name = text_of(imu, "name");
    const auto found = std::ranges::find_if(figures, [&](const Json& one) { return text_of(one, "name") == name; });
    const Json& of_imu = found == figures.end() ? none : *found;
    const Json& late = of_imu.contains("lateness_us") ? of_imu["lateness_us"] : none;
    const double rate_hz = duration_s > 0 ? number(of_imu, "samples") / duration_s : 0;
    rows.push_back({name, text_of(imu, "protocol"), fmt::format("{:g}", number(imu, "rate_hz")),
                    fmt::format("{:.1f}", rate_hz), count(of_imu, "samples"), count(of_imu, "frames"),
                    count(of_imu, "dropped"), count(of_imu, "missed"), fmt::format("{:.1f}", number(late, "p50")),
                    fmt::format("{:.1f}", number(late, "p99")), fmt::format("{:.1f}", number(late, "max")),
                    text_of(imu, "port") + hindrance(imu)});
  }
  return table_lines(rows, {0, 1, rows[0].size() - 1});
}

std::string truth_line(const Json& counters) {
  const Json none = Json::object();
  const Json& truth = counters.contains("truth") ? counters["truth"] : none;
  std::string refused;
  for (const auto& [cause, n] : (truth.contains("refused") ? truth["refused"] : none).items())
    refused += fmt::format("{}{} {}", refused.empty() ? "" : ", ", n.dump(), cause);
  return fmt::format("truth {:.1f} Hz, {} accepted, {} lost, refused: {}", number(truth, "rate_hz"),
                     count(truth, "accepted"), count(truth, "lost"), refused.empty() ? "none" : refused);
}

std::string clock_line(const Json& counters) {
  if (!counters.contains("clock")) return {};
  const Json& clock = counters["clock"];
  std::string line = fmt::format("grids on {}", text_of(clock, "epoch"));
  if (clock.value("synchronised", false))
    line += fmt::format(", clock error {} us", count(clock, "error_us"));
  else if (clock.contains("synchronised"))
    line += clock.contains("error_us") ? ", clock not synchronised" : ", clock error not known";
  line += fmt::format(", {} steps", count(clock, "steps"));
  const Json none = Json::array();
  for (const Json& imu : counters.contains("imus") ? counters["imus"] : none)
    if (imu.contains("first_k")) line += fmt::format(", {} from k {}", text_of(imu, "name"), count(imu, "first_k"));
  return line;
}

std::vector<std::string> fault_lines(const Json& status) {
  std::vector<std::string> lines;
  const Json none = Json::array();
  for (const Json& fault : status.contains("faults") ? status["faults"] : none)
    lines.push_back(fmt::format("fault {}: {} of {}, imu {}, since sample {}", text_of(fault, "name"),
                                text_of(fault, "kind"), text_of(fault, "target"), text_of(fault, "imu"),
                                count(fault, "sample")));
  return lines;
}

}  // namespace imud
