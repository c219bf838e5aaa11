#include "protocols/signals/dbc_file.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <utility>

#include "core/numbers/number_text.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

constexpr std::size_t max_file_size = 16 << 20;  // bytes
constexpr std::size_t max_signals = 4096;        // of a message
constexpr std::size_t max_classic_size = 8;      // bytes of a message that needs no CAN FD
constexpr std::uint32_t extended_bit = 0x8000'0000;
constexpr double max_cycle_ms = 1e8;

[[noreturn]] void refuse(std::size_t line, const std::string& fault) {
  throw std::invalid_argument("line " + std::to_string(line) + ": " + fault);
}

struct Token {
  std::string_view text = {};  // empty: the end of the file
  std::size_t line = 1;
  bool is_string = false;  // `text` is without the quotes
  bool begins_line = false;
};

// Splits the text into tokens: words, texts in quotes, and each of the characters : | @ ( ) [ ] , ;
class DbcTokens {
 public:
  explicit DbcTokens(std::string_view text) : rest_(text) { advance(); }

  const Token& peek() const noexcept { return token_; }
  Token next() {
    Token taken = token_;
    advance();
    return taken;
  }
  // Takes the next token if it has this text, and returns true.
  bool skip(std::string_view text) {
    if (token_.is_string || token_.text != text) return false;
    advance();
    return true;
  }
  void expect(std::string_view text, const char* statement) {
    if (!skip(text))
      refuse(token_.line, std::string(statement) + ": expected \"" + std::string(text) + "\", but found " + found());
  }
  std::string name(const char* statement) {
    const Token token = next();
    if (token.is_string || token.text.empty() || punctuation.find(token.text) != std::string_view::npos)
      refuse(token.line, std::string(statement) + ": expected a name");
    return std::string(token.text);
  }
  // Takes a number. A number in quotes is accepted as well, because some files have such values of attributes.
  double real(const char* statement) { return number<double>(statement); }
  template <class Number>
  Number number(const char* statement) {
    const std::string found_text = found();
    const Token token = next();
    std::string_view text = token.text;
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto value = number_in<Number>(text);
    bool is_good = value.has_value();
    if constexpr (std::is_floating_point_v<Number>) is_good = is_good && std::isfinite(*value);
    if (!is_good) refuse(token.line, std::string(statement) + ": expected a number, but found " + found_text);
    return *value;
  }

 private:
  static constexpr std::string_view punctuation = ":|@()[],;";
  static constexpr std::string_view blanks = " \t\r\n\f\v";

  std::string found() const {
    if (token_.text.empty() && !token_.is_string) return "the end of the file";
    return "\"" + std::string(token_.text.substr(0, 40)) + "\"";
  }

  void advance() {
    bool begins_line = at_begin_;
    at_begin_ = false;
    while (!rest_.empty() && blanks.find(rest_[0]) != std::string_view::npos) {
      if (rest_[0] == '\n') {
        ++line_;
        begins_line = true;
      }
      rest_.remove_prefix(1);
    }
    token_ = {.line = line_, .begins_line = begins_line};
    if (rest_.empty()) return;
    if (rest_[0] == '"') {
      std::size_t end = 1;
      while (end < rest_.size() && (rest_[end] != '"' || rest_[end - 1] == '\\')) ++end;
      if (end == rest_.size()) refuse(line_, "a text in quotes does not end; add the closing quote");
      token_.is_string = true;
      token_.text = rest_.substr(1, end - 1);
      line_ += static_cast<std::size_t>(std::ranges::count(token_.text, '\n'));
      rest_.remove_prefix(end + 1);
      return;
    }
    std::size_t size = 1;
    if (punctuation.find(rest_[0]) == std::string_view::npos)
      while (size < rest_.size() && rest_[size] != '"' && blanks.find(rest_[size]) == std::string_view::npos &&
             punctuation.find(rest_[size]) == std::string_view::npos)
        ++size;
    token_.text = rest_.substr(0, size);
    rest_.remove_prefix(size);
  }

  std::string_view rest_;
  std::size_t line_ = 1;
  bool at_begin_ = true;
  Token token_;
};

class DbcParser {
 public:
  explicit DbcParser(std::string_view text) : tokens_(text) {}

  std::vector<DbcMessage> parse() {
    while (!tokens_.peek().text.empty() || tokens_.peek().is_string) {
      const Token token = tokens_.next();
      if (!token.begins_line || token.is_string) continue;
      if (token.text == "BO_") message(token.line);
      if (token.text == "SG_") signal(token.line);
      // A keyword that no such token follows is an entry of the list NS_.
      const Token& following = tokens_.peek();
      if (token.text == "BA_" && following.is_string) attribute();
      if (token.text == "BA_DEF_DEF_" && following.is_string) attribute_default();
      if (token.text == "SIG_VALTYPE_" && !following.begins_line) value_type();
      if (token.text == "SG_MUL_VAL_" && !following.begins_line) pages();
    }
    apply_defaults();
    find_multiplexors();
    use_long_names();
    return std::move(messages_);
  }

 private:
  void message(std::size_t line) {
    DbcMessage message;
    message.line = line;
    const auto id = tokens_.number<std::uint32_t>("BO_");
    message.id = id & ~extended_bit;
    message.extended = (id & extended_bit) != 0;
    message.name = tokens_.name("BO_");
    tokens_.expect(":", "BO_");
    message.size = tokens_.number<std::uint32_t>("BO_");
    message.fd = message.size > max_classic_size;
    if (!by_id_.emplace(id, messages_.size()).second)
      refuse(line, "BO_: a message with the identifier " + std::to_string(id) + " is already defined");
    messages_.push_back(std::move(message));
    has_cycle_.push_back(false);
    has_format_.push_back(false);
  }

  void signal(std::size_t line) {
    if (messages_.empty()) refuse(line, "SG_: a signal must follow the BO_ of its message");
    DbcSignal signal;
    signal.line = line;
    signal.name = tokens_.name("SG_");
    if (!tokens_.skip(":")) {
      std::string multiplexing = tokens_.name("SG_");
      if (multiplexing.size() > 1 && multiplexing.starts_with('m') && multiplexing.ends_with('M')) {
        signal.is_multiplexor = true;  // extended multiplexing
        multiplexing.pop_back();
      }
      if (multiplexing == "M") {
        signal.is_multiplexor = true;
      } else if (multiplexing != "m") {  // some files have an m alone, which is neither a page nor a multiplexor
        const auto page = number_in<std::uint32_t>(std::string_view(multiplexing).substr(1));
        if (!multiplexing.starts_with('m') || !page)
          refuse(line, "SG_: expected \":\", \"M\" or \"m\" with a number, but found \"" + multiplexing + "\"");
        signal.pages = {{*page, *page}};
      }
      tokens_.expect(":", "SG_");
    }
    signal.start = tokens_.number<unsigned>("SG_");
    tokens_.expect("|", "SG_");
    signal.length = tokens_.number<unsigned>("SG_");
    tokens_.expect("@", "SG_");
    const Token encoding = tokens_.next();
    if (encoding.text.size() != 2 || (encoding.text[0] != '0' && encoding.text[0] != '1') ||
        (encoding.text[1] != '+' && encoding.text[1] != '-'))
      refuse(encoding.line, "SG_: expected 0+, 0-, 1+ or 1- after \"@\", but found \"" +
                                std::string(encoding.text.substr(0, 40)) + "\"");
    signal.encoding.motorola = encoding.text[0] == '0';
    if (encoding.text[1] == '-') signal.encoding.format = SignalFormat::signed_integer;
    tokens_.expect("(", "SG_");
    signal.scale = tokens_.real("SG_");
    tokens_.expect(",", "SG_");
    signal.offset = tokens_.real("SG_");
    tokens_.expect(")", "SG_");
    tokens_.expect("[", "SG_");
    signal.minimum = tokens_.real("SG_");
    tokens_.expect("|", "SG_");
    signal.maximum = tokens_.real("SG_");
    tokens_.expect("]", "SG_");
    std::vector<DbcSignal>& signals = messages_.back().signals;
    if (std::ranges::count(signals, signal.name, &DbcSignal::name) > 0)
      refuse(line, "SG_: the message already has a signal \"" + signal.name + "\"");
    if (signals.size() == max_signals)
      refuse(line, "SG_: a message may have " + std::to_string(max_signals) + " signals at most");
    signals.push_back(std::move(signal));
  }

  // Return the message or the signal that an attribute or a value type names; nullptr if there is none.
  DbcMessage* message_of(const char* statement) {
    const auto found = by_id_.find(tokens_.number<std::uint32_t>(statement));
    return found == by_id_.end() ? nullptr : &messages_[found->second];
  }
  DbcSignal* signal_of(const char* statement) {
    DbcMessage* const message = message_of(statement);
    const std::string name = tokens_.name(statement);
    if (message == nullptr) return nullptr;
    const auto found = std::ranges::find(message->signals, name, &DbcSignal::name);
    return found == message->signals.end() ? nullptr : &*found;
  }

  void attribute() {
    const std::string_view name = tokens_.next().text;
    if (name == "GenMsgCycleTime" && tokens_.skip("BO_")) {
      DbcMessage* const message = message_of("BA_");
      const Nanoseconds cycle = cycle_time();
      if (message == nullptr) return;
      message->cycle = cycle;
      has_cycle_[static_cast<std::size_t>(message - messages_.data())] = true;
    } else if (name == "GenSigStartValue" && tokens_.skip("SG_")) {
      DbcSignal* const signal = signal_of("BA_");
      const double initial = tokens_.real("BA_");
      if (signal == nullptr) return;
      initial_[signal->line] = initial;
    } else if (name == "VFrameFormat" && tokens_.skip("BO_")) {
      DbcMessage* const message = message_of("BA_");
      const bool is_fd = is_fd_format(tokens_.next().text);
      if (message == nullptr) return;
      message->fd = is_fd || message->size > max_classic_size;
      has_format_[static_cast<std::size_t>(message - messages_.data())] = true;
    } else if (name == "SystemMessageLongSymbol" && tokens_.skip("BO_")) {
      DbcMessage* const message = message_of("BA_");
      const Token symbol = tokens_.next();
      if (message != nullptr && symbol.is_string) message->short_name = symbol.text;  // until use_long_names()
    } else if (name == "SystemSignalLongSymbol" && tokens_.skip("SG_")) {
      DbcSignal* const signal = signal_of("BA_");
      const Token symbol = tokens_.next();
      if (signal != nullptr && symbol.is_string) signal->short_name = symbol.text;
    }
  }

  void attribute_default() {
    const std::string_view name = tokens_.next().text;
    if (name == "GenMsgCycleTime") {
      default_cycle_ = cycle_time();
    } else if (name == "GenSigStartValue") {
      default_initial_ = tokens_.real("BA_DEF_DEF_");
    } else if (name == "VFrameFormat") {
      is_fd_by_default_ = is_fd_format(tokens_.next().text);
    }
  }

  void value_type() {
    const std::size_t line = tokens_.peek().line;
    DbcSignal* const signal = signal_of("SIG_VALTYPE_");
    static_cast<void>(tokens_.skip(":"));
    const auto type = tokens_.number<unsigned>("SIG_VALTYPE_");
    if (type > 2) refuse(line, "SIG_VALTYPE_: the type must be 0 (integer), 1 (float) or 2 (double)");
    if (signal != nullptr && type > 0)
      signal->encoding.format = type == 1 ? SignalFormat::float32 : SignalFormat::float64;
  }

  // Reads a statement of extended multiplexing: the multiplexor of a signal, and ranges of its values, "0-3, 5-5".
  void pages() {
    const std::size_t line = tokens_.peek().line;
    DbcSignal* const signal = signal_of("SG_MUL_VAL_");
    const std::string multiplexor = tokens_.name("SG_MUL_VAL_");
    std::vector<PageRange> pages;
    do {
      const std::string text = tokens_.name("SG_MUL_VAL_");
      const std::size_t dash = std::min(text.find('-'), text.size() - 1);
      const auto first = number_in<std::uint32_t>(std::string_view(text).substr(0, dash)),
                 last = number_in<std::uint32_t>(std::string_view(text).substr(dash + 1));
      if (!first || !last || *last < *first)
        refuse(line, "SG_MUL_VAL_: expected a range such as 0-3, but found \"" + text + "\"");
      pages.push_back({*first, *last});
    } while (tokens_.skip(","));
    if (signal == nullptr) return;
    signal->multiplexor = multiplexor;
    signal->pages = std::move(pages);
  }

  // Sets the multiplexor of the signals in messages with a single multiplexor (without extended multiplexing).
  void find_multiplexors() {
    for (DbcMessage& message : messages_) {
      const auto is_multiplexor = [](const DbcSignal& one) { return one.is_multiplexor; };
      if (std::ranges::count_if(message.signals, is_multiplexor) != 1) continue;
      const std::string name = std::ranges::find_if(message.signals, is_multiplexor)->name;
      for (DbcSignal& signal : message.signals)
        if (signal.multiplexor.empty()) signal.multiplexor = name;
    }
  }

  // Replaces the short names by the long ones. Call this last, because the statements of the file have the short
  // names.
  void use_long_names() {
    for (DbcMessage& message : messages_) {
      if (!message.short_name.empty()) std::swap(message.name, message.short_name);
      // The long name of a signal may be the short name of another one: all multiplexors come before all names.
      for (DbcSignal& signal : message.signals) {
        const auto multiplexor = std::ranges::find(message.signals, signal.multiplexor, &DbcSignal::name);
        if (multiplexor != message.signals.end() && !multiplexor->short_name.empty())
          signal.multiplexor = multiplexor->short_name;
      }
      for (DbcSignal& signal : message.signals)
        if (!signal.short_name.empty()) std::swap(signal.name, signal.short_name);
    }
  }

  Nanoseconds cycle_time() {
    const std::size_t line = tokens_.peek().line;
    const double ms = tokens_.real("GenMsgCycleTime");
    if (ms < 0 || ms > max_cycle_ms) refuse(line, "GenMsgCycleTime: must be from 0 to 100000000 ms");
    return nanoseconds(1e-3 * ms);
  }

  // Returns true for a value of VFrameFormat that is CAN FD: an index, or a name.
  static bool is_fd_format(std::string_view format) noexcept {
    return format == "14" || format == "15" || format.ends_with("CAN_FD");
  }

  // Returns the bits of an initial value: of a float, or of an integer, in two's complement if it is negative.
  static std::uint64_t bits_of(double number, SignalFormat format) noexcept {
    if (format == SignalFormat::float32) return std::bit_cast<std::uint32_t>(to_float(number));
    if (format == SignalFormat::float64) return std::bit_cast<std::uint64_t>(number);
    const double limited = std::clamp(std::round(number), -0x1p63, 0x1.fffffffffffffp63);
    return limited < 0 ? static_cast<std::uint64_t>(static_cast<std::int64_t>(limited))
                       : static_cast<std::uint64_t>(limited);
  }

  void apply_defaults() {
    for (std::size_t i = 0; i < messages_.size(); ++i) {
      if (!has_cycle_[i]) messages_[i].cycle = default_cycle_;
      if (!has_format_[i]) messages_[i].fd |= is_fd_by_default_;
      for (DbcSignal& signal : messages_[i].signals) {
        const auto own = initial_.find(signal.line);
        signal.initial = bits_of(own == initial_.end() ? default_initial_ : own->second, signal.encoding.format);
      }
    }
  }

  DbcTokens tokens_;
  std::vector<DbcMessage> messages_;
  std::map<std::uint32_t, std::size_t> by_id_;  // with extended_bit
  std::vector<bool> has_cycle_, has_format_;    // index: as messages_
  std::map<std::size_t, double> initial_;       // the signals' own initial values, by the lines of the signals
  Nanoseconds default_cycle_ = {};
  double default_initial_ = 0;
  bool is_fd_by_default_ = false;
};

}  // namespace

std::vector<DbcMessage> parse_dbc(std::string_view text) { return DbcParser(text).parse(); }

std::vector<DbcMessage> read_dbc_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw std::invalid_argument(path + ": no such file; give the path of a DBC file");
  if (std::filesystem::file_size(path, error) > max_file_size)
    throw std::invalid_argument(path + ": larger than 16 MiB; give the path of a DBC file");
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw std::invalid_argument(path + ": cannot be read; check its permissions");
  try {
    return parse_dbc(text);
  } catch (const std::invalid_argument& fault) {
    throw std::invalid_argument(path + ": " + fault.what());
  }
}

}  // namespace imud
