// Utility Mode (section 10): lines of text for machines, with a CRC-8. Answers have the format of the figures, even
// where these omit the status (iconf, sconf, ibto, irf), because the CRCs in the figures are right without it.
#include <algorithm>
#include <boost/crc.hpp>
#include <charconv>
#include <optional>
#include <span>

#include "protocols/stim300/stim300.hpp"

namespace imud::stim300 {

unsigned crc8(std::string_view text) noexcept {
  boost::crc_optimal<8, 0x07, 0xFF, 0, false, false> crc;
  crc.process_bytes(text.data(), text.size());
  return crc.checksum();
}

namespace {

// An answer: "#", words with a comma after each, the CRC as a decimal number, CR (section 10.2.2).
class Answer {
 public:
  Answer(FrameBuffer& out, std::string_view name) noexcept : out_(out) {
    text_[size_++] = '#';
    word(name);
  }
  Answer& word(std::string_view text) noexcept {
    for (const char c : text) put(c);
    put(',');
    return *this;
  }
  Answer& letter(char c) noexcept { return word({&c, 1}); }
  Answer& number(std::uint64_t value) noexcept {
    std::array<char, 20> text;
    return word({text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr});
  }
  Answer& number(double value, int decimals) noexcept {
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, decimals);
    return word({text.data(), end.ptr});
  }
  void send() noexcept {
    number(std::uint64_t{crc8({text_.data(), size_})});
    text_[size_ - 1] = '\r';
    out_.append(std::as_bytes(std::span(text_).first(size_)));
  }

 private:
  void put(char c) noexcept {
    if (size_ < text_.size()) text_[size_++] = c;
  }
  FrameBuffer& out_;
  std::array<char, 192> text_;
  std::size_t size_ = 0;
};

// One command. execute() returns 0 if it has sent the answer; otherwise it returns the status that the caller must
// send.
class Command {
 public:
  enum Status : unsigned { no_command = 1, bad_crc, unknown, bad_count, bad_parameter, too_many_saves, reduced = 8 };

  Command(Memory& memory, std::string_view name, std::span<const std::string_view> parameters,
          FrameBuffer& out) noexcept
      : memory_(memory), c_(memory.active), name_(name), parameters_(parameters), out_(out) {}

  unsigned execute() noexcept {
    if (const auto code = choice()) return *code;
    if (const auto code = filter()) return *code;
    if (const auto code = property()) return *code;
    if (name_ == "ig" || name_ == "sg") return g_compensation();
    if (name_ == "it" || name_ == "st") return transmission();
    if (name_ == "iconf" || name_ == "sconf") return system();
    if (name_ == "ibto") return has_wrong_count(0) ? bad_count : trims(Answer(out_, name_));
    if (name_ == "sbto") return set_trim();
    if (name_ == "sdbto") return adjust_trims();
    if (name_ == "ie") {
      if (has_wrong_count(0)) return bad_count;
      Answer answer = ok();
      for (const std::uint8_t byte : memory_.errors) answer.number(std::uint64_t{byte});
      memory_.errors = {};
      return sent(answer);
    }
    if (name_ == "srf") {
      const auto reference = parameters_.size() == 1 ? number_in<std::uint32_t>(parameters_[0]) : std::nullopt;
      if (has_wrong_count(1)) return bad_count;
      if (!reference) return bad_parameter;
      memory_.trim_reference = *reference;
      return sent(ok().number(std::uint64_t{*reference}));
    }
    if (name_ == "sfs") {
      if (has_wrong_count(1)) return bad_count;
      if (parameters_[0] != "0" && parameters_[0] != "1") return bad_parameter;
      c_ = memory_.factory;
      if (parameters_[0] == "1") memory_.save();
      return sent(ok().word(parameters_[0]));
    }
    if (name_ == "save") {
      if (has_wrong_count(0)) return bad_count;
      const unsigned code = memory_.save() ? 0U : unsigned{too_many_saves};
      return sent(Answer(out_, name_).number(std::uint64_t{code}).number(std::uint64_t{memory_.saves_left}));
    }
    if (name_ == "xn") return has_wrong_count(0) ? bad_count : sent(ok());
    return unknown;
  }

 private:
  Answer ok() noexcept { return std::move(Answer(out_, name_).word("0")); }
  static unsigned sent(Answer& answer) noexcept {
    answer.send();
    return 0;
  }
  static unsigned sent(Answer&& answer) noexcept { return sent(answer); }
  bool has_wrong_count(std::size_t wanted) const noexcept { return parameters_.size() != wanted; }
  static constexpr std::string_view axes = "xyz", capitals = "XYZ";

  // Executes a command "i...", which reads a setting, or "s...", which writes it, for settings that are one letter of
  // a list. Returns nullopt for any other command.
  std::optional<unsigned> choice() noexcept {
    struct Choice {
      std::string_view name, letters;
      unsigned* number;
    };
    const std::array<Choice, 7> choices = {{{"m", "012345", &c_.sample_rate},
                                            {"d", "01234567lmnpqrst", &c_.content},
                                            {"gu", "0123    89ab", &c_.units[gyro]},
                                            {"au", "01234", &c_.units[accelerometer]},
                                            {"iu", "01234", &c_.units[inclinometer]},
                                            {"pu", "0123", &c_.pps_unit},
                                            {"pf", "01234", &c_.pps_filter}}};
    for (const Choice& choice : choices) {
      if (name_.substr(1) != choice.name || (name_[0] != 'i' && name_[0] != 's')) continue;
      if (name_[0] == 's') {
        if (has_wrong_count(1)) return bad_count;
        const auto at = index(parameters_[0], choice.letters);
        if (!at) return bad_parameter;
        *choice.number = *at;
      } else if (has_wrong_count(0)) {
        return bad_count;
      }
      return sent(ok().letter(choice.letters[*choice.number]));
    }
    return std::nullopt;
  }

  // Executes a command that reads or writes low-pass filters, one for each axis. Returns nullopt for any other
  // command.
  std::optional<unsigned> filter() noexcept {
    constexpr std::array<std::string_view, 3> names = {"gf", "af", "if"};
    for (const Cluster cluster : clusters) {
      if (name_.substr(1) != names[cluster] || (name_[0] != 'i' && name_[0] != 's')) continue;
      std::array<unsigned, 3>& filters = c_.filters[cluster];
      if (name_[0] == 'i') {
        if (has_wrong_count(0)) return bad_count;
        Answer answer = ok();
        for (const unsigned filter : filters) answer.number(std::uint64_t{filter});
        return sent(answer);
      }
      if (has_wrong_count(2)) return bad_count;
      const auto axis = index(parameters_[0], axes);
      const auto at = index(parameters_[1], "01234");
      if (!axis || !at) return bad_parameter;
      filters[*axis] = *at;
      return sent(ok().letter(capitals[*axis]).word(parameters_[1]));
    }
    return std::nullopt;
  }

  // Executes a command that reads a property. Returns nullopt for any other command.
  std::optional<unsigned> property() noexcept {
    const auto reply = [&](auto&&... words) -> unsigned {
      if (has_wrong_count(0)) return bad_count;
      Answer answer = ok();
      (answer.word(words), ...);
      return sent(answer);
    };
    if (name_ == "in") return reply(product_name);
    if (name_ == "isn") return reply(serial_number);
    if (name_ == "ix") return reply(range_of(c_).part_number, std::string_view(&part_revision, 1));
    if (name_ == "ifw") return reply(firmware);
    if (name_ == "ihw") return reply(hardware);
    if (name_ == "iax") return reply("XYZ", "XYZ", "XYZ");
    if (name_ == "isv") return has_wrong_count(0) ? bad_count : sent(ok().number(std::uint64_t{memory_.saves_left}));
    if (name_ == "irf")
      return has_wrong_count(0) ? bad_count : sent(Answer(out_, name_).number(std::uint64_t{memory_.trim_reference}));
    if (name_ == "irng") {
      if (has_wrong_count(0)) return bad_count;
      Answer answer = ok();
      answer.word("400").word("400").word("400");
      for (int i = 0; i < 3; ++i) answer.number(std::uint64_t{range_of(c_).g});
      return sent(answer.word("1.7").word("1.7").word("1.7").word("NA"));
    }
    return std::nullopt;
  }

  unsigned g_compensation() noexcept {
    const bool sets = name_[0] == 's';
    if (has_wrong_count(sets ? 6 : 1)) return bad_count;
    const auto axis = index(parameters_[0], axes);
    if (!axis) return bad_parameter;
    GCompensation& g = c_.g_compensation[*axis];
    if (sets) {
      const auto scale_source = index(parameters_[1], "012"), scale_filter = index(parameters_[2], "01");
      const auto bias_source = index(parameters_[3], "012"), bias_filter = index(parameters_[4], "01");
      const auto filter_hz = number_in<double>(parameters_[5]);
      if (!scale_source || !scale_filter || !bias_source || !bias_filter) return bad_parameter;
      if (!filter_hz || !(*filter_hz >= 0.001 && *filter_hz <= 5)) return bad_parameter;
      g = {*bias_source, *bias_filter != 0, *scale_source, *scale_filter != 0};
      c_.g_filter_hz = *filter_hz;
    }
    Answer answer = ok();
    answer.letter(capitals[*axis]).number(std::uint64_t{g.scale_source}).number(std::uint64_t{g.scale_filter});
    answer.number(std::uint64_t{g.bias_source}).number(std::uint64_t{g.bias_filter});
    return sent(answer.number(c_.g_filter_hz, 3));
  }

  unsigned transmission() noexcept {
    constexpr std::string_view parities = "neo", shown = "NEO";
    const bool sets = name_[0] == 's';
    if (has_wrong_count(sets ? 6 : 0)) return bad_count;
    if (sets) {
      const auto rate = number_in<unsigned>(parameters_[0]);
      const auto stop = index(parameters_[1], "12"), parity = index(parameters_[2], parities);
      const auto termination = index(parameters_[3], "01"), cr_lf = index(parameters_[4], "01");
      if (!rate || *rate < least_bit_rate || *rate > greatest_bit_rate) return bad_parameter;
      if (!stop || !parity || !termination || !cr_lf) return bad_parameter;
      c_.set_bit_rate(*rate);
      c_.stop_bits = *stop + 1;
      c_.parity = static_cast<Parity>(*parity);
      c_.line_termination = *termination != 0;
      c_.cr_lf = *cr_lf != 0;
    }
    Answer answer = ok();
    answer.number(std::uint64_t{c_.line().baud}).number(std::uint64_t{c_.stop_bits});
    answer.letter(shown[static_cast<std::size_t>(c_.parity)]);
    answer.word(c_.line_termination ? "1" : "0").word(c_.cr_lf ? "1" : "0");
    return sent(sets ? answer.word("0") : answer);
  }

  unsigned system() noexcept {
    const bool sets = name_[0] == 's';
    if (has_wrong_count(sets ? 2 : 1)) return bad_count;
    const auto which = index(parameters_[0], "vtb");
    if (!which) return bad_parameter;
    bool& setting = *which == 0 ? c_.tov_3v3 : *which == 1 ? c_.tov_toggles : c_.bias_trim_at_start;
    const std::string_view letters = *which == 0 ? "53" : "01";
    if (sets) {
      const auto at = index(parameters_[1], letters);
      if (!at) return bad_parameter;
      setting = *at != 0;
    }
    return sent(Answer(out_, name_).letter("VTB"[*which]).letter(letters[setting ? 1 : 0]));
  }

  unsigned trims(bool as_wanted) noexcept {
    return trims(std::move(Answer(out_, name_).number(std::uint64_t{as_wanted ? 0U : unsigned{reduced}})));
  }
  unsigned trims(Answer&& answer) noexcept {
    for (const Cluster cluster : clusters)
      for (int i = 0; i < 3; ++i) answer.number(memory_.trim[cluster][i], 5 + static_cast<int>(cluster));
    return sent(answer);
  }

  unsigned set_trim() noexcept {
    if (parameters_.empty() || parameters_.size() > 3) return bad_count;
    const auto offset = finite_number_in(parameters_[0]);
    const auto cluster = parameters_.size() > 1 ? index(parameters_[1], "gai") : std::optional<unsigned>(3);
    const auto axis = parameters_.size() > 2 ? index(parameters_[2], axes) : std::optional<unsigned>(3);
    if (!offset || !cluster || !axis) return bad_parameter;
    bool as_wanted = true;
    for (const Cluster one : clusters)
      for (unsigned i = 0; i < 3; ++i)
        if ((*cluster == 3 || *cluster == one) && (*axis == 3 || *axis == i))
          as_wanted = memory_.set_trim(one, i, *offset) && as_wanted;
    return trims(as_wanted);
  }

  unsigned adjust_trims() noexcept {
    if (has_wrong_count(9)) return bad_count;
    std::array<double, 9> by;
    for (std::size_t i = 0; i < by.size(); ++i) {
      const auto number = finite_number_in(parameters_[i]);
      if (!number) return bad_parameter;
      by[i] = *number;
    }
    bool as_wanted = true;
    for (const Cluster cluster : clusters)
      for (unsigned i = 0; i < 3; ++i)
        as_wanted = memory_.set_trim(cluster, i, memory_.trim[cluster][i] + by[3 * cluster + i]) && as_wanted;
    return trims(as_wanted);
  }

  Memory& memory_;
  Configuration& c_;
  std::string_view name_;
  std::span<const std::string_view> parameters_;
  FrameBuffer& out_;
};

}  // namespace

void greet(FrameBuffer& replies) noexcept { Answer(replies, "UTILITYMODE").send(); }

bool execute(Memory& memory, std::string_view line, FrameBuffer& replies) noexcept {
  using enum Command::Status;
  const auto refuse = [&](std::string_view name, unsigned code) {
    Answer(replies, name).number(std::uint64_t{code}).send();
    return true;
  };
  if (!line.starts_with('$')) return refuse("", no_command);
  const std::size_t last = line.rfind(',');
  if (last == std::string_view::npos) return refuse("", bad_crc);
  const auto crc = number_in<unsigned>(line.substr(last + 1));
  if (!crc || *crc != crc8(line.substr(0, last + 1))) return refuse("", bad_crc);
  // Splits the line into the command and its parameters; blanks may precede a parameter.
  std::array<std::string_view, 16> words;
  std::size_t count = 0;
  for (std::size_t begin = 1; begin <= last && count < words.size();) {
    const std::size_t comma = line.find(',', begin);
    std::string_view word = line.substr(begin, comma - begin);
    if (count > 0) word.remove_prefix(std::min(word.find_first_not_of(" \t"), word.size()));
    words[count++] = word;
    begin = comma + 1;
  }
  const std::string_view name = words[0];
  if (name.empty()) return refuse("", unknown);
  const unsigned code = Command(memory, name, std::span(words).subspan(1, count - 1), replies).execute();
  if (code == unknown) return refuse("", unknown);
  if (code != 0) return refuse(name, code);
  return name != "xn";
}

}  // namespace imud::stim300
