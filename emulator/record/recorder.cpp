#include "emulator/record/recorder.hpp"

#include <chrono>
#include <ctime>
#include <utility>

#include "transports/capture/pcapng_reader.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

// Returns the difference from the host's time to the time since 1970.
std::int64_t realtime_offset() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec - host_now().ns;
}

}  // namespace

Recorder::Recorder(const RecordOptions& options, bool waits, std::size_t size)
    : StepSink(true), waits_(waits), file_(options, counters_), path_(file_.path()), ring_(size) {
  add_interface(std::string(events_interface), link_type::event);
  add_interface(std::string(config_interface), link_type::text);
}

Recorder::~Recorder() { finish(); }

std::uint16_t Recorder::add_interface(std::string name, std::uint16_t link_type) {
  interfaces_.push_back({link_type, std::move(name)});
  return static_cast<std::uint16_t>(interfaces_.size() - 1);
}

void Recorder::start(bool is_live, std::string config) {
  file_.begin({.interfaces = interfaces_,
               .config = std::move(config),
               .offset_ns = realtime_offset(),
               .flags = is_live ? RecordEvent::is_live : std::uint8_t{0},
               .truth = truth_},
              host_now());
  set_time(host_now());  // the time of the events before the first that sets its own
  writer_ = std::thread([this] { write(); });
}

void Recorder::finish() {
  stop_ = true;
  if (writer_.joinable()) writer_.join();
}

void Recorder::keep_event(const RecordEvent& event) noexcept {
  push({.interface = 0, .time = now()}, encode_record_event(event));
}

void Recorder::keep_packet(std::uint16_t interface, PacketDirection direction, HostTime time, const Frame& frame,
                           const Endpoint& peer) noexcept {
  push({.interface = interface, .direction = direction, .can = frame.can, .time = time, .peer = peer}, frame.bytes);
}

void Recorder::push(const PacketRing::Head& head, std::span<const std::byte> bytes) noexcept {
  constexpr std::size_t mark = RecordEvent::size + sizeof(PacketRing::Head);
  const std::size_t needed = bytes.size() + (missing_ > 0 ? mark : 0);
  while (waits_ && !ring_.has_room(needed)) std::this_thread::sleep_for(std::chrono::microseconds(100));
  if (!ring_.has_room(needed)) {
    ++missing_;
    counters_.lost.count();
    return;
  }
  if (const auto lost = static_cast<std::int64_t>(std::exchange(missing_, 0)); lost > 0)
    ring_.push({.interface = 0, .time = now()}, encode_record_event({.type = RecordEvent::Type::lost, .a = lost}));
  ring_.push(head, bytes);
}

// Writes the content of the queue every 10 ms.
void Recorder::write() noexcept {
  PacketRing::Head head;
  std::vector<std::byte> bytes;
  bytes.reserve(PcapngReader::longest_block);
  for (bool stop = false; !stop;) {
    stop = stop_.load();  // before the last look into the queue
    while (ring_.pop(head, bytes)) file_.add(head, bytes);
    file_.flush();
    if (!stop) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace imud
