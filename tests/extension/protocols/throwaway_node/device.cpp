// A node of SAE J1939 that exists for one test, over what protocols/j1939 has for every node: it claims its address,
// sends its rates, answers requests for them and for its software identification, and refuses all other requests.
#include "protocols/j1939/address.hpp"
#include "protocols/j1939/measured.hpp"
#include "protocols/j1939/transport.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire/deadlines.hpp"

namespace imud {
namespace {

using namespace j1939;

constexpr std::string_view identification = "\1throwaway node*";
constexpr Name name{.identity = 1, .arbitrary_address = true};
constexpr Header rates{.priority = 3, .pgn = pgn::angular_rate};

enum Count : std::size_t { moves, transfers_aborted, transfers_timed_out, counts_size };
constexpr DeviceCounter counters[counts_size] = {{"address_changes", "times the address was lost"},
                                                 {"transfers_aborted", "transfers were aborted"},
                                                 {"transfers_timed_out", "transfers timed out"}};

std::uint8_t address_in(const Settings& settings) {
  return static_cast<std::uint8_t>(settings.integer("source_address"));
}

class NodeDevice final : public Device {
 public:
  explicit NodeDevice(std::uint8_t address) noexcept
      : address_(address),
        transport_(pgn::commanded_address, counts_[transfers_aborted], counts_[transfers_timed_out]) {
    power_on({});
  }

  void power_on(DeviceTime now) noexcept override {
    newest_ = {};
    transport_.clear();
    claim_.power_on(address_, now);
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    newest_.rate = {sample.rate.x(), sample.rate.y(), sample.rate.z()};
    if (claim_.may_send(sample.time)) send(from_here(rates), encoded(ari, newest_), out);
  }

  void receive(const Frame& frame, DeviceTime now, FrameBuffer& replies) noexcept override {
    const auto message = Message::parse(frame);
    if (!message) return;
    const Header& header = message->header;
    if (header.pgn == pgn::address_claimed && claim_.on_claim(*message, now, replies)) {
      ++counts_[moves];
      transport_.clear();
    }
    if (header.pgn == pgn::request && (header.destination == claim_.address() || header.destination == everyone))
      answer(*message, now, replies);
    const auto data = transport_.receive(*message, own(now), now, replies);
    if (!data || data->size() != 9 || read_little(data->first<8>()) != name.word()) return;
    transport_.clear();
    const auto commanded = std::to_integer<std::uint8_t>(data->back());
    if (commanded < null_address) claim_.command(commanded, now, replies);
  }

  std::optional<DeviceTime> deadline() const noexcept override {
    return earlier(claim_.deadline(), transport_.deadline());
  }
  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    claim_.poll(now, out);
    transport_.poll(claim_.address(), now, out);
  }
  void step_clock(Nanoseconds by) noexcept override {
    claim_.step_clock(by);
    transport_.step_clock(by);
  }
  std::span<const std::uint64_t> counts() const noexcept override { return counts_; }

 private:
  std::uint8_t own(DeviceTime now) const noexcept { return claim_.may_send(now) ? claim_.address() : null_address; }
  Header from_here(Header header) const noexcept {
    header.source = claim_.address();
    return header;
  }

  void answer(const Message& request, DeviceTime now, FrameBuffer& replies) noexcept {
    const std::uint32_t wanted = request.number_at(0);
    const std::uint8_t node = request.header.source, to = request.header.destination == everyone ? everyone : node;
    if (wanted == pgn::address_claimed) return claim_.on_request(now, replies);
    if (!claim_.may_send(now)) return;
    if (wanted == rates.pgn) return send(from_here(rates), encoded(ari, newest_), replies);
    const bool is_sent =
        wanted == pgn::software_identification &&
        transport_.send(wanted, to, std::as_bytes(std::span(identification)), claim_.address(), now, replies);
    if (is_sent || to == everyone) return;
    constexpr std::uint64_t refused = 0xFFFF'FF01;
    send(from_here({.pgn = pgn::acknowledgement}), refused | std::uint64_t{node} << 32 | std::uint64_t{wanted} << 40,
         replies);
  }

  std::uint8_t address_;
  std::array<std::uint64_t, counts_size> counts_ = {};
  AddressClaim claim_{name, {}, {}};
  Transport transport_;
  Reading newest_;
};

class NodeDecoder final : public Decoder {
 public:
  explicit NodeDecoder(std::uint8_t address) noexcept : address_(address) {}
  void feed(const Frame& frame, MeasurementSink& sink) override {
    const auto message = Message::parse(frame);
    if (!message || message->header.pgn != rates.pgn || message->header.source != address_) return;
    std::array<double, 3> rate{};
    if (message->data.size() != 8 || !decode(rate_scale, read_little(message->data), rate)) {
      ++errors_.malformed;
      return;
    }
    Measurement measurement{.sample = {}, .fields = Measurement::rate};
    measurement.sample.rate = {rate[0], rate[1], rate[2]};
    sink.on_measurement(measurement);
  }

 private:
  std::uint8_t address_;
};

constexpr Setting settings[] = {
    {.key = "source_address", .help = "address", .initial = std::int64_t{32}, .max = 253}};

}  // namespace

extern constexpr Protocol throwaway_node_protocol = {
    .name = "throwaway-node",
    .summary = "the rate on SAE J1939",
    .link = Link::can,
    .document = "none",
    .settings = settings,
    .fields = Measurement::rate,
    .resolution = {.rate = rate_scale.lsb()},
    .range = {.rate = rate_scale.max()},
    .counters = counters,
    .can_messages = [](const Settings& chosen, double rate_hz) -> std::vector<CanMessage> {
      const std::uint8_t source = address_in(chosen);
      const Header claim{.pgn = pgn::address_claimed, .source = source};
      return {{Header{rates.priority, rates.pgn, everyone, source}.can(), 8, rate_hz}, {claim.can(), 8, 1}};
    },
    .can_filters = [](const Settings&) -> std::vector<CanFilter> { return {{.id = 0, .mask = 0, .extended = true}}; },
    .make = [](const Settings& chosen) -> std::unique_ptr<Device> {
      return std::make_unique<NodeDevice>(address_in(chosen));
    },
    .make_decoder = [](const Settings& chosen) -> std::unique_ptr<Decoder> {
      return std::make_unique<NodeDecoder>(address_in(chosen));
    },
};

}  // namespace imud
