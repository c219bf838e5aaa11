#include "emulator/init/init_questions.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "core/numbers/number_text.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/init/found_ports.hpp"
#include "emulator/init/simulators.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

struct Answer {
  std::string value;
  std::string words;  // words beside the answer in the list
};

// Prints a question with numbered answers. Returns the answer of the entered number, or the entered text, or
// `initial` if the input is empty.
std::string answer(std::string_view question, const std::vector<Answer>& answers, const std::string& initial) {
  std::size_t width = 0;
  for (const Answer& one : answers) width = std::max(width, one.value.size());
  for (std::size_t i = 0; i < answers.size(); ++i)
    fmt::print("{:>4}  {:<{}}  {}\n", i + 1, answers[i].value, width, answers[i].words);
  fmt::print("{}{}: ", question, initial.empty() ? "" : " [" + initial + "]");
  std::fflush(stdout);
  std::string line;
  if (!std::getline(std::cin, line)) throw OpenError("standard input has ended before all questions were answered");
  const std::size_t begin = line.find_first_not_of(" \t\r");
  line = begin == line.npos ? "" : line.substr(begin, line.find_last_not_of(" \t\r") + 1 - begin);
  if (line.empty()) return initial;
  const std::size_t number = number_in<std::size_t>(line).value_or(0);
  return number >= 1 && number <= answers.size() ? answers[number - 1].value : line;
}

// Sets `option`, if it is empty, to an answer that `check` does not refuse by an exception, whose text is printed.
template <class Check>
void ask_for(std::string& option, std::string_view question, const std::vector<Answer>& answers,
             const std::string& initial, Check check) {
  while (option.empty()) {
    const std::string given = answer(question, answers, initial);
    try {
      check(given);
      option = given;
      if (given.empty()) return;
    } catch (const std::runtime_error& fault) {
      fmt::print("{}\n", fault.what());
    }
  }
}

// Returns ports for a protocol: the devices of this machine, then an example of each other kind.
std::vector<Answer> ports_for(const Protocol& protocol) {
  const bool is_can = protocol.link == Link::can;
  std::vector<Answer> all;
  for (const Transport* transport : transports()) {
    if (!transport->serves_device || transport->carries_can != is_can) continue;
    const bool is_found = !transport->has_path && transport->carries_can && transport->udp_port == nullptr;
    for (const FoundPort& found : is_found                        ? found_can_interfaces()
                                  : transport->uart == Uart::real ? found_serial_ports()
                                                                  : std::vector<FoundPort>())
      all.push_back({fmt::format("{}:{}", transport->name, found.address), found.words});
  }
  for (const Transport* transport : transports())
    if (transport->serves_device && transport->carries_can == is_can && transport->uart != Uart::real)
      all.push_back({std::string(transport->example), std::string(transport->summary)});
  return all;
}

}  // namespace

void ask(InitOptions& options) {
  if (options.product.empty()) {
    std::vector<std::string> names = protocol_names();
    for (std::string& name : names)
      if (const Protocol* protocol = find_protocol(name); protocol != nullptr && !units_of(*protocol).empty())
        name += fmt::format(" ({})", fmt::join(units_of(*protocol), ", "));
    fmt::print("{}\n", fmt::join(names, " "));
    ask_for(options.product, "product", {}, "", [](const std::string& name) { choose_product(name); });
  }
  if (options.port.empty()) {
    const Protocol& protocol = *choose_product(options.product).protocol;
    const std::vector<Answer> ports = ports_for(protocol);
    const auto usual = [&](const Transport* t) {
      return t->serves_device && (protocol.link == Link::can ? t->carries_can : t->uart == Uart::emulated);
    };
    std::string initial;
    for (const Transport* transport : transports())
      if (initial.empty() && usual(transport)) initial = transport->example;
    if (protocol.link == Link::can && !ports.empty()) initial = ports.front().value;
    ask_for(options.port, "port", ports, initial,
            [&](const std::string& port) { check_device_port(protocol, port); });
  }
  if (options.from.empty()) {
    std::vector<Answer> all;
    for (const Simulator& simulator : simulators())
      all.push_back({std::string(simulator.name), std::string(simulator.summary())});
    ask_for(options.from, "simulator, or a file of captured truth", all, "imu-truth",
            [](const std::string& from) { choose_truth(from, {}); });
    ask_for(options.truth, "its port, or the number of that (empty: as it usually is)", {}, "",
            [&](const std::string& port) { choose_truth(options.from, port); });
  }
  ask_for(options.place, "place, LATITUDE,LONGITUDE[,HEIGHT] (empty: none)", {}, "",
          [](const std::string& place) { earth_lines(place, false, false); });
}

}  // namespace imud
