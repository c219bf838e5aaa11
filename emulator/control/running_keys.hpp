// RunningKeys: the keys of the configuration that can change while a run goes on.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/control/json_rpc.hpp"
#include "emulator/imu/command.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// To make a key changeable, add its entry to the table.
struct RunningKey {
  enum class Type : std::uint8_t {
    number,   // from min to max
    integer,  // unsigned, 64 bits
    vector,   // three numbers from min to max, or one for all axes
    word,     // one of `words`; Command::number is its index
    list,     // one to `most` integers from min to max, a command for each; Command::number is its index
  };
  std::string_view key;  // an imu's key is without "imu.NAME."
  std::string_view meaning;
  Type type = Type::number;
  Command::Kind kind = Command::Kind::mark;  // a command for each axis of a vector
  bool of_imu = false;
  double min = 0, max = 0;
  double si = 1;  // the value of the key's unit in SI
  std::span<const std::string_view> words = {};
  std::string_view automatic = {};  // a word that may replace the number, and makes another command
  // Returns why a run of this configuration cannot change the key to that value; nullptr if the run can.
  const char* (*refusal)(const Config&, double value) = nullptr;
  std::size_t most = 0;
};

std::span<const RunningKey> running_keys() noexcept;

// Adds the commands that set `key`, such as "truth.delay_ms" or "imu.imu1.gyro.bias_rad_per_s"; "imu.*." means all
// imus. Throws RpcError.
void add_commands(std::vector<Command>& commands, const std::string& key, const Json& value, const Config& config);

// Returns the table for clients: [{"key", "meaning", "type", "min", "max", "words"}, ...].
Json running_keys_json();

}  // namespace imud
