// OpenIMU335RI and OpenIMU300RI on SAE J1939: the unit's own messages, and its answers. The attitude is the true one.
// All messages are raw CAN frames. The kernel's J1939 socket is not used, for three reasons: the unit alone decides
// about its address; every frame is a function of settings, truth and received frames; and logs and serial adapters
// can be used as a bus.
#include <algorithm>

#include "core/attitude.hpp"
#include "protocols/j1939/j1939.hpp"
#include "protocols/j1939/transport.hpp"
#include "protocols/wire/deadlines.hpp"

namespace imud {
namespace {

using namespace j1939;
using namespace std::chrono_literals;

constexpr auto pause_time = 6s;      // after a DM13 that stops, or one that holds
constexpr auto restart_time = 50ms;  // from a command to restart

// Control bytes of the acknowledgement.
enum Answer : unsigned { accepted, refused, cannot_respond = 3 };

enum Count : std::size_t { conflicts, moves, transfers_aborted, transfers_timed_out, requests_refused, counts_size };
constexpr DeviceCounter counters[counts_size] = {
    {"address_conflicts", "frames of other nodes with the unit's address",
     "another node uses the address of this unit: give each node a source_address and a NAME of its own"},
    {"address_changes", "times the address was lost",
     "a node with a lower NAME has taken the unit's address: the unit has moved to another one, or is silent"},
    {"transfers_aborted", "transfers were aborted"},
    {"transfers_timed_out", "transfers timed out"},
    {"requests_refused", "requests and settings were refused"},
};

class J1939Device final : public Device {
 public:
  explicit J1939Device(const Settings& settings)
      : unit_(unit_of(settings)),
        active_(configuration_of(settings)),
        stored_(active_),
        claim_(unit_.name, unit_.claim_wait, unit_.claim_period),
        transport_(pgn::commanded_address, counts_[transfers_aborted], counts_[transfers_timed_out]) {
    power_on({});
  }

  void power_on(DeviceTime now) noexcept override {
    active_ = stored_;
    ticks_ = 0;
    has_sample_ = false;
    paused_until_.reset();
    restart_at_.reset();
    transport_.clear();
    claim_.power_on(active_.address, now);
  }

  void sample(const Sample& sample, FrameBuffer& out) noexcept override {
    copy(sample, sample_);
    has_sample_ = true;
    if (active_.divider == 0 || ++ticks_ < active_.divider) return;
    ticks_ = 0;
    if (paused_until_ && sample.time < *paused_until_) return;
    paused_until_.reset();
    if (!claim_.may_send(sample.time)) return;
    send_packets(active_.packet_types, sample.time, out);
  }

  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override {
    const auto message = Message::parse(from_host);
    if (!message) return;
    note_source(*message);
    const bool is_mine = claim_.may_send(now) && message->header.destination == claim_.address();
    const bool is_for_all = message->header.destination == everyone;
    switch (message->header.pgn) {
      case pgn::address_claimed:
        on_claim(*message, now, replies);
        break;
      case pgn::request:
        if (is_for_all || message->header.destination == claim_.address()) on_request(*message, now, replies);
        break;
      case pgn::transfer_control:
      case pgn::transfer_data:
        on_transfer(*message, now, replies);
        break;
      case pgn::stop_start:
        if (is_mine || is_for_all) on_stop_start(*message, now);
        break;
      case pgn::memory_request:
        if (is_mine) refuse_memory_access(message->header.source, replies);
        break;
      default:
        if ((message->header.pgn & 0x3FF00U) == pgn::proprietary_b && claim_.may_send(now))
          on_setting(*message, now, replies);
        break;
    }
  }

  std::optional<DeviceTime> deadline() const noexcept override {
    return earlier(claim_.deadline(), earlier(transport_.deadline(), restart_at_));
  }

  void poll(DeviceTime now, FrameBuffer& out) noexcept override {
    if (restart_at_ && *restart_at_ <= now) power_on(now);
    claim_.poll(now, out);
    transport_.poll(claim_.address(), now, out);
  }

  void step_clock(Nanoseconds by) noexcept override {
    sample_.time = sample_.time + by;
    for (auto* time : {&paused_until_, &restart_at_})
      if (*time) *time = **time + by;
    claim_.step_clock(by);
    transport_.step_clock(by);
  }

  std::span<const std::uint64_t> counts() const noexcept override { return counts_; }

  // The filters are assumed to be of second order. At 100 samples a second the widest filter, of 50 Hz, would remove
  // nothing.
  std::optional<SensorFilters> filters() const noexcept override {
    const auto low_pass = [](std::uint8_t cutoff_hz) {
      SensorFilter filter;
      if (cutoff_hz < internal_hz / 2) filter.cut_off_hz = Vector3::Constant(cutoff_hz);
      return filter;
    };
    return SensorFilters{.gyro = low_pass(active_.rate_filter_hz),
                         .accelerometer = low_pass(active_.force_filter_hz),
                         .magnetometer = {}};
  }

 private:
  void note_source(const Message& message) noexcept {
    const std::uint8_t source = message.header.source;
    if (source == null_address) return;
    if (source == claim_.address())
      ++counts_[conflicts];
    else if (source != everyone)
      claim_.on_other(source);
  }

  void on_claim(const Message& message, DeviceTime now, FrameBuffer& replies) noexcept {
    if (!claim_.on_claim(message, now, replies)) return;
    ++counts_[moves];
    transport_.clear();
    keep_address();
  }

  // Stores the present address, which the unit claims at the next power on, as the firmware does.
  void keep_address() noexcept {
    if (claim_.address() != null_address) active_.address = stored_.address = claim_.address();
  }

  void on_transfer(const Message& message, DeviceTime now, FrameBuffer& replies) noexcept {
    const std::uint8_t own = claim_.may_send(now) ? claim_.address() : null_address;
    const auto data = transport_.receive(message, own, now, replies);
    if (!data || data->size() != 9 || read_little(data->first<8>()) != unit_.name.word()) return;
    const auto address = std::to_integer<std::uint8_t>((*data)[8]);
    if (address >= null_address) return;
    transport_.clear();
    claim_.command(address, now, replies);
    keep_address();
  }

  Header header(std::uint32_t number) const noexcept { return {.pgn = number, .source = claim_.address()}; }

  // Sends the first `size` bytes of `word`; padded to 8 bytes if Model::pads.
  void answer(std::uint32_t number, std::uint64_t word, std::size_t size, FrameBuffer& out) const noexcept {
    constexpr std::uint64_t padding = 0xAAAA'AAAA'AAAA'AAAA;
    if (size < 8) word |= padding << 8 * size;
    send(header(number), Data(bytes_of(word)).first(unit_.model->pads ? 8 : size), out);
  }

  // Sends an acknowledgement. Its group function value, byte 1, is not applicable.
  void acknowledge(Answer control, std::uint32_t number, std::uint8_t node, FrameBuffer& out) noexcept {
    if (control != accepted) ++counts_[requests_refused];
    send(header(pgn::acknowledgement),
         std::uint64_t{control} | 0xFFFF'FF00U | std::uint64_t{node} << 32 | std::uint64_t{number} << 40, out);
  }

  void on_request(const Message& message, DeviceTime now, FrameBuffer& replies) noexcept {
    if (message.data.size() != 3) return;
    const std::uint32_t number = message.number_at(0);
    const std::uint32_t swapped = message[0] == 0 ? std::uint32_t{message[1]} << 8 | message[2] : 0U;
    ByteOrder order = unit_.request_order;
    if (order == ByteOrder::j1939 && (active_.behavior & swapped_request) != 0) order = ByteOrder::swapped;
    std::optional<Answer> refusal = refused;
    if (order != ByteOrder::swapped) refusal = fulfil(number, message.header, now, replies);
    if (order != ByteOrder::j1939 && refusal == refused && swapped != 0)
      refusal = fulfil(swapped, message.header, now, replies);
    if (!refusal || !claim_.may_send(now) || message.header.destination == everyone) return;
    acknowledge(*refusal, order == ByteOrder::swapped ? swapped : number, message.header.source, replies);
  }

  // Answers a request. Returns the answer for a refusal if the request cannot be fulfilled.
  std::optional<Answer> fulfil(std::uint32_t number, const Header& request, DeviceTime now,
                               FrameBuffer& replies) noexcept {
    if (number == pgn::address_claimed) {
      claim_.on_request(now, replies);
      return std::nullopt;
    }
    if (!claim_.may_send(now)) return cannot_respond;
    if (number == pgn::ecu_identification || number == pgn::software_identification)
      return identify(number, request, now, replies);
    for (unsigned bit = 0; bit < unit_.model->packet_bits.size(); ++bit) {
      const Packet packet = unit_.model->packet_bits[bit];
      if (packet == packets || active_.header_of(packet).pgn != number) continue;
      if (!has_sample_) return cannot_respond;
      send_packets(1U << bit, now, replies);
      return std::nullopt;
    }
    if ((number & ~0xFFU) != pgn::proprietary_b) return refused;
    const auto settings = report(active_, active_.function_of(number & 0xFFU), request.source);
    if (!settings) return refused;
    answer(number, settings->word, settings->size, replies);
    return std::nullopt;
  }

  std::optional<Answer> identify(std::uint32_t number, const Header& request, DeviceTime now,
                                 FrameBuffer& replies) noexcept {
    const bool is_software = number == pgn::software_identification;
    if (unit_.has_texts) {
      const std::string& text = is_software ? unit_.software_text : unit_.ecu_text;
      const std::uint8_t to = request.destination == everyone ? everyone : request.source;
      if (!transport_.send(number, to, std::as_bytes(std::span(text)), claim_.address(), now, replies))
        return cannot_respond;
    } else {
      constexpr std::uint64_t version = 0x00'00'05'00'01;  // 1.0.5.0.0, the first number in the low byte
      answer(number, is_software ? version : unit_.name.word(), is_software ? 5 : 8, replies);
    }
    return std::nullopt;
  }

  // Sends a DM15: the operation has failed, with the firmware's code for "no boot loader".
  void refuse_memory_access(std::uint8_t node, FrameBuffer& replies) noexcept {
    ++counts_[requests_refused];
    constexpr unsigned failed = 5;
    Header to_node = header(pgn::memory_response);
    to_node.destination = node;
    send(to_node, 1ULL << 8 | failed << 9 | 0x16ULL << 16 | 0x06ULL << 40 | 0xFFFFULL << 48, replies);
  }

  // Processes a DM13. Bits 6 and 7 of byte 0 are for the network that carries the message: 0: stop, 1: start.
  void on_stop_start(const Message& message, DeviceTime now) noexcept {
    if (message.data.empty()) return;
    const unsigned command = message[0] >> 6, hold = message[3] >> 4;
    if (command == 1)
      paused_until_.reset();
    else if (command == 0 || (paused_until_ && hold <= 1))
      paused_until_ = now + pause_time;
  }

  void on_setting(const Message& message, DeviceTime now, FrameBuffer& replies) noexcept {
    const unsigned extension = message.header.pgn & 0xFFU;
    const std::uint8_t host = message.header.source;
    const Function function = active_.function_of(extension);
    if (function == save || function == reset_algorithm) {
      // Byte 0: 0: execute; 2: execute and restart; 1: an answer of another unit, which has the same number.
      const unsigned request = message[0];
      if (message.data.size() < 2 || message[1] != claim_.address() || (request != 0 && request != 2)) return;
      if (function == save) stored_ = active_;
      answer(message.header.pgn, 1ULL | std::uint64_t{host} << 8 | 1ULL << 16, 3, replies);
      if (request == 2) restart_at_ = now + restart_time;
      return;
    }
    if (message.data.size() < 2 || message[0] != claim_.address()) return;
    bool is_done = false;
    if (extension == bank_0 || extension == bank_1) {
      set_bank(active_, *unit_.model, extension, message);
      is_done = true;
    } else if (function != functions) {
      if (is_only_reported(function)) return;
      is_done = set(active_, *unit_.model, function, message);
    } else if (std::ranges::find(unit_.model->unsupported, extension) == unit_.model->unsupported.end()) {
      return;
    }
    if (!is_done || unit_.acknowledges) acknowledge(is_done ? accepted : refused, message.header.pgn, host, replies);
  }

  static bool is_only_reported(Function function) noexcept {
    return (function >= hardware_status && function <= master_status) || function >= fine_rate;
  }

  // Sends the messages of `types`, bits of Model::packet_bits, in ascending order of identifiers.
  void send_packets(unsigned types, DeviceTime now, FrameBuffer& out) const noexcept {
    const Reading reading = read(now);
    struct Entry {
      Header header;
      Packet packet;
    };
    std::array<Entry, 6> entries;
    std::size_t count = 0;
    for (unsigned bit = 0; bit < unit_.model->packet_bits.size(); ++bit) {
      if ((types >> bit & 1U) == 0) continue;
      const Packet packet = unit_.model->packet_bits[bit];
      entries[count++] = {active_.header_of(packet), packet};
    }
    const auto sorted = std::span(entries).first(count);
    std::ranges::make_heap(sorted, {}, [](const Entry& entry) { return entry.header.id(); });
    std::ranges::sort_heap(sorted, {}, [](const Entry& entry) { return entry.header.id(); });
    for (Entry& entry : sorted) {
      entry.header.source = claim_.address();
      send(entry.header, encoded(entry.packet, reading), out);
    }
  }

  Reading read(DeviceTime now) const noexcept {
    const Matrix3 dcm_OP = dcm_of_orientation(active_.orientation).value_or(Matrix3::Identity());
    const bool is_z_up = (active_.behavior & z_up) != 0, are_swapped = (active_.behavior & swap_slots) != 0;
    const Vector3 signs = is_z_up ? Vector3(1, -1, -1) : Vector3(1, 1, 1);
    const auto in_axes = [&](const Vector3& v) -> Vector3 { return signs.cwiseProduct(dcm_OP * v); };
    const std::array<int, 3> axes = are_swapped ? std::array{1, 0, 2} : std::array{0, 1, 2};
    const Vector3 rate = in_axes(sample_.rate), force = in_axes(sample_.specific_force),
                  field = in_axes(sample_.magnetic_field);
    const Vector3 angles = yaw_pitch_roll_from_dcm(dcm_OP * sample_.q_LP.conjugate().toRotationMatrix());
    Reading r;
    for (std::size_t slot = 0; slot < 3; ++slot) {
      const int axis = axes[slot];
      r.rate[slot] = rate[axis];
      r.force[slot] = force[axis];
      r.magnetic_field[slot] = field[static_cast<int>(slot)];
      r.rate_merit[slot] = merit(status::gyro_saturated_x, dcm_OP, axis);
      r.force_merit[slot] = merit(status::accelerometer_saturated_x, dcm_OP, axis);
    }
    r.pitch = signs.y() * angles[1];
    r.roll = angles[2];
    r.pitch_rate = rate.y();
    r.pitch_rate_merit = merit(status::gyro_saturated_x, dcm_OP, 1);
    r.latitude = sample_.navigation.latitude;
    r.longitude = sample_.navigation.longitude;
    r.angle_merit = unit_.model->has_merits ? common_merit() : merit_not_available;
    const auto age = (now - sample_.time) / 500us;
    r.latency = static_cast<std::uint8_t>(std::clamp<std::int64_t>(unit_.latency + age, 0, 250));
    r.mode = unit_.model->has_merits && (active_.behavior & raw_rates) != 0 ? 1 : 0;
    r.rounds = unit_.model->rounds;
    r.has_force_latency = unit_.model->has_merits;
    return r;
  }

  Merit common_merit() const noexcept {
    if ((sample_.status & status::not_valid) != 0) return merit_not_available;
    return (sample_.status & (status::truth_extrapolated | status::truth_stale)) != 0 ? merit_degraded : merit_good;
  }

  // Returns the figure of merit of a number. `saturated_x` is the status bit of the x axis; `axis`, from 0 to
  // 2, is of O, the axes in which the unit sends; saturation of any own axis that contributes to it counts.
  Merit merit(std::uint32_t saturated_x, const Matrix3& dcm_OP, int axis) const noexcept {
    if (!unit_.model->has_merits) return merit_not_available;
    for (int own = 0; own < 3; ++own)
      if (dcm_OP(axis, own) != 0 && (sample_.status & saturated_x << own) != 0) return merit_out_of_range;
    return common_merit();
  }

  std::array<std::uint64_t, counts_size> counts_ = {};
  Unit unit_;
  Configuration active_, stored_;
  AddressClaim claim_;
  Transport transport_;
  Sample sample_;  // the newest one
  bool has_sample_ = false;
  unsigned ticks_ = 0;  // samples since the last output
  std::optional<DeviceTime> paused_until_, restart_at_;
};

}  // namespace

extern constexpr Protocol j1939_protocol = {
    .name = "j1939",
    .summary = "SAE J1939 inertial unit: ACEINNA OpenIMU335RI and OpenIMU300RI",
    .link = Link::can,
    .document = "SAE J1939-21, -71, -81; github.com/Aceinna/openIMU335RI-lib 487c4fc, openIMU300-lib dee364f",
    .settings = declared_settings,
    .fields = Measurement::rate | Measurement::specific_force,
    .resolution = {.rate = rate_scale.lsb(), .specific_force = force_scale.lsb()},
    .range = {.rate = rate_scale.max(), .specific_force = force_scale.max()},
    .counters = counters,
    .can_messages = can_messages,
    .can_filters = can_filters,
    .bus_name = bus_name,
    .product = product_of,
    .make = make_as<Device, J1939Device>,
    .make_decoder = j1939::make_decoder,
};

}  // namespace imud
