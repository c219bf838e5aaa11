#include <map>
#include <set>

#include "core/random.hpp"
#include "emulator/config_parts.hpp"
#include "emulator/line_load.hpp"
#include "transports/output_path.hpp"

namespace imud {

namespace {

// Returns true if what a device at `port` sends arrives at the listener.
bool reaches(const std::string& port, const std::string& listener) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || transport->reaches == nullptr || transport != transport_of(listener)) return false;
  try {
    return transport->reaches(PortSpec::parse(port), PortSpec::parse(listener));
  } catch (const PortError&) {
    return false;  // which is a fault already
  }
}

std::string address_of(const std::string& port) { return port.substr(0, port.find('?')); }

// Finds what two imus have in common, or an imu and the truth.
class Together {
 public:
  Together(const std::string& truth_port, const toml::array& tables, Faults& faults)
      : truth_port_(truth_port), tables_(tables), faults_(faults) {
    if (!truth_port.empty()) listeners_.emplace(truth_port, "truth.port");
  }

  void add(const ImuConfig& imu, std::size_t i) {
    i_ = i;
    if (const auto [at, is_new] = names_.emplace(imu.name, i); !is_new)
      clash("name", at->second, "the same");
    else if (const auto [same, is_alone] = streams_.emplace(stream_id(imu.name), i); !is_alone)
      clash("name", same->second, "the same random numbers");
    listen("sync.trigger_port", imu.sync.trigger_port);
    listen("sync.pps_port", imu.sync.pps_port);
    send("port", imu.port);
    send("second_port", imu.second_port);
    send("sync.tov_port", imu.sync.tov_port);
    if (imu.protocol != nullptr && imu.protocol->link == Link::can) add_identifiers(imu);
  }

 private:
  void fault(std::string_view key, std::string_view what) {
    faults_.add(tables_[i_].source().begin.line, fmt::format("imu.{}.{}", i_, key), what);
  }
  void clash(std::string_view key, std::size_t other, std::string_view what) {
    fault(key, fmt::format("{} as imu.{}; give another", what, other));
  }

  void listen(std::string_view key, const std::string& port) {
    if (!udp_port(port)) return;  // the system chooses a free one
    if (const auto [at, is_new] = listeners_.emplace(port, fmt::format("imu.{}.{}", i_, key)); !is_new)
      fault(key, fmt::format("the same as {}; give another", at->second));
  }

  void send(std::string_view key, const std::string& port) {
    const Transport* transport = transport_of(port);
    if (transport == nullptr) return;
    if (reaches(port, truth_port_))
      fault(key, "sends to truth.port, so that imud would receive its own frames; give another");
    if (transport->is_shared) return;
    std::string path = path_of(port);  // which may have several spellings
    if (transport->is_standard_output != nullptr &&
        is_standard_output(address_of(port).substr(transport->name.size() + 1)))
      path = "-";
    if (const auto [at, is_new] = ports_.emplace(path.empty() ? address_of(port) : std::move(path), i_); !is_new)
      clash(key, at->second, "the same");
  }

  void add_identifiers(const ImuConfig& imu) {
    const Transport* transport = transport_of(imu.port);
    if (transport == nullptr || !transport->is_shared) return;
    std::set<std::uint32_t> ids;
    for (const SentFrames& sent : sent_frames(imu)) ids.insert(sent.can.id | (sent.can.extended ? 1U << 31U : 0U));
    for (const std::uint32_t id : ids)
      if (const auto [at, is_new] = identifiers_.emplace(std::pair{address_of(imu.port), id}, i_); !is_new)
        return clash("device", at->second,
                     fmt::format("the same CAN identifier {:#x} on the same bus", id & 0x1FFF'FFFFU));
  }

  const std::string& truth_port_;
  const toml::array& tables_;
  Faults& faults_;
  std::size_t i_ = 0;  // the imu that add() adds
  std::map<std::string, std::string> listeners_;
  std::map<std::string, std::size_t> names_, ports_;
  std::map<std::uint32_t, std::size_t> streams_;
  std::map<std::pair<std::string, std::uint32_t>, std::size_t> identifiers_;
};

}  // namespace

void check_imus_together(const std::vector<ImuConfig>& imus, const std::string& truth_port, const toml::array& tables,
                         Faults& faults) {
  Together together(truth_port, tables, faults);
  for (std::size_t i = 0; i < imus.size(); ++i) together.add(imus[i], i);
}

}  // namespace imud
