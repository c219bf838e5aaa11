// The parts that the readers of a description of frames share.
#pragma once

#include <string_view>
#include <vector>

#include "emulator/ground/table_reader.hpp"
#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

// Returns the tables of [[key]], at most `most`; adds a fault if the value of `key` is no such array.
std::vector<const toml::table*> tables_of(TableReader& table, std::string_view key, std::size_t most);

// Reads [setting], [[request]] and [unknown]. Adds the values that the readers resolve to `resolved`.
void read_host(TableReader& root, Faults& faults, toml::table& resolved, FrameHostDescription& host);
// Adds the request once for each row of `each`, with the words of the row in place of $1 to $9; without `each` once
// as it is. The first of these requests has the tests.
void add_for_each(TableReader& table, FrameHostDescription::Request request,
                  std::vector<FrameHostDescription::Request>& into);
// Reads the settings with which each of the message's test frames was sent. `frames`: the number of test frames.
std::vector<std::vector<FrameHostDescription::Choice>> read_test_settings(TableReader& message, std::size_t frames);
// Reads `when`, `polled` and, if it is the name of a setting, `rate_hz` of a message.
void read_switch(TableReader& message, FrameDescription::Message& into);

}  // namespace imud
