// Each character is echoed when it is received, and CR ends a line (section 9). An empty line is answered with the
// prompt.
#include "protocols/stim300/service.hpp"

#include <algorithm>

#include "protocols/stim300/service_text.hpp"

namespace imud::stim300 {
namespace {

enum Error : unsigned { none, unknown, bad_count, bad_parameter, too_many_saves, too_long = 7, limited };
constexpr std::array<std::string_view, 9> errors = {"",
                                                    "UNKNOWN COMMAND",
                                                    "INCORRECT NUMBER OF PARAMETERS",
                                                    "INVALID PARAMETER",
                                                    "EXCEEDED MAXIMUM NUMBER OF SAVES",
                                                    "ERROR DURING SAVE",
                                                    "",
                                                    "DATAGRAM WILL BE TOO LONG TO TRANSMIT",
                                                    "BIAS TRIM OFFSET(S) SET TO MIN OR MAX"};

constexpr std::string_view axes = "xyz", sensors = "gai";

}  // namespace

// Executes one line of the host.
class Service::Menu {
 public:
  Menu(Service& service, Memory& memory, const std::array<Axes, 3>& measured, const Reading& reading,
       ServiceText& text) noexcept
      : service_(service), memory_(memory), c_(memory.active), measured_(measured), reading_(reading), text_(text) {}

  void execute(std::string_view line) noexcept {
    const auto error = service_.question_ != Question::none ? answer(line) : line.empty() ? none : command(line);
    if (error != none) text_.line("E00", unsigned{error}, ' ', errors[error]);
    if (service_.question_ == Question::none && service_.exit_ == Exit::none) text_.add('>');
  }

 private:
  Error command(std::string_view line) noexcept {
    const auto* const known = std::ranges::find(commands, line[0], &Command::letter);
    if (known == std::end(commands)) return unknown;
    if (line.size() > 1 && line[1] != ' ') return bad_count;
    for (line.remove_prefix(std::min<std::size_t>(line.size(), 2)); !line.empty();) {
      if (count_ == parameters_.size()) return bad_count;
      const std::size_t comma = std::min(line.find(','), line.size());
      std::string_view word = line.substr(0, comma);
      word.remove_prefix(std::min(word.find_first_not_of(' '), word.size()));
      parameters_[count_++] = word;
      line.remove_prefix(std::min(comma + 1, line.size()));
    }
    if (known->execute == &Menu::measurement && c_.sample_rate == external_trigger) return unknown;
    if (count_ < known->fewest || count_ > known->most) return bad_count;
    return (this->*known->execute)();
  }

  Error measurement() noexcept {
    print_measurement(text_, measured_, reading_);
    return none;
  }

  Error diagnostic() noexcept {
    print_diagnostic(text_, memory_);
    return none;
  }

  Error ask_save() noexcept { return ask(Question::save); }

  Error factory() noexcept {
    if (count_ == 1 && parameters_[0] != "s") return bad_parameter;
    return ask(count_ == 1 ? Question::factory_and_save : Question::factory);
  }

  Error trim() noexcept {
    if (count_ == 2 && parameters_[1] == "r") {
      const auto reference = number_in<std::uint32_t>(parameters_[0]);
      if (!reference) return bad_parameter;
      memory_.trim_reference = *reference;
      text_.line("BIAS TRIM OFFSET:");
      print_reference(text_, memory_);
      return none;
    }
    const auto offset = finite_number_in(parameters_[0]);
    const auto sensor = count_ > 1 ? index(parameters_[1], sensors) : 3;
    const auto axis = count_ > 2 ? index(parameters_[2], axes) : 3;
    if (!offset || !sensor || !axis) return bad_parameter;
    bool as_wanted = true;
    text_.line("BIAS TRIM OFFSET:");
    for (const Cluster cluster : clusters) {
      if (*sensor != 3 && *sensor != cluster) continue;
      for (unsigned i = 0; i < 3; ++i) {
        if (*axis != 3 && *axis != i) continue;
        const double from = *axis == i ? memory_.trim[cluster][i] : 0;
        as_wanted = memory_.set_trim(cluster, i, from + *offset) && as_wanted;
      }
      print_trims(text_, memory_, cluster, *axis);
    }
    return as_wanted ? none : limited;
  }

  Error datagram() noexcept {
    const auto content = index(parameters_[0], "01234567lmnpqrst"), cr_lf = index(parameters_[1], "01");
    if (!content || !cr_lf) return bad_parameter;
    Configuration changed = c_;
    changed.content = *content;
    changed.cr_lf = *cr_lf != 0;
    if (!can_transmit(changed)) return too_long;
    c_ = changed;
    print_datagram(text_, c_);
    return none;
  }

  Error filter() noexcept {
    const auto code = index(parameters_[0], "01234");
    const auto sensor = count_ > 1 ? index(parameters_[1], "gaip") : 4;
    const auto axis = count_ > 2 ? index(parameters_[2], axes) : 3;
    if (!code || !sensor || !axis || (*sensor == 3 && count_ > 2)) return bad_parameter;
    for (const Cluster cluster : clusters) {
      if (*sensor != 4 && *sensor != cluster) continue;
      for (unsigned i = 0; i < 3; ++i)
        if (*axis == 3 || *axis == i) c_.filters[cluster][i] = *code;
      print_filters(text_, c_, cluster, *axis);
    }
    if (*sensor < 3) return none;
    c_.pps_filter = *code;
    print_pps_filter(text_, c_);
    return none;
  }

  // Parameters (Table 9-21): either the code of a standard compensation, or four parameters, before which there may
  // be three for the axes. The frequency of the filter may be given as the last parameter.
  Error g_compensation() noexcept {
    const bool standard = count_ == 1 || count_ == 2, by_axis = count_ == 7 || count_ == 8;
    if (!standard && !by_axis && count_ != 4 && count_ != 5) return bad_count;
    double filter_hz = standard ? 0.01 : c_.g_filter_hz;
    if (count_ == 2 || count_ == 5 || count_ == 8) {
      const auto given = number_in<double>(parameters_[count_ - 1]);
      if (!given || !(*given >= 0.001 && *given <= 5)) return bad_parameter;
      filter_hz = *given;
    }
    std::array<unsigned, 3> applied = {1, 1, 1};
    for (unsigned i = 0; by_axis && i < 3; ++i) {
      const auto on = index(parameters_[i], "01");
      if (!on) return bad_parameter;
      applied[i] = *on;
    }
    GCompensation g;
    if (standard) {
      const auto code = index(parameters_[0], "0123456789abc");
      if (!code) return bad_parameter;
      g = standard_g_compensations[*code];
    } else {
      const std::size_t at = by_axis ? 3 : 0;
      const auto bias = index(parameters_[at], "012"), bias_filter = index(parameters_[at + 1], "01");
      const auto scale = index(parameters_[at + 2], "012"), scale_filter = index(parameters_[at + 3], "01");
      if (!bias || !bias_filter || !scale || !scale_filter) return bad_parameter;
      g = {*bias, *bias_filter != 0, *scale, *scale_filter != 0};
    }
    for (unsigned i = 0; i < 3; ++i) c_.g_compensation[i] = applied[i] != 0 ? g : GCompensation();
    c_.g_filter_hz = filter_hz;
    // See the note of Table 9-22.
    const bool in_step = (g.bias_source == 0 || g.bias_filter) && (g.scale_source == 0 || g.scale_filter);
    print_g_compensation(
        text_, c_, in_step || c_.units[gyro] >= delayed ? "" : " WARNING: DELAYED GYRO OUTPUT UNIT IS RECOMMENDED");
    return none;
  }

  Error system() noexcept {
    const auto which = index(parameters_[0], "vtb");
    if (!which) return bad_parameter;
    const auto setting = index(parameters_[1], *which == 0 ? "53" : "01");
    if (!setting) return bad_parameter;
    (*which == 0 ? c_.tov_3v3 : *which == 1 ? c_.tov_toggles : c_.bias_trim_at_start) = *setting != 0;
    print_system(text_, c_, parameters_[0][0]);
    return none;
  }

  Error information() noexcept {
    if (count_ == 0) {
      print_information(text_, memory_);
      return none;
    }
    const bool is_part = parameters_[0].size() == 1 && print_part(text_, memory_, parameters_[0][0]);
    return is_part ? none : unknown;
  }

  Error sample_rate() noexcept {
    const auto code = index(parameters_[0], "012345");
    if (!code) return bad_parameter;
    c_.sample_rate = *code;
    print_sample_rate(text_, c_);
    return can_transmit(c_) ? none : too_long;  // the rate is set nevertheless (section 9.9)
  }

  Error line_termination() noexcept {
    const auto on = index(parameters_[0], "01");
    if (!on) return bad_parameter;
    c_.line_termination = *on != 0;
    print_line_termination(text_, c_);
    return none;
  }

  Error transmission() noexcept {
    const bool by_user = count_ > 0 && parameters_[0] == "f";
    const std::size_t given = count_ - (by_user ? 1 : 0);
    if (given != 1 && given != 3) return bad_count;
    Configuration changed = c_;
    const auto code = index(parameters_[0], "0123");
    const auto rate = by_user ? number_in<unsigned>(parameters_[1])
                      : code  ? std::optional(bit_rates[*code])
                              : std::nullopt;
    if (!rate || *rate < least_bit_rate || *rate > greatest_bit_rate) return bad_parameter;
    changed.set_bit_rate(*rate);
    if (given == 3) {
      constexpr std::array parities = {Parity::none, Parity::odd, Parity::even};
      const auto stop_bits = index(parameters_[count_ - 2], "12"), parity = index(parameters_[count_ - 1], "012");
      if (!stop_bits || !parity) return bad_parameter;
      changed.stop_bits = *stop_bits + 1;
      changed.parity = parities[*parity];
    }
    if (!can_transmit(changed)) return too_long;
    c_ = changed;
    print_transmission(text_, c_.line());
    return none;
  }

  Error unit() noexcept {
    const auto sensor = index(parameters_[0], "gaip");
    if (!sensor) return bad_parameter;
    const auto code = index(parameters_[1], *sensor == 0 ? "0123    89ab" : *sensor == 3 ? "0123" : "01234");
    if (!code) return bad_parameter;
    if (*sensor == 3) {
      c_.pps_unit = *code;
      print_pps_unit(text_, c_);
    } else {
      c_.units[*sensor] = *code;
      print_unit(text_, c_, clusters[*sensor]);
    }
    return none;
  }

  Error exit() noexcept {
    const auto where = index(parameters_[0], "niNI");
    if (!where) return bad_parameter;
    const bool to_init = *where % 2 != 0, at_once = *where >= 2;
    if (!at_once && !memory_.is_saved()) return ask(to_init ? Question::exit_to_init : Question::exit_to_normal);
    leave(to_init, at_once);
    return none;
  }
  void leave(bool to_init, bool at_once) noexcept {
    // A real unit sends no full stop, unlike figures 9-49 and 9-50 (cookednoodle/pystim300 cd54334,
    // tests/test_client.py).
    text_.line("SYSTEM RETURNING TO ", to_init ? "INIT" : "NORMAL", " MODE");
    service_.exit_ = to_init ? Exit::to_init : Exit::to_normal;
    service_.leaves_at_ = service_.typed_at_ + (at_once ? Nanoseconds{} : hold_time);
  }

  Error print_help() noexcept {
    const std::string_view about = count_ == 0 ? "?" : parameters_[0];
    if (about.size() != 1 || help(about[0]).empty() || (count_ == 1 && about == "?")) return bad_parameter;
    text_.add(help(about[0]));
    return none;
  }

  Error ask(Question question) noexcept {
    service_.question_ = question;
    switch (question) {
      case Question::none:
        break;
      case Question::save:
        text_.add("SYSTEM PARAMETERS WILL BE PERMANENTLY CHANGED. CONFIRM SAVE(Y/N): ");
        break;
      case Question::exit_to_normal:
      case Question::exit_to_init:
        text_.add("CURRENT SYSTEM PARAMETERS DO NOT MATCH FLASH CONTENT. CONFIRM EXIT(Y/N): ");
        break;
      case Question::factory:
      case Question::factory_and_save:
        text_.line("RESTORE TO FACTORY SETTINGS.");
        text_.add("CONFIRM CHANGE TO FACTORY SETTINGS",
                  question == Question::factory ? "(Y/N): " : " AND SAVING(Y/N): ");
        break;
      case Question::factory_line:
      case Question::factory_line_and_save:
        text_.line("THE TRANSMISSION CONFIGURATION WILL BE CHANGED TO:");
        print_transmission(text_, memory_.factory.line());
        text_.add("PLEASE CONFIRM (Y/N): ");
        break;
    }
    return none;
  }

  Error answer(std::string_view word) noexcept {
    const Question question = std::exchange(service_.question_, Question::none);
    const bool yes = word == "Y";
    const Error refused = word == "N" ? none : bad_parameter;
    switch (question) {
      case Question::none:
        break;
      case Question::save:
        if (yes) return save("SYSTEM PARAMETERS SUCCESSFULLY STORED IN FLASH.");
        c_.set_line(memory_.stored);
        text_.line("SAVE COMMAND ABORTED.");
        return refused;
      case Question::exit_to_normal:
      case Question::exit_to_init:
        if (!yes) return refused;
        leave(question == Question::exit_to_init, false);
        break;
      case Question::factory:
      case Question::factory_and_save:
        if (!yes) return refused;
        if (c_.line() == memory_.factory.line()) return restore(question == Question::factory_and_save);
        return ask(question == Question::factory ? Question::factory_line : Question::factory_line_and_save);
      case Question::factory_line:
      case Question::factory_line_and_save:
        return yes ? restore(question == Question::factory_line_and_save) : refused;
    }
    return none;
  }

  Error restore(bool and_save) noexcept {
    text_.line("APPLYING FACTORY SETTINGS");
    c_ = memory_.factory;
    if (and_save) return save("FACTORY SETTINGS APPLIED AND SAVED.");
    text_.line("FACTORY SETTINGS APPLIED. TO PERMANENTLY STORE THE SETTINGS, USE THE SAVE OR 'z s' COMMAND.");
    return none;
  }

  Error save(std::string_view done) noexcept {
    const bool within = memory_.save();
    text_.line(done);
    text_.line("NUMBER OF SAVES = ", unsigned{Memory::saves} - memory_.saves_left);
    return within ? none : too_many_saves;
  }

  struct Command {
    char letter;
    std::size_t fewest, most;  // parameters; some commands accept only some of these numbers
    Error (Menu::*execute)() noexcept;
  };
  static constexpr Command commands[] = {{'a', 0, 0, &Menu::measurement}, {'b', 1, 3, &Menu::trim},
                                         {'c', 0, 0, &Menu::diagnostic},  {'d', 2, 2, &Menu::datagram},
                                         {'f', 1, 3, &Menu::filter},      {'g', 1, 8, &Menu::g_compensation},
                                         {'h', 2, 2, &Menu::system},      {'i', 0, 1, &Menu::information},
                                         {'m', 1, 1, &Menu::sample_rate}, {'r', 1, 1, &Menu::line_termination},
                                         {'s', 0, 0, &Menu::ask_save},    {'t', 1, 5, &Menu::transmission},
                                         {'u', 2, 2, &Menu::unit},        {'x', 1, 1, &Menu::exit},
                                         {'z', 0, 1, &Menu::factory},     {'?', 0, 1, &Menu::print_help}};

  Service& service_;
  Memory& memory_;
  Configuration& c_;
  const std::array<Axes, 3>& measured_;
  const Reading& reading_;
  ServiceText& text_;
  std::array<std::string_view, 8> parameters_;
  std::size_t count_ = 0;
};

void Service::enter(const Memory& memory, FrameBuffer& replies) noexcept {
  *this = Service();
  ServiceText text(replies);
  print_information(text, memory);
  text.add('>');
}

std::size_t Service::receive(std::span<const std::byte> typed, DeviceTime now, Memory& memory,
                             const std::array<Axes, 3>& measured, const Reading& reading,
                             FrameBuffer& replies) noexcept {
  constexpr char backspace = 8;
  if (now - typed_at_ >= typing_timeout) line_.drop_line();
  typed_at_ = now;
  std::size_t taken = 0;
  while (taken < typed.size() && exit_ == Exit::none) {
    ServiceText text(replies);
    char c = 0;
    while (taken < typed.size() && c != '\r') {
      c = static_cast<char>(typed[taken++]);
      // Characters without effect are not echoed.
      if (c == '\r' || (c == backspace ? line_.erase_last() : c != '\n' && line_.append(c))) text.add(c);
    }
    if (c != '\r') break;
    const auto line = line_.finish_line();
    Menu(*this, memory, measured, reading, text).execute(line.is_too_long() ? std::string_view() : line.text);
  }
  return exit_ != Exit::none && now < leaves_at_ ? typed.size() : taken;
}

}  // namespace imud::stim300
