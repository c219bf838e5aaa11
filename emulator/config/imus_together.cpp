#include <map>

#include "core/numbers/random.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

// Returns true if frames of a device at `port` arrive at the listener.
bool reaches(const std::string& port, const std::string& listener) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || transport->reaches == nullptr || transport != transport_of(listener)) return false;
  try {
    return transport->reaches(PortSpec::parse(port), PortSpec::parse(listener));
  } catch (const PortError&) {
    return false;  // this is a fault already
  }
}

std::string address_of(const std::string& port) { return port.substr(0, port.find('?')); }

}  // namespace

std::string exclusive_address(const std::string& port) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || transport->is_shared) return {};
  if (transport->tcp_port != nullptr && !tcp_port(port)) return {};
  if (transport->is_standard_output != nullptr &&
      is_standard_output(address_of(port).substr(transport->name.size() + 1)))
    return "-";
  std::string path = path_of(port);  // one path may have several spellings
  return path.empty() ? address_of(port) : path;
}

namespace {

// Finds conflicts between two imus, or an imu and the truth.
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
    for (const auto& [key, port] : ports_of(imu)) send(key, port);
    send("sync.tov_port", imu.sync.tov_port);
    if (imu.protocol != nullptr && imu.protocol->link == Link::can) add_identifiers(imu);
  }

  // Call it after all imus have been added. Requires that they are valid.
  void check_buses(const std::vector<ImuConfig>& imus) {
    for (const BusLoad& bus : bus_loads(imus)) {
      if (bus.imus.size() < 2) continue;
      i_ = bus.imus.back();
      check_bit_rates(imus, bus);
      const std::string what =
          fmt::format("the {} imus on {} load it by {}", bus.imus.size(), bus.address, bus.text());
      if (bus.percent > 100.0)
        fault("port", what + "; reduce what they send or how often, or give a faster bus");
      else if (bus.percent >= BusLoad::high_percent)
        warn("port",
             fmt::format("{}; above {:.0f} % a CAN bus delays frames of low priority", what, BusLoad::high_percent));
    }
    for (const Identifier& received : received_)
      if (const auto sender = identifiers_.find(received.at);
          sender != identifiers_.end() && sender->second != received.imu) {
        i_ = received.imu;
        warn("device", fmt::format("it receives the CAN identifier {:#x}, which imu.{} sends on the same bus",
                                   received.at.second & 0x1FFF'FFFFU, sender->second));
      }
  }

 private:
  void fault(std::string_view key, std::string_view what) {
    faults_.add(tables_[i_].source().begin.line, fmt::format("imu.{}.{}", i_, key), what);
  }
  void warn(std::string_view key, std::string_view what) {
    faults_.warn(tables_[i_].source().begin.line, fmt::format("imu.{}.{}", i_, key), what);
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
    const std::string address = exclusive_address(port);
    if (address.empty()) return;
    if (const auto [at, is_new] = ports_.emplace(address, i_); !is_new) clash(key, at->second, "the same");
  }

  void add_identifiers(const ImuConfig& imu) {
    const Transport* transport = transport_of(imu.port);
    if (transport == nullptr || !transport->is_shared) return;
    if (imu.protocol->bus_name != nullptr)
      if (const std::string name = imu.protocol->bus_name(imu.settings); !name.empty())
        if (const auto [at, is_new] = bus_names_.emplace(std::pair{address_of(imu.port), name}, i_); !is_new)
          clash("device", at->second, fmt::format("the same {} on the same bus", name));
    constexpr std::uint32_t extended = 1U << 31U, whole = 0x1FFF'FFFFU, whole_standard = 0x7FFU;
    for (const CanFilter& filter : imu.protocol->can_filters(imu.settings))
      if (!filter.inverted && filter.data &&
          (filter.mask & (filter.extended ? whole : whole_standard)) == (filter.extended ? whole : whole_standard))
        received_.push_back({{address_of(imu.port), filter.id | (filter.extended ? extended : 0U)}, i_});
    for (const std::uint32_t id : fixed_identifiers(imu))
      if (const auto [at, is_new] = identifiers_.emplace(std::pair{address_of(imu.port), id}, i_); !is_new)
        return clash("device", at->second, fmt::format("the same CAN identifier {:#x} on the same bus", id & whole));
  }

  void check_bit_rates(const std::vector<ImuConfig>& imus, const BusLoad& bus) {
    for (const std::size_t i : bus.imus) {
      const double own = imus[i].load.line_bits_per_s;
      i_ = i;
      if (own != 0 && own != bus.line_bits_per_s)
        fault("port", fmt::format("{} bit/s, and imu.{} gives {} for the same bus; give one bit rate", own,
                                  bus.imus.front(), bus.line_bits_per_s));
    }
    i_ = bus.imus.back();
  }

  const std::string& truth_port_;
  const toml::array& tables_;
  Faults& faults_;
  std::size_t i_ = 0;  // the imu that add() adds
  std::map<std::string, std::string> listeners_;
  std::map<std::string, std::size_t> names_, ports_;
  std::map<std::uint32_t, std::size_t> streams_;
  using BusIdentifier = std::pair<std::string, std::uint32_t>;
  struct Identifier {
    BusIdentifier at;
    std::size_t imu;
  };
  std::map<std::pair<std::string, std::string>, std::size_t> bus_names_;  // see Protocol::bus_name
  std::map<BusIdentifier, std::size_t> identifiers_;  // identifiers that an imu sends, with the number of the imu
  std::vector<Identifier> received_;                  // identifiers that an imu receives without a mask
};

}  // namespace

void check_imus_together(const std::vector<ImuConfig>& imus, const std::string& truth_port, const toml::array& tables,
                         Faults& faults) {
  Together together(truth_port, tables, faults);
  for (std::size_t i = 0; i < imus.size(); ++i) together.add(imus[i], i);
  if (faults.all().empty()) together.check_buses(imus);
}

void set_collecting(std::vector<ImuConfig>& imus) {
  std::map<std::string, int> senders;
  for (const ImuConfig& imu : imus) {
    ++senders[address_of(imu.port)];
    for (const std::string& copy : imu.also) ++senders[address_of(copy)];
  }
  for (ImuConfig& imu : imus) imu.port_settings.collects = senders[address_of(imu.port)] == 1;
}

void check_new_ports(const Config& now, const Config& next) {
  std::map<std::string, std::string> open;  // the keys of the ports by their addresses
  const auto add = [&](const std::string& imu, std::string_view key, const std::string& port) {
    if (!port.empty()) open.emplace(exclusive_address(port), fmt::format("imu.{}.{}", imu, key));
  };
  for (const ImuConfig& imu : now.imus) {
    for (const auto& [key, port] : ports_of(imu)) add(imu.name, key, port);
    add(imu.name, "sync.tov_port", imu.sync.tov_port);
  }
  std::vector<std::string> faults;
  const auto check = [&](const std::string& imu, std::string_view key, const std::string& before,
                         const std::string& after) {
    const std::string address = before == after || after.empty() ? std::string() : exclusive_address(after);
    if (const auto found = open.find(address); !address.empty() && found != open.end())
      faults.push_back(
          fmt::format("imu.{}.{}: {} is open already, as {}: a reload opens the new port before it closes the old "
                      "one; give another address, or change to another port first",
                      imu, key, after, found->second));
  };
  for (const ImuConfig& imu : next.imus)
    for (const ImuConfig& before : now.imus)
      if (before.name == imu.name) {
        check(imu.name, "port", before.port, imu.port);
        check(imu.name, "second_port", before.second_port, imu.second_port);
      }
  if (!faults.empty()) throw ConfigError(std::move(faults));
}

}  // namespace imud
