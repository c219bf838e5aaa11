#include "emulator/drive/recorded_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace imud {

namespace {
using Type = RecordEvent::Type;
}  // namespace

// A port that is fed from the record.
class RecordedRun::Input final : public Port {
 public:
  Input(RecordedRun& run, bool is_stream) : run_(run), is_stream_(is_stream) {}

  void feed(std::span<const std::byte> bytes, HostTime time, const Endpoint& from) {
    waiting_.push_back({{bytes.begin(), bytes.end()}, time, from, std::exchange(disconnects_, 0)});
  }
  void disconnect() noexcept { ++disconnects_; }
  void end() noexcept { ended_ = true; }

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }
  std::optional<Received> receive() noexcept override {
    if (waiting_.empty()) {
      counters_.lost_count += std::exchange(disconnects_, 0);
      return std::nullopt;
    }
    current_ = std::move(waiting_.front());
    waiting_.pop_front();
    counters_.lost_count += current_.disconnects;
    return Received{{current_.bytes}, current_.time, current_.from};
  }
  bool at_end() const noexcept override { return (ended_ || run_.has_end_) && waiting_.empty(); }
  std::string_view end_warning() const noexcept override { return run_.end_warning(); }
  std::optional<double> progress() const noexcept override { return run_.reader_.progress(); }
  std::optional<bool> keeps_datagrams() const noexcept override { return !is_stream_; }

 private:
  struct Packet {
    std::vector<std::byte> bytes;
    HostTime time;
    Endpoint from;
    std::uint64_t disconnects = 0;  // before it
  };
  RecordedRun& run_;
  const bool is_stream_;
  std::deque<Packet> waiting_;
  std::uint64_t disconnects_ = 0;
  bool ended_ = false;
  Packet current_;
};

RecordedRun::RecordedRun(const PortSpec& spec, const Config& config)
    : reader_(spec), imus_(config.imus), has_frame_faults_(config.control.frame_faults), config_(config) {
  constexpr std::size_t most_early = 10'000;
  while (!first_ && !reader_.at_end() && early_.size() < most_early) {
    const auto packet = reader_.next();
    if (!packet) continue;
    const std::uint16_t link = reader_.interfaces()[packet->interface].link_type;
    if (link == link_type::event)
      first_ = packet;
    else if (link != link_type::text)
      early_.push_back({*packet, {packet->bytes.begin(), packet->bytes.end()}});
  }
  if (first_) base_ = static_cast<std::uint16_t>(first_->interface);
  const auto has = [this](std::string_view name) {
    const auto all = reader_.interfaces();
    return std::any_of(all.begin(), all.end(), [&](const PcapngInterface& i) { return i.name == name; });
  };
  const auto begin = first_ ? decode_record_event(first_->bytes) : std::nullopt;
  constexpr std::string_view only_truth = "the capture record:FILE is its truth alone";
  if (!begin || begin->type != Type::begin || begin->c < RecordEvent::oldest_version ||
      begin->c > RecordEvent::version)
    throw spec.error(fmt::format("is no record of a run by this version of imud; {}", only_truth));
  if (begin->b != 1)
    throw spec.error(fmt::format("is file {} of a record: a run can be repeated from its beginning only; {}",
                                 begin->b, only_truth));
  std::vector<std::string> missing;
  for (const ImuConfig& imu : config.imus)
    if (!has(imu.name)) missing.push_back(imu.name);
  if (!missing.empty()) throw spec.error(fmt::format("has no imu {}; {}", fmt::join(missing, ", "), only_truth));
  is_live_ = (begin->flags & RecordEvent::is_live) != 0;
  offset_ns_ = begin->a;
}

Config RecordedRun::adapted(Config config) const {
  config.truth.limits.gap_begins_run = !is_live_;
  return config;
}

Ports RecordedRun::ports(Ports others) {
  return [this, others = std::move(others)](const PortUse& use) {
    const bool is_truth = use.of == PortUse::Of::truth;
    if (!is_truth && use.of != PortUse::Of::trigger && use.of != PortUse::Of::pps) return others(use);
    const std::string name = is_truth ? std::string(truth_interface)
                                      : imus_[use.imu].name + (use.of == PortUse::Of::pps ? " pps" : " trigger");
    const auto all = reader_.interfaces();
    const auto found = std::find_if(all.begin(), all.end(), [&](const PcapngInterface& i) { return i.name == name; });
    const bool is_stream = is_truth && found != all.end() && found->link_type == link_type::bytes;
    auto input = std::make_unique<Input>(*this, is_stream);
    inputs_.emplace(name, input.get());
    return std::unique_ptr<Port>(std::move(input));
  };
}

void RecordedRun::run(Engine& engine, Host& host, const Options& options, const std::atomic<bool>& stop) noexcept {
  engine_ = &engine;
  host_ = &host;
  options_ = options;
  pace_.emplace(engine, host, options.pace, stop);
  stop_ = &stop;
  for (Early& early : early_) {
    early.packet.bytes = early.bytes;
    feed(early.packet, reader_.interfaces()[early.packet.interface].name, time_of(early.packet));
  }
  early_.clear();
  while (!ended_ && !stop.load(std::memory_order_relaxed)) {
    const auto packet = first_ ? std::exchange(first_, std::nullopt) : reader_.next();
    if (!packet) {
      if (reader_.at_end()) break;
      continue;
    }
    ++packets_;
    const HostTime time = time_of(*packet);
    if (!begin_) begin_ = time;
    if (options.duration && time - *begin_ > *options.duration) return;
    const PcapngInterface& interface = reader_.interfaces()[packet->interface];
    if (interface.link_type != link_type::event) {
      feed(*packet, interface.name, time);
    } else if (reload_) {
      add_to_reload(packet->bytes);
    } else if (const auto event = decode_record_event(packet->bytes)) {
      is_damaged_ = !is_plausible(*event, time);
      if (event->type == Type::begin && event->b != ++files_) next_file_ = event->b;
      if (is_damaged_ || next_file_) break;
      execute(*event);
    } else if (begin_fault_) {
      begin_fault(*std::exchange(begin_fault_, std::nullopt), packet->bytes);
    }
  }
  if (ended_) find_second_run();
  take_awaited(true);
  has_end_ = !stop.load(std::memory_order_relaxed);
  lacks_end_ = has_end_ && !ended_ && !is_damaged_ && !next_file_;
  engine.apply(Step::truth(engine.watermark()));  // finds the end
}

// Reads on after the end of the run: files of several runs may have been put together.
void RecordedRun::find_second_run() noexcept {
  while (!next_file_ && !reader_.at_end() && !stop_->load(std::memory_order_relaxed)) {
    const auto packet = reader_.next();
    if (!packet || reader_.interfaces()[packet->interface].link_type != link_type::event) continue;
    if (const auto event = decode_record_event(packet->bytes); event && event->type == Type::begin) next_file_ = 1;
  }
}

// The arithmetic is unsigned, because the time of a damaged packet may wrap around.
HostTime RecordedRun::time_of(const PcapngPacket& packet) const noexcept {
  return HostTime{
      static_cast<std::int64_t>(static_cast<std::uint64_t>(packet.time_ns) - static_cast<std::uint64_t>(offset_ns_))};
}

// `time`: the time of its packet. Returns false if sums of the times may overflow, or if devices would be polled for
// more than an hour.
bool RecordedRun::is_plausible(const RecordEvent& event, HostTime time) noexcept {
  constexpr std::int64_t hour = 3'600'000'000'000, limit = std::int64_t{1} << 62;
  constexpr std::int64_t most_samples = 10'000'000'000'000;
  if (event.type == Type::begin) return true;
  const auto is_in_range = [](std::int64_t ns) { return ns > -limit && ns < limit; };
  // Where no clock paces the run, hosts are served at the instants of the samples.
  const auto is_near = [&](std::int64_t ns) {
    return is_in_range(ns) && std::min(std::abs(ns - time.ns), std::abs(ns - instant_.ns)) <= hour;
  };
  const auto is_polled = [&](std::int64_t ns) { return ns == 0 || is_near(ns); };
  if (!is_in_range(time.ns)) return false;
  switch (event.type) {
    case Type::power_on:
      return is_near(event.a);
    case Type::receive:
      return event.a == 0 || is_near(event.a);  // in older records, where truth paces the run
    case Type::power_cycle:
      return is_near(event.a) && is_polled(event.b);
    case Type::run:
    case Type::end:
      return is_polled(event.b);
    case Type::transmit:
      if (!is_in_range(event.a) || !is_polled(event.b)) return false;
      instant_ = HostTime{event.a};
      return true;
    case Type::set_clock:
      return is_in_range(event.a) && is_in_range(event.b);
    case Type::advance:
      return is_in_range(event.a);
    case Type::sample: {
      bool is_next = is_in_range(event.a) && event.c >= 0 && event.c < most_samples;
      for_imus(event, [&](std::uint16_t imu) {
        const auto offset = [&](std::int64_t k) {
          return engine_->channels()[imu]->sensor.grid().offset(static_cast<std::uint64_t>(k)).count();
        };
        std::int64_t& last = last_samples_[imu];
        is_next = is_next && offset(event.c) < limit / 2 && offset(event.c) - offset(last) <= hour;
        if (is_next) last = event.c;
      });
      return is_next;
    }
    default:
      return true;
  }
}

// Gives a received packet to its port: truth, an edge, or the bytes of a host.
void RecordedRun::feed(const PcapngPacket& packet, const std::string& interface, HostTime time) noexcept {
  if (packet.direction != PacketDirection::inbound) return;
  const std::uint16_t link = reader_.interfaces()[packet.interface].link_type;
  if (const auto [first, last] = inputs_.equal_range(interface); first != last) {
    const UdpPacket datagram = link == link_type::raw_ip ? decode_udp_packet(packet.bytes) : UdpPacket{};
    for (auto input = first; input != last; ++input) {
      if (link != link_type::raw_ip)
        input->second->feed(packet.bytes, time, {});
      else if (datagram.outcome == UdpPacket::Outcome::whole)
        input->second->feed(datagram.payload, time, datagram.from);
    }
    return;
  }
  if (receive_) return receive(*std::exchange(receive_, std::nullopt), packet.bytes, link);
  if (interface.ends_with(" host")) from_hosts_.push_back({packet, {packet.bytes.begin(), packet.bytes.end()}});
}

void RecordedRun::receive(const RecordEvent& event, std::span<const std::byte> bytes, std::uint16_t link) noexcept {
  std::optional<Frame> frame = Frame{bytes};
  if (link == link_type::can_socketcan) frame = decode_can_packet(bytes);
  if (!frame) return;
  for_imus(event, [&](std::uint16_t imu) {
    engine_->apply(
        Step::receive(imu, event.flags, HostTime{event.a}, {.frame = *frame, .arrival = HostTime{event.a}}));
  });
}

void RecordedRun::poll(std::int64_t polled_ns) noexcept {
  engine_->apply(Step::deadlines(HostTime{polled_ns}));
  for (const auto& channel : engine_->channels()) channel->flush();
}

void RecordedRun::execute(const RecordEvent& event) noexcept {
  switch (event.type) {
    case Type::begin:
      offset_ns_ = event.a;
      break;
    case Type::truth:
      process_truth(event);
      break;
    case Type::disconnected:
      if (const auto truth = inputs_.find(std::string(truth_interface)); truth != inputs_.end())
        (event.flags & RecordEvent::input_ended) != 0 ? truth->second->end() : truth->second->disconnect();
      break;
    case Type::forget_past:
      if (!engine_->timeline().empty()) engine_->quality().resumed.count();
      [[fallthrough]];
    case Type::run:
      take_awaited(true);
      propose(event);
      break;
    case Type::set_clock:  // numbers the imu's samples from 0 again
      for_imus(event, [&](std::uint16_t imu) { take_awaited_of(imu, true); });
      propose(event);
      break;
    case Type::sample:
      for_imus(event, [&](std::uint16_t imu) { take_sample(imu, event); });
      break;
    case Type::transmit:
      transmit(event);
      break;
    case Type::receive:
      receive_ = event;
      if (!from_hosts_.empty()) {
        // The first bytes from the host of this line.
        constexpr std::uint32_t per_line = 3, of_host = 1;
        const std::uint32_t host = base_ + event.interface + per_line * event.flags + of_host;
        const auto early = std::find_if(from_hosts_.begin(), from_hosts_.end(),
                                        [&](const Early& one) { return one.packet.interface == host; });
        if (early == from_hosts_.end()) break;
        receive_.reset();
        receive(event, early->bytes, reader_.interfaces()[host].link_type);
        from_hosts_.erase(early);
      }
      break;
    case Type::lost:
      lost_ += static_cast<std::uint64_t>(std::max<std::int64_t>(event.a, 0));
      break;
    case Type::command:
      repeat_command(event);
      break;
    case Type::mark:
      break;
    case Type::end:
      ended_ = true;
      [[fallthrough]];
    default:
      propose(event);
      break;
  }
}

// Proposes the event as a step of the imus of its name, or of all imus. Before the step, polls the deadlines up to
// the time to which they were polled in the recorded run.
void RecordedRun::propose(const RecordEvent& event) noexcept {
  if (traits_of(event).has_polled_time) poll(event.b);
  const bool is_of_all = event.type == Type::command && event.interface == RecordEvent::all_imus;
  if (!traits_of(event).is_of_imu && (event.type != Type::command || is_of_all)) {
    engine_->apply({event});
  } else {
    for_imus(event, [&](std::uint16_t imu) { engine_->apply({event, imu}); });
  }
}

// Pieces of a stream may have come without a record in them. Records up to version 2 have no events of withheld
// truths.
void RecordedRun::process_truth(const RecordEvent& event) noexcept {
  TruthIntake& intake = engine_->intake();
  if (event.flags == static_cast<std::uint8_t>(TruthIntake::Outcome::new_run)) take_awaited(true);
  using Outcome = TruthIntake::Outcome;
  constexpr int most = 1024;
  const bool is_withheld = event.flags == static_cast<std::uint8_t>(Outcome::withheld);
  auto outcome = Outcome::nothing;
  for (int i = 0; i < most && (outcome == Outcome::nothing || (outcome == Outcome::withheld && !is_withheld));) {
    outcome = engine_->apply(Step::truth(TruthTime{event.b}));
    if (outcome == Outcome::nothing) ++i;
  }
  take_awaited(false);
  const bool is_same_time = !TruthIntake::is_taken(outcome) || intake.truth().time.ns == event.a;
  if (static_cast<std::uint8_t>(outcome) != event.flags || !is_same_time) ++differing_;
}

std::string RecordedRun::difference() const {
  std::string all = change();
  if (lacks_end_)
    all += fmt::format("{}the record has no end: its run was killed, or later files are missing",
                       all.empty() ? "" : "; ");
  return all;
}

std::string RecordedRun::change() const {
  if (is_damaged_)
    return fmt::format("the record is damaged: packet {} has an impossible time, and what follows it is left out",
                       packets_);
  if (next_file_ == 1)
    return "a second run begins in the record, and is left out: the files of one run make a record";
  if (next_file_)
    return fmt::format(
        "file {} of the record is missing or out of order: file {} comes in its place, and is left out", files_,
        *next_file_);
  if (lost_ > 0) return fmt::format("the record lacks {} packets: what follows them is not that of the run", lost_);
  if (faults_missing_ > 0)
    return fmt::format("{} faults that were begun by control cannot be repeated: {}", faults_missing_,
                       engine_->faults().can_grow() ? "the record does not have them"
                                                    : "give faults = true in [control] of the configuration");
  if (reloads_missing_ > 0)
    return fmt::format(
        "{} reloads of the configuration cannot be repeated: the record does not have it, or it has "
        "faults here",
        reloads_missing_);
  if (differing_ > 0)
    return fmt::format("truth was processed differently from the run {} times: was the configuration another?",
                       differing_);
  return {};
}

}  // namespace imud
