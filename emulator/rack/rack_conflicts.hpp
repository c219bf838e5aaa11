// RackConflicts: finds resources that two runs of a rack use and must not share, and settings that must be equal in
// all runs and differ.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/ground/table_reader.hpp"
#include "emulator/rack/rack_check.hpp"

namespace imud {

class RackConflicts {
 public:
  // `warnings` gets a text for each warning.
  RackConflicts(const Rack& rack, std::vector<std::string>& warnings) : rack_(rack), warnings_(warnings) {}

  // Compares a run with the runs that were added before. `text`: the run's configuration, to whose lines faults
  // refer.
  void add(const LoadedRun& run, const toml::table& text);
  const std::vector<std::string>& faults() const noexcept { return faults_; }

 private:
  // A key of a configuration, as a fault names it.
  struct Place {
    const LoadedRun* run = nullptr;
    std::string key;
    std::uint32_t line = 0;
  };
  // An address at which a run listens.
  struct Listener {
    Place place;
    bool is_tcp = false;
    std::string address;  // numeric
    std::uint16_t port = 0;
  };

  Place place(std::string key) const;
  void fault(const std::string& key, std::string_view what);
  void warn(const std::string& key, std::string_view what);
  void claim(const std::string& key, const std::string& resource, std::string_view what, bool is_of_rack = false);
  void listen(Listener listener);
  void listen_udp(const std::string& key, const std::string& port);
  void listen_tcp(const std::string& key, const std::string& address);
  void check_path(const std::string& key, const std::string& port);
  void add_imu(const ImuConfig& imu, std::size_t index);
  void add_identifiers(const std::string& key, const ImuConfig& imu);
  void compare_clock();
  void compare_truth();

  const Rack& rack_;
  std::vector<std::string>& warnings_;
  std::vector<std::string> faults_;
  const LoadedRun* run_ = nullptr;  // the run that add() compares, and its text
  const toml::table* text_ = nullptr;
  const LoadedRun* first_ = nullptr;                                 // the run with which the other runs are compared
  std::map<std::string, Place> claimed_;                             // by host, or for all hosts, and resource
  std::vector<Listener> listeners_;                                  // of all hosts
  std::map<std::pair<std::uint64_t, std::uint32_t>, Place> noises_;  // by seed and stream
};

}  // namespace imud
