// The shipped descriptions of frames as protocols: `protocol = "hipnuc"` is `frame` with the description hipnuc.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/protocol.hpp"

namespace imud {

// Returns the entry of protocols() with that name, or else the shipped description of that name as a protocol;
// nullptr if there is neither. A described protocol has the name, summary and document of the description, which
// is attached to the Settings of the protocol's `settings`; the protocol has no key `frame_file`. Each described
// protocol is made once and exists until the end of the program. One thread at a time.
const Protocol* resolve_protocol(std::string_view name);

// Returns true if the protocol is a shipped description.
bool is_described(const Protocol& protocol);

// Returns all shipped descriptions as protocols, sorted by name.
std::vector<const Protocol*> described_protocols();

// A shipped description in a list.
struct DescribedTitle {
  std::string_view name, summary, document;
};
// Returns the titles of described_protocols(), without reading the descriptions, each of which takes a millisecond.
std::vector<DescribedTitle> described_titles();

// Returns the names that resolve_protocol() knows: of protocols(), then of the shipped descriptions.
std::vector<std::string> protocol_names();

// Returns the fault of a `frame_file` that is given beside a described protocol, and the remedy.
std::string frame_file_refusal(const Protocol& protocol);

}  // namespace imud
