#include "emulator/rack/rack_conflicts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "core/numbers/number_text.hpp"
#include "core/numbers/random.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "transports/socket/socket_address.hpp"

namespace imud {
namespace {

// Returns the address of a UDP port; nullopt for any other port.
std::optional<SocketAddress> udp_address(const std::string& port) {
  if (!udp_port(port) || transport_of(port)->ends) return std::nullopt;
  try {
    return SocketAddress::ip(PortSpec::parse(port));
  } catch (const PortError&) {
    return std::nullopt;  // which is a fault already
  }
}

std::string numeric_address(const SocketAddress& address) {
  return std::string(EndpointText(address.endpoint()).address());
}

bool is_loopback_address(std::string_view address) { return address.starts_with("127.") || address == "::1"; }

bool is_every_address(std::string_view address) { return address == "0.0.0.0" || address == "::"; }

// Returns the value at a path such as "imu.0.port"; nullptr if there is none.
const toml::node* value_at(const toml::table& table, std::string_view path) {
  const toml::node* node = &table;
  while (!path.empty() && node != nullptr) {
    const std::string_view word = path.substr(0, path.find('.'));
    path.remove_prefix(std::min(path.size(), word.size() + 1));
    if (const toml::table* inner = node->as_table()) {
      node = inner->get(word);
    } else {
      const toml::array* list = node->as_array();
      const auto index = number_in<std::size_t>(word);
      node = list != nullptr && index ? list->get(*index) : nullptr;
    }
  }
  return node;
}

}  // namespace

RackConflicts::Place RackConflicts::place(std::string key) const {
  // If the key is absent, takes the line of the nearest table around it.
  for (std::string path = key; !path.empty(); path.resize(path.find('.') == path.npos ? 0 : path.rfind('.')))
    if (const toml::node* node = value_at(*text_, path)) return {run_, std::move(key), node->source().begin.line};
  return {run_, std::move(key), 0};
}

namespace {

// Returns "host bench1 (nose.toml:7, imu.0.port)".
std::string told(const RackHost& host, const RackRun& run, std::uint32_t line, std::string_view key) {
  return fmt::format("host {} ({}{}, {})", host.name, run.file, line > 0 ? fmt::format(":{}", line) : "", key);
}

}  // namespace

void RackConflicts::fault(const std::string& key, std::string_view what) {
  Faults one(run_->run->file);
  one.add(place(key).line, key, fmt::format("host {}: {}", run_->host->name, what));
  faults_.push_back(one.all().front());
}

void RackConflicts::warn(const std::string& key, std::string_view what) {
  Faults one(run_->run->file);
  one.warn(place(key).line, key, fmt::format("host {}: {}", run_->host->name, what));
  warnings_.push_back(one.warnings().front());
}

// Adds a fault if another run has claimed this resource. Only one run of a host may have it or, if `is_of_rack`, only
// one run of the rack.
void RackConflicts::claim(const std::string& key, const std::string& resource, std::string_view what,
                          bool is_of_rack) {
  const std::string owner = is_of_rack ? std::string() : run_->host->name;
  const auto [at, is_new] = claimed_.emplace(fmt::format("{}\n{}", owner, resource), place(key));
  const Place& other = at->second;
  if (is_new || other.run == run_) return;  // load_config() reports conflicts within one run
  fault(key, fmt::format("{}, which {} has, too; give another", what,
                         told(*other.run->host, *other.run->run, other.line, other.key)));
}

void RackConflicts::listen(Listener listener) {
  for (const Listener& other : listeners_) {
    const bool is_same_socket =
        other.is_tcp == listener.is_tcp && other.port == listener.port &&
        (other.address == listener.address || is_every_address(other.address) || is_every_address(listener.address));
    if (!is_same_socket || other.place.run->host != run_->host || other.place.run == run_) continue;
    fault(listener.place.key,
          fmt::format("listens at port {} of {}, as {} does; give another port", listener.port,
                      listener.is_tcp ? "TCP" : "UDP",
                      told(*run_->host, *other.place.run->run, other.place.line, other.place.key)));
    break;
  }
  listeners_.push_back(std::move(listener));
}

// Any number of processes may receive a multicast group.
void RackConflicts::listen_udp(const std::string& key, const std::string& port) {
  if (const auto address = udp_address(port); address && !address->is_multicast())
    listen({place(key), false, numeric_address(*address), udp_port(port).value_or(0)});
}

void RackConflicts::listen_tcp(const std::string& key, const std::string& address) {
  if (const auto parsed = NumericAddress::try_parse(address); parsed && parsed->port != 0)
    listen({place(key), true, parsed->address, parsed->port});
}

// Warns if a port has a relative path: systemd starts imud in another folder than a shell does.
void RackConflicts::check_path(const std::string& key, const std::string& port) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || !transport->has_path) return;
  const std::string address = port.substr(transport->name.size() + 1);
  if (address.starts_with('/') || address.starts_with('-')) return;
  warn(key, fmt::format("{} is a path from the folder in which systemd starts imud, {}; give a whole path, such as "
                        "/run/imud/imu1",
                        port, run_->host->service == RackHost::Service::system ? "/" : "that of the user"));
}

void RackConflicts::add_imu(const ImuConfig& imu, std::size_t index) {
  const auto key_of = [index](std::string_view key) { return fmt::format("imu.{}.{}", index, key); };
  const auto send = [&](std::string_view key, const std::string& port) {
    if (port.empty()) return;
    check_path(key_of(key), port);
    if (const std::string address = exclusive_address(port); !address.empty())
      claim(key_of(key), "port " + address, port.substr(0, port.find('?')));
  };
  for (const auto& [key, port] : ports_of(imu)) send(key, port);
  send("sync.tov_port", imu.sync.tov_port);
  listen_udp(key_of("sync.trigger_port"), imu.sync.trigger_port);
  listen_udp(key_of("sync.pps_port"), imu.sync.pps_port);
  add_identifiers(key_of("device"), imu);
  const std::pair noise(imu.seed.value_or(run_->config.seed), stream_id(imu.name));
  const auto [at, is_new] = noises_.emplace(noise, place(key_of("name")));
  if (const Place& other = at->second; !is_new && other.run != run_)
    warn(
        key_of("name"),
        fmt::format("\"{}\" has the same random numbers as {}: their errors are equal; give another name, or another "
                    "seed",
                    imu.name, told(*other.run->host, *other.run->run, other.line, other.key)));
}

void RackConflicts::add_identifiers(const std::string& key, const ImuConfig& imu) {
  const Transport* transport = transport_of(imu.port);
  if (transport == nullptr || !transport->is_shared) return;
  // If the port has the option `interface`, the bus consists of datagrams and spans all hosts of the network. CAN
  // interfaces of one name on two hosts may be two buses.
  const bool is_of_network =
      std::ranges::any_of(transport->options, [](const PortOption& option) { return option.key == "interface"; });
  const std::string bus = imu.port.substr(0, imu.port.find('?'));
  const std::size_t before = faults_.size();
  for (const std::uint32_t id : fixed_identifiers(imu)) {
    constexpr std::uint32_t without_kind = 0x1FFF'FFFFU;
    claim(key, fmt::format("{} {}", bus, id),
          fmt::format("sends the CAN identifier {:#x} on {}", id & without_kind, bus), is_of_network);
    if (faults_.size() > before) return;
  }
}

void RackConflicts::compare_clock() {
  const Config &config = run_->config, &first = first_->config;
  const std::string of_first = told(*first_->host, *first_->run, 0, "clock");
  if (config.clock != first.clock) {
    fault("clock", fmt::format("\"{}\", and \"{}\" has {}; give one clock to all", word_of(clock_words, config.clock),
                               word_of(clock_words, first.clock), of_first));
    return;
  }
  const Epoch epoch = epoch_of(config), epoch_of_first = epoch_of(first);
  const bool has_several_hosts = rack_.hosts.size() > 1;
  if (has_several_hosts && epoch == Epoch::monotonic)
    fault("realtime.epoch", "\"monotonic\" counts from the start of each host; give \"tai\", or \"utc\", to all");
  if (epoch != epoch_of_first)
    fault("realtime.epoch",
          fmt::format("\"{}\", and \"{}\" has {}; give one epoch to all", word_of(epoch_words, epoch),
                      word_of(epoch_words, epoch_of_first), told(*first_->host, *first_->run, 0, "realtime.epoch")));
  const bool is_alone = run_ == first_;
  if (!has_live_truth(config)) return;
  if (is_alone && epoch == Epoch::none && (has_several_hosts || rack_.hosts.front().runs.size() > 1))
    warn("realtime.epoch",
         fmt::format("the runs of the rack are not in phase, since each begins with its first truth; give \"{}\" to "
                     "all",
                     has_several_hosts ? "tai" : "monotonic"));
  if (has_several_hosts && epoch != Epoch::none && config.realtime.allow_unsynchronised)
    warn("realtime.allow_unsynchronised",
         "the grids of the hosts differ by as much as their clocks; omit it when PTP or NTP sets them");
}

void RackConflicts::compare_truth() {
  const TruthConfig &truth = run_->config.truth, &first = first_->config.truth;
  const auto of_first = [this](const char* key) { return told(*first_->host, *first_->run, 0, key); };
  if (truth.format != first.format)
    warn("truth.format", fmt::format("\"{}\", and \"{}\" has {}: one simulator sends one format", truth.format->name,
                                     first.format->name, of_first("truth.format")));
  const auto address = udp_address(truth.port), address_of_first = udp_address(first.port);
  const bool is_multicast = address && address->is_multicast();
  if (address && address_of_first && !(address->endpoint() == address_of_first->endpoint()) &&
      (is_multicast || address_of_first->is_multicast()))
    warn("truth.port", fmt::format("{}, and {} has {}: they may have other truth; give one group to all", truth.port,
                                   first.port, of_first("truth.port")));
  if (rack_.hosts.size() == 1 || !has_live_truth(run_->config)) return;
  if (address && is_loopback_address(numeric_address(*address)))
    warn("truth.port",
         "only programs of the same host can send truth there; several hosts receive one truth by a "
         "multicast group, such as \"udp:239.1.2.3:9810?interface=eth0\"");
  if (run_ == first_ && truth.clock.automatic_percent > 0)
    warn("truth.delay_ms",
         "each host finds its own delay, so that samples of one instant have truth of several; give "
         "one number to all, such as 20");
  if (truth.clock.automatic_percent != first.clock.automatic_percent || truth.clock.delay != first.clock.delay)
    warn("truth.delay_ms", fmt::format("differs from that which {} has, so that samples of one instant have truth of "
                                       "two; give one number to all",
                                       of_first("truth.delay_ms")));
}

void RackConflicts::add(const LoadedRun& run, const toml::table& text) {
  run_ = &run;
  text_ = &text;
  if (first_ == nullptr) first_ = &run;
  compare_clock();
  compare_truth();
  listen_udp("truth.port", run.config.truth.port);
  if (const Transport* transport = transport_of(run.config.truth.port); transport != nullptr && !transport->ends)
    if (const std::string address = exclusive_address(run.config.truth.port); !address.empty())
      claim("truth.port", "port " + address, run.config.truth.port);
  listen_tcp("web.listen", run.config.web.listen);
  listen_tcp("control.listen", run.config.control.listen);
  if (const std::string& socket = run.config.control.socket; socket.starts_with('/'))
    claim("control.socket", "socket " + socket, socket);
  for (std::size_t i = 0; i < run.config.imus.size(); ++i) add_imu(run.config.imus[i], i);
}

}  // namespace imud
