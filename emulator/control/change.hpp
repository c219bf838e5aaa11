// Change: the commands by which the sampling thread executes a request that changes the run.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/control/json_rpc.hpp"
#include "emulator/faults/fault_book.hpp"
#include "emulator/imu/command.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// A port of an imu that another port replaces.
struct PortChange {
  std::uint16_t imu = 0;  // number of the imu
  std::string what;       // "port" or "second port"
  std::string before, after;
};

// A fault that a change begins, and its keys, as TOML.
struct BegunFault {
  FaultConfig config;
  std::string text;
};

struct Change {
  std::vector<Command> commands;
  std::string words;  // for the log: "power off"
  // The notification of the change's event: {"event": "power", "state": "off"}. The samples are added when the
  // change has been applied.
  Json event;
  std::vector<PortChange> ports = {};
  // Joins the book of faults when the change is accepted. Its number follows the numbers of the faults before it.
  std::optional<BegunFault> fault = std::nullopt;
};

struct ChangeContext {
  const Config& config;
  const FaultBook& faults;
  std::span<const Change> earlier = {};  // of the same batch
};
// Return the change that a method of that name makes. Throw RpcError.
Change mark_change(const Json& params, const ChangeContext& context);
Change set_change(const Json& params, const ChangeContext& context);
Change seed_change(const Json& params, const ChangeContext& context);
Change power_change(const Json& params, const ChangeContext& context);
Change pause_change(const Json& params, const ChangeContext& context);
Change resume_change(const Json& params, const ChangeContext& context);

// The parameters of a request by their names. A getter throws RpcError if a value is missing or wrong; finish() if a
// parameter was not read.
class RpcParams {
 public:
  explicit RpcParams(const Json& params);
  bool has(std::string_view name);
  // Returns the value; throws if it is missing.
  const Json& get(std::string_view name, std::string_view meaning);
  std::string text(std::string_view name, std::string_view meaning);
  double number(std::string_view name, std::string_view meaning, double min, double max);
  // `max` is below 2^32.
  std::uint32_t whole_number(std::string_view name, std::string_view meaning, double min, double max);
  std::string choice(std::string_view name, std::span<const std::string_view> words);
  // Returns the number of the imu of that name; Command::all_imus if it is absent or "*".
  std::uint16_t imu(const Config& config);
  void finish() const;

 private:
  const Json& params_;
  std::vector<std::string> known_;
};

}  // namespace imud
