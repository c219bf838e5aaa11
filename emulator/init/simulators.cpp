#include "emulator/init/simulators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "emulator/config/config_parts.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/init/data_folders.hpp"
#include "emulator/init/example.hpp"
#include "protocols/truth_format.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr std::string_view start_mark = "# start: ", file_mark = "# file: ", place_mark = "# place: inertial\n";

// Returns the rest of the line that begins at `at`.
std::string_view line_at(std::string_view text, std::size_t at) {
  return at == text.npos ? std::string_view() : text.substr(at, text.find('\n', at) - at);
}

// Returns the text with `number` in place of another number.
std::string with_number(std::string_view text, const std::string& old, const std::string& number) {
  return std::regex_replace(std::string(text), std::regex("\\b" + old + "\\b"), number);
}

// Returns the text with the paths that imud's own files have on this machine.
std::string with_paths(std::string_view text) {
  static const std::regex path("tools/bridges/[\\w/.]+");
  const std::string all(text);
  std::string out;
  auto end = all.cbegin();
  for (std::sregex_iterator match(all.begin(), all.end(), path), none; match != none; ++match) {
    out.append(end, (*match)[0].first).append(data_path(match->str()));
    end = (*match)[0].second;
  }
  return out.append(end, all.cend());
}

// Returns the text with another truth.port, and its number in what to start, or the advice to change it in `file`.
ChosenTruth with_port(ChosenTruth truth, const std::string& port, const std::string& file = {}) {
  static const std::regex given("(\n|^)(port +=|port =) \"([^\"]*)\"");
  std::smatch match;
  if (port.empty() || !std::regex_search(truth.toml, match, given)) return truth;
  const std::string old = match[3];
  const std::size_t begin = old.find_last_not_of("0123456789") + 1;
  const std::string number = old.substr(begin);
  const bool is_number = port.find_first_not_of("0123456789") == port.npos;
  if (is_number && number.empty()) throw OpenError(fmt::format("{} has no number; give a port", old));
  const std::string address = port.substr(0, port.find('?'));  // without options
  const std::size_t digits = address.find_last_not_of("0123456789") + 1;
  const std::string text = is_number ? old.substr(0, begin) + port : port;
  const auto quote = static_cast<std::size_t>(match.position(3)) - 1;
  truth.toml.replace(quote, old.size() + 2, toml_word(text));
  if (!number.empty() && digits < address.size() && file.empty())
    truth.start = with_number(truth.start, number, address.substr(digits));
  else if (!file.empty() && digits < address.size() && address.substr(digits) != number)
    truth.start += fmt::format(" (copy {} and set its port to {}; it has {})", file.substr(file.rfind('/') + 1),
                               address.substr(digits), number);
  return truth;
}

// Counts how many of the first records of a capture are truths of a format, less the number of refused ones.
int fitness(const TruthFormat& format, const std::string& port) try {
  constexpr int enough = 200;
  const auto decoder = format.make(Settings(format.settings));
  const auto source = open_port(port, PortSettings(Role::listener));
  const bool has_datagrams = source->keeps_datagrams().value_or(transport_of(port)->keeps_datagrams);
  int sum = 0;
  for (int reads = 0; reads < enough && !source->at_end(); ++reads) {
    const auto received = source->receive();
    if (!received) continue;
    decoder->feed(received->frame.bytes,
                  has_datagrams && !received->is_piece ? TruthInput::datagram : TruthInput::stream, received->time);
    Truth truth;
    while (const auto result = decoder->next(truth))
      if (*result != TruthResult::no_state) sum += *result == TruthResult::ok ? 1 : -1;
  }
  return sum;
} catch (const std::exception&) {
  return 0;  // the format needs settings
}

// Returns the truth of a capture, by the format that fits it best. Rows of numbers fit formats without names of
// columns, too: if two formats fit equally well, the format with names is chosen.
ChosenTruth of_capture(const std::string& capture) {
  const std::string port = capture_port(capture);
  const TruthFormat* best = nullptr;
  int most = 0;
  for (const TruthFormat* format : truth_formats())
    if (const int fit = fitness(*format, port);
        fit > most || (fit == most && best != nullptr && best->columns.empty() && !format->columns.empty())) {
      most = fit;
      best = format;
    }
  if (best == nullptr) throw OpenError(fmt::format("{}: no truth format fits it with its default settings", capture));
  return {truth_text(*best, port), "", false,
          fmt::format("The first records of {} fit the truth format {}: if they are of another, change it.", capture,
                      best->name)};
}

}  // namespace

std::string_view Simulator::summary() const noexcept { return line_at(text, 2); }

std::string_view Simulator::start() const noexcept {
  return line_at(text, text.find(start_mark) + start_mark.size());
}

std::string_view Simulator::file() const noexcept {
  const std::size_t at = text.find(file_mark);
  return at == text.npos ? std::string_view() : line_at(text, at + file_mark.size());
}

bool Simulator::is_inertial() const noexcept { return text.find(place_mark) != text.npos; }

std::string_view Simulator::toml() const noexcept {
  std::string_view rest = text;
  while (rest.starts_with('#')) rest.remove_prefix(rest.find('\n') + 1);
  return rest;
}

ChosenTruth choose_truth(const std::string& from, const std::string& port) {
  for (const Simulator& simulator : simulators())
    if (simulator.name == from)
      return with_port({fmt::format("# {}\n{}", simulator.summary(), simulator.toml()), with_paths(simulator.start()),
                        simulator.is_inertial()},
                       port, std::string(simulator.file()));
  if (const TruthFormat* format = find_truth_format(from))
    return with_port({truth_text(*format), fmt::format("the simulator that sends {}", format->summary), false}, port);
  std::error_code none;
  const Transport* transport = transport_of(from);
  if (std::filesystem::is_regular_file(from, none) || (transport != nullptr && transport->ends)) {
    if (!port.empty())
      throw OpenError(fmt::format("{} is a capture, from which --truth takes no port; give --from {}?port=NUMBER",
                                  from, transport != nullptr ? from : capture_port(from)));
    return of_capture(from);
  }
  std::vector<std::string> known;
  for (const Simulator& simulator : simulators()) known.emplace_back(simulator.name);
  const std::string all =
      fmt::format("there are {}, the truth formats of imud list, and files", fmt::join(known, ", "));
  const auto formats = names(truth_formats());
  known.insert(known.end(), formats.begin(), formats.end());
  throw OpenError(
      fmt::format("there is no simulator, truth format or file \"{}\"; {}", from, suggestion(from, known, all)));
}

}  // namespace imud
