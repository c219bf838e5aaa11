// One interface of a record that imud has written (pcapng).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <utility>

#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr PortOption interface_option = {
    .key = "interface", .help = "name of the interface in the record (truth), such as the name of an imu"};

class RecordPort final : public Port {
 public:
  RecordPort(const PortSpec& spec, const PortSettings& settings)
      : reader_(spec),
        admitted_(settings.from),
        name_(spec.text(interface_option.key).value_or(std::string(truth_interface))) {
    if (reader_.descriptor() >= 0) return;  // a pipe: its interfaces are found when it is read
    // The interfaces precede the first packet, which is kept.
    while (!waiting_ && !reader_.at_end()) waiting_ = reader_.next();
    const auto all = reader_.interfaces();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const PcapngInterface& i) { return i.name == name_; });
    if (found == all.end()) {
      std::vector<std::string> names;
      for (const PcapngInterface& interface : all)
        if (interface.link_type != link_type::event && interface.link_type != link_type::text)
          names.push_back(interface.name);
      throw spec.error(
          fmt::format("has no interface \"{}\"; right would be one of {}", name_, fmt::join(names, ", ")));
    }
    is_stream_ = found->link_type == link_type::bytes;
  }

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }

  std::optional<Received> receive() noexcept override {
    constexpr int most = 1024;  // packets that are skipped in one call, so that the caller can do other work
    for (int i = 0; i < most; ++i) {
      const auto packet = waiting_ ? std::exchange(waiting_, std::nullopt) : reader_.next();
      if (!packet) break;
      if (auto received = decode(*packet)) {
        ++counters_.received;
        return received;
      }
    }
    return std::nullopt;
  }

  bool at_end() const noexcept override { return reader_.at_end() && !waiting_; }
  std::string_view end_warning() const noexcept override { return reader_.end_warning(); }
  std::optional<double> progress() const noexcept override { return reader_.progress(); }
  std::optional<bool> keeps_datagrams() const noexcept override { return !is_stream_; }
  int descriptor() const noexcept override { return reader_.descriptor(); }

 private:
  std::optional<Received> decode(const PcapngPacket& packet) noexcept {
    const PcapngInterface& interface = reader_.interfaces()[packet.interface];
    if (interface.name != name_) return std::nullopt;
    // The inbound packets are truth. An imu's interface has outbound packets only.
    if (name_ == truth_interface && packet.direction == PacketDirection::outbound) return std::nullopt;
    const HostTime time{packet.time_ns};
    if (interface.link_type == link_type::can_socketcan) {
      const auto frame = decode_can_packet(packet.bytes);
      if (!frame) ++counters_.truncated;
      return frame ? std::optional(Received{*frame, time}) : std::nullopt;
    }
    if (interface.link_type != link_type::raw_ip) return Received{{packet.bytes}, time};
    const UdpPacket datagram = decode_udp_packet(packet.bytes);
    if (datagram.outcome != UdpPacket::Outcome::whole) {
      ++counters_.truncated;
      return std::nullopt;
    }
    if (admitted_ && !admitted_->admits(datagram.from)) {
      ++counters_.foreign;
      counters_.foreign_from = datagram.from;
      return std::nullopt;
    }
    return Received{{datagram.payload}, time, datagram.from};
  }

  PcapngReader reader_;
  const std::optional<Endpoint> admitted_;
  const std::string name_;
  std::optional<PcapngPacket> waiting_;  // read ahead
  bool is_stream_ = false;
};

bool is_record(const std::string& path) {
  try {
    PcapngReader reader(PortSpec{"record", path, {}});
    if (reader.descriptor() >= 0) return false;
    static_cast<void>(reader.next());
    const auto all = reader.interfaces();
    return std::any_of(all.begin(), all.end(), [](const PcapngInterface& i) {
      return i.name == events_interface && i.link_type == link_type::event;
    });
  } catch (const PortError&) {
    return false;
  }
}

}  // namespace

extern constexpr Transport record_transport = {
    .name = "record",
    .summary = "one interface of a record of imud (pcapng): truth, or what an imu sent or received",
    .syntax = "record:PATH?interface=NAME",
    .example = "record:run.pcapng?interface=truth",
    .document = "draft-ietf-opsawg-pcapng-01",
    .options = {&interface_option, 1},
    .carries_any = true,
    .keeps_datagrams = true,
    .ends = true,
    .brings_truth = true,
    .serves_device = false,
    .has_path = true,
    .is_record = is_record,
    .open = open_as<RecordPort>,
};

}  // namespace imud
