// DbcFile: the messages and signals of a DBC file, the database of a CAN bus.
//
// The format has no public standard; this follows what Vector's tools, cantools and canmatrix agree on. The parser
// reads BO_, SG_, SG_MUL_VAL_, SIG_VALTYPE_, the attributes GenMsgCycleTime, GenSigStartValue and VFrameFormat
// with their defaults, and SystemMessageLongSymbol and SystemSignalLongSymbol, which hold the names of more than
// 32 characters. The parser skips all other content.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.hpp"
#include "protocols/signals/can_signals.hpp"

namespace imud {

struct DbcSignal {
  std::string name;
  std::string short_name = {};  // in SG_, if the name is long
  std::size_t line = 0;         // of its definition, from 1
  unsigned start = 0, length = 0;
  SignalEncoding encoding;
  double scale = 1, offset = 0, minimum = 0, maximum = 0;
  bool is_multiplexor = false;
  std::vector<PageRange> pages;  // not empty: present while the multiplexor has one of these values
  std::string multiplexor;       // name of the multiplexor; empty: the file does not name one
  std::uint64_t initial = 0;     // GenSigStartValue, the raw number; of a float, the bits of the number
};

struct DbcMessage {
  std::string name;
  std::string short_name = {};  // in BO_, if the name is long
  std::size_t line = 0;
  std::uint32_t id = 0;  // without the bit that marks 29-bit identifiers; may be out of range
  bool extended = false;
  bool fd = false;
  std::size_t size = 0;    // bytes; may be more than a frame has
  Nanoseconds cycle = {};  // GenMsgCycleTime; 0: none
  std::vector<DbcSignal> signals;
};

// Parses the text of a DBC file. Throws std::invalid_argument, "line N: ..." with the fault and the right text, if a
// definition that is read is malformed. No text does any harm.
std::vector<DbcMessage> parse_dbc(std::string_view text);

// Reads a DBC file. Throws std::invalid_argument, "PATH: ...", if it cannot be read or parsed.
std::vector<DbcMessage> read_dbc_file(const std::string& path);

}  // namespace imud
