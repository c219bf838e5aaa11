#include "emulator/sync.hpp"

#include <algorithm>
#include <boost/endian/conversion.hpp>

namespace imud {

namespace {
constexpr Nanoseconds furthest = std::chrono::seconds(10);  // ahead
constexpr int most = 16;                                    // at a time: a flood does not delay samples
}  // namespace

Sync::Sync(const SyncConfig& config, const OpenPort& open) {
  if (!config.trigger_port.empty()) trigger_.port = open(config.trigger_port, Role::listener);
  if (!config.pps_port.empty()) pps_.port = open(config.pps_port, Role::listener);
  if (!config.tov_port.empty()) tov_ = open(config.tov_port, Role::device);
}

void Sync::ignore() noexcept {
  for (Input* input : {&trigger_, &pps_}) {
    input->count = 0;
    for (int i = 0; input->port != nullptr && i < most && input->port->receive(); ++i) {
    }
  }
  last_.reset();
}

void Sync::tell(Device& device, TruthTime time, DeviceTime stamp) noexcept {
  if (time < time_) trigger_.count = pps_.count = 0;  // those that wait are of a run that is over
  // Device time in simulation time, which the simulator may run at any rate.
  rate_ = last_ && time > *last_ ? seconds(stamp - stamp_) / seconds(time - *last_) : 1.0;
  tell(device, &Device::pps, pps_, time, stamp);
  tell(device, &Device::trigger, trigger_, time, stamp);
  last_ = time_ = time;
  stamp_ = stamp;
}

void Sync::tell(Device& device, void (Device::*edge)(DeviceTime) noexcept, Input& input, TruthTime time,
                DeviceTime stamp) noexcept {
  if (input.port == nullptr) return;
  const auto told = [&](TruthTime at) {
    (device.*edge)(stamp - nanoseconds(rate_ * seconds(time - std::max(at, last_.value_or(time)))));
  };
  for (int i = 0; i < most; ++i) {
    const auto received = input.port->receive();
    if (!received) break;
    const std::span<const std::byte> bytes = received->frame.bytes;
    TruthTime at = time;
    if (bytes.size() == sizeof at.ns)
      at.ns = boost::endian::load_little_s64(reinterpret_cast<const unsigned char*>(bytes.data()));
    if (at <= time + furthest && input.count < input.edges.size())
      input.edges[input.count++] = at;
    else
      ++refused_;
  }
  // Those of a run whose time was later are not waited for.
  const auto begin = input.edges.begin();
  auto end = std::remove_if(begin, begin + static_cast<std::ptrdiff_t>(input.count),
                            [&](TruthTime at) { return at > time + furthest; });
  refused_ += input.count - static_cast<std::size_t>(end - begin);
  const auto later = std::find_if(begin, end, [&](TruthTime at) { return at > time; });
  std::for_each(begin, later, told);
  end = std::move(later, end, begin);
  input.count = static_cast<std::size_t>(end - begin);
}

void Sync::send(const Device& device) noexcept {
  const auto pulse = device.pulse();
  if (tov_ == nullptr || !pulse) return;
  std::array<unsigned char, 16> bytes;
  boost::endian::store_little_s64(bytes.data(), (time_ + (pulse->begin - stamp_)).ns);
  boost::endian::store_little_s64(bytes.data() + 8, (time_ + (pulse->end - stamp_)).ns);
  const Frame frame{std::as_bytes(std::span(bytes))};
  tov_->send({&frame, 1});
}

}  // namespace imud
