#include "emulator/imu/channel.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace imud {

Channel::Channel(const ImuConfig& config, std::size_t number, std::uint64_t seed, const Ports& ports, StepSink& sink,
                 std::unique_ptr<ChannelFaults> faults)
    : name_(config.name),
      number_(static_cast<std::uint16_t>(number)),
      grid_(config.grid),
      rests_before_truth_(config.before_first == BeforeFirst::rest),
      is_can_(config.protocol->link == Link::can),
      imu_(config.model, seed, stream_id(config.name)),
      device_filters_(config.device_filters),
      filters_{config.model.gyro.filter, config.model.accelerometer.filter, config.model.magnetometer.filter},
      device_(config.protocol->make(config.settings)),
      sink_(sink),
      faults_(std::move(faults)),
      clock_(config.grid),
      counters_(config.protocol->counters),
      awaited_(config.model) {
  device_->set_figures(figures_of(config.model));
  if (device_filters_) imu_.reserve_filters(Device::longest_boxcar);
  lines_[0] = {ports({PortUse::Of::line, number, 0, config.port, config.port_settings}), device_->uart()};
  if (!config.second_port.empty()) {
    device_->connect_second_uart();
    lines_[1] = {ports({PortUse::Of::line, number, 1, config.second_port, config.second_port_settings}),
                 device_->second_uart()};
    line_count_ = 2;
  }
  for (DeviceLine& line : lines()) {
    line.is_file = !line.port->can_receive() && line.port->descriptor() < 0;
    are_files_ = are_files_ && line.is_file;
  }
  copies_ = Copies(config, ports, number);
  add_interfaces();
  if (config.sync.is_connected()) sync_.emplace(config.sync, ports, number, name_, sink_);
  if (is_can_) {
    add_filters(*config.protocol, config.settings, config.rate_hz, can_filters_);
    lines_[0].port->set_filters(can_filters_);
  }
  if (faults_) enable_faults(config, seed);
  publish();
}

void Channel::add_interfaces() {
  const std::uint16_t link = is_can_ ? link_type::can_socketcan : link_type::bytes;
  for (DeviceLine& line : lines()) {
    const std::string name = &line == &lines_[0] ? name_ : name_ + " second";
    line.interface = sink_.add_interface(name, link);
    sink_.add_interface(name + " host", link);
    sink_.add_interface(name + " dropped", link);
  }
}

void Channel::power_on(HostTime origin) noexcept {
  clock_.power_on(origin);
  device_->power_on(clock_.now());
  apply_filters();
}

void Channel::set_clock(DeviceTime zero, std::optional<HostTime> origin) noexcept {
  device_->step_clock(clock_.set(zero, origin));
}

void Channel::start_samples() noexcept { clock_.start_samples(); }

void Channel::begin_run(TruthTime begin) noexcept {
  pass_over();
  has_leapt_ = false;
  run_begin_ = begin;
  if (faults_) faults_->begin_run();
}

void Channel::pass_over() noexcept {
  if (!is_resting_) imu_.begin_run();  // otherwise the first sample of the truth begins the run
  has_sampled_ = false;
  awaited_.clear();
  has_leapt_ = true;
  if (sync_) sync_->begin_run();
  if (faults_) faults_->pass_over();
}

Sample& Channel::sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept {
  has_sampled_ = true;
  is_resting_ = false;
  sample_ = imu_.sample(timeline, time, clock_.stamp(k));
  ahead_ = imu_.advanced_to() - timeline.newest();
  if (std::exchange(has_leapt_, false)) sample_.status |= status::truth_extrapolated;
  if (faults_) {
    faults_->take(sample_, time - run_begin_, utc_ns_of(sample_.time));
    set_faults(faults_->active(FaultSeam::wire), faults_->active(FaultSeam::power));
  }
  return sample_;
}

Sample& Channel::sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept {
  is_resting_ = true;
  ahead_ = Nanoseconds{0};
  sample_ = imu_.sample_at_rest(since_power_on, clock_.stamp(k));
  if (faults_ && faults_->acts_at_rest()) {
    faults_->take_at_rest(sample_, since_power_on, utc_ns_of(sample_.time));
    set_faults(faults_->active(FaultSeam::wire), faults_->active(FaultSeam::power));
  }
  return sample_;
}

void Channel::prepare(std::optional<TruthTime> truth, bool silent) noexcept {
  truth_ = truth;
  silent_ = silent;
}

void Channel::skip() noexcept {
  encode(true);
  counters_.skipped.count();
}

void Channel::encode(bool too_late) noexcept {
  const DeviceTime time = sample_.time;
  is_discarded_ = silent_ || too_late;
  if (faults_) faults_->expectations().port_is(lines_[0].port->state());
  if (faults_) set_clock_offset(faults_->messages().clock_offset());
  poll_until(time, too_late);
  if (apply_power_faults()) poll_until(time, too_late);
  clock_.take_sample(time);
  frames_.clear();
  others_.clear();
  if (sync_ && truth_ && is_on())
    sync_->deliver_edges(*device_, *truth_, time);
  else if (sync_)
    sync_->discard_edges();
  if (is_on()) {
    if (other_units_ != nullptr) other_units_->select(faults_->messages().other_unit());
    const std::uint64_t counter = sample_.counter;
    const std::uint32_t status = sample_.status;
    sample_.time = time + clock_offset_;
    if (faults_) faults_->messages().forge(sample_);
    device_->sample(sample_, is_discarded_ ? others_ : frames_);
    sample_.time = time;
    sample_.counter = counter;
    sample_.status = status;
  }
  if (faults_) faults_->messages().shape(frames_, time);
}

void Channel::transmit() noexcept {
  if (sync_ && truth_ && is_on()) sync_->send_pulse(*device_);
  send(frames_.frames(), sample_.time);
}

void Channel::send(std::span<const Frame> frames, DeviceTime time, bool is_reply) noexcept {
  if (paused_) {
    counters_.paused.count(frames.size());
    return;
  }
  while (!frames.empty()) {
    DeviceLine& line = lines_[frames.front().uart];
    std::size_t size = 1;
    while (size < frames.size() && frames[size].uart == frames.front().uart) ++size;
    line.port->set_time(time);
    const std::uint64_t dropped = line.port->counters().dropped;
    if (is_reply)
      line.port->reply(frames.first(size));
    else
      line.port->send(frames.first(size));
    line.passed += size;
    // If a port drops frames, it drops the last ones.
    if (line.wire == nullptr)
      sink_.frames(line.interface, frames.first(size), line.port->counters().dropped - dropped);
    if (&line == &lines_[0] && line.wire == nullptr) copies_.send(frames.first(size), time, is_reply);
    frames = frames.subspan(size);
  }
}

void Channel::record_times(Nanoseconds lateness, Nanoseconds write) noexcept {
  counters_.lateness.add(seconds(lateness));
  counters_.write.add(seconds(write));
  if (lateness >= grid_.period()) counters_.missed.count();
}

void Channel::count_sample() noexcept {
  counters_.samples.count();
  if ((sample_.status & status::truth_extrapolated) != 0) counters_.extrapolated.count();
  if ((sample_.status & status::truth_stale) != 0) counters_.held.count();
  if ((sample_.status & status::at_rest) != 0) counters_.at_rest.count();
  if (silent_) counters_.silent.count();
  const bool is_extrapolated =
      (sample_.status & (status::truth_extrapolated | status::truth_stale)) == status::truth_extrapolated;
  const bool is_shown = feed_ != nullptr && feed_->wants(number_, sample_.counter);
  if (is_extrapolated || is_shown)
    awaited_.add(imu_, ahead_, is_extrapolated, is_shown ? std::optional(feed_sample()) : std::nullopt);
  publish();
}

void Channel::poll_until(DeviceTime now, bool too_late) noexcept {
  if (faults_) release_until(now, too_late);
  if (!is_on()) return;
  for (auto deadline = device_->deadline(); deadline && *deadline <= now + clock_offset_;
       deadline = device_->deadline()) {
    others_.clear();
    device_->poll(*deadline, others_);
    apply_filters();
    if (!too_late) send(others_.frames(), *deadline - clock_offset_);
    publish();
  }
}

// Sends the frames that a fault has withheld until now.
void Channel::release_until(DeviceTime now, bool too_late) noexcept {
  while (const auto due = faults_->messages().next_release()) {
    const std::optional<Frame> frame = faults_->messages().release(now);
    if (!frame) return;
    if (!too_late) send(std::span(&*frame, 1), *due);
  }
}

void Channel::set_clock_offset(Nanoseconds offset) noexcept {
  if (offset == clock_offset_) return;
  device_->step_clock(offset - clock_offset_);
  clock_offset_ = offset;
}

void Channel::publish_states(bool has_received) noexcept {
  if (has_received || lines_[0].port->state() != counters_.port_state.load(std::memory_order_relaxed) ||
      (line_count_ == 2 && lines_[1].port->state() != counters_.second_port_state.load(std::memory_order_relaxed)))
    publish();
}

void Channel::receive(Frame frame, std::size_t uart, HostTime now) noexcept {
  const DeviceTime time = clock_.now(now);
  poll_until(time);
  others_.clear();
  if (faults_) faults_->host_sent(frame.bytes);
  if (!is_on()) return;
  frame.uart = static_cast<std::uint8_t>(uart);
  device_->receive(frame, time + clock_offset_, others_);
  apply_filters();
  send(others_.frames(), time, true);
  apply_uarts();
  if (!others_.frames().empty()) ++reply_count_;
}

// A device answers with its old settings; the new ones apply to all that is sent afterwards.
void Channel::apply_uarts() noexcept {
  for (std::size_t i = 0; i < line_count_; ++i) {
    const UartSettings uart = i == 0 ? device_->uart() : device_->second_uart();
    if (uart == lines_[i].uart) continue;
    lines_[i].uart = uart;
    lines_[i].port->set_line(uart);
    if (i == 0) copies_.set_line(uart);
  }
}

void Channel::apply_filters() noexcept {
  if (!device_filters_) return;
  const std::optional<SensorFilters> filters = device_->filters();
  if (!filters || *filters == filters_) return;
  filters_ = *filters;
  imu_.set_filters(filters_);
}

void Channel::publish() noexcept {
  const Port& port = *lines_[0].port;
  const auto count = [](const std::atomic<std::uint64_t>& counter) {
    return counter.load(std::memory_order_relaxed);
  };
  std::uint64_t sent = count(replaced_.sent), replies = count(replaced_.replies), dropped = count(replaced_.dropped),
                failed = count(replaced_.failed), connections_refused = 0;
  for (const DeviceLine& line : lines()) {
    const PortCounters &now = line.port->counters(), &before = line.before;
    sent += now.sent + before.sent;
    replies += now.replies + before.replies;
    dropped += now.dropped + before.dropped;
    failed += now.failed + before.failed;
    connections_refused += now.connections_refused + before.connections_refused;
  }
  counters_.speeds.store(port.speeds(), std::memory_order_relaxed);
  counters_.port_error.store(port.error(), std::memory_order_relaxed);
  if (line_count_ == 2) {
    const Port& second = *lines_[1].port;
    counters_.second_speeds.store(second.speeds(), std::memory_order_relaxed);
    counters_.second_port_error.store(second.error(), std::memory_order_relaxed);
    counters_.second_port_state.store(second.state(), std::memory_order_release);
  }
  counters_.device.store(device_->counts(),
                         other_device_ ? other_device_->counts() : std::span<const std::uint64_t>());
  publish_bus();
  counters_.frames.store(sent - replies, std::memory_order_relaxed);
  counters_.replies.store(replies, std::memory_order_relaxed);
  if (faults_) dropped += faults_->messages().lost();
  counters_.copies_dropped.store(copies_.dropped(), std::memory_order_relaxed);
  failed += copies_.failed();
  counters_.dropped.store(dropped, std::memory_order_relaxed);
  counters_.failed.store(failed, std::memory_order_relaxed);
  counters_.connections_refused.store(connections_refused, std::memory_order_relaxed);
  if (sync_) counters_.edges_refused.store(sync_->refused(), std::memory_order_relaxed);
  counters_.port_state.store(port.state(), std::memory_order_release);
}

void Channel::publish_bus() noexcept {
  if (!is_can_) return;
  const PortCounters &port = lines_[0].port->counters(), &before = lines_[0].before;
  counters_.bus_errors.store(port.bus_errors + before.bus_errors, std::memory_order_relaxed);
  counters_.error_warnings.store(port.error_warnings + before.error_warnings, std::memory_order_relaxed);
  counters_.error_passives.store(port.error_passives + before.error_passives, std::memory_order_relaxed);
  counters_.bus_offs.store(port.bus_offs + before.bus_offs, std::memory_order_relaxed);
  counters_.bus_restarts.store(port.bus_restarts + before.bus_restarts, std::memory_order_relaxed);
  counters_.refused.store(port.refused + before.refused, std::memory_order_relaxed);
}

bool Channel::holds_back() const noexcept {
  return copies_.holds_back() ||
         std::any_of(lines().begin(), lines().end(), [](const DeviceLine& line) { return line.holds_back(); });
}

void Channel::wait_for_lines(const std::atomic<bool>& stop) noexcept {
  for (DeviceLine& line : lines())
    if (!line.is_file && !line.port->has_room()) line.wait(true, stop);
}

void Channel::wait_until_sent(const std::atomic<bool>& stop) noexcept {
  for (DeviceLine& line : lines()) line.wait(false, stop);
  copies_.wait_until_sent(stop);
  publish();
}

void Channel::flush() noexcept {
  bool holds_back = copies_.holds_back();
  copies_.flush();
  for (DeviceLine& line : lines()) {
    if (!line.holds_back()) continue;
    holds_back = true;
    line.port->flush();
  }
  if (holds_back) publish();
}

void Channel::update_port_states() noexcept {
  for (DeviceLine& line : lines()) line.port->flush();
  publish();
}

std::optional<HostTime> Channel::next_wake() const noexcept {
  std::optional<HostTime> first = copies_.next_flush();
  for (const DeviceLine& line : lines())
    if (const auto at = line.port->next_flush(); at && (!first || *at < *first)) first = at;
  const auto wake_at = [&](DeviceTime time) {
    if (const auto at = clock_.host_time(time); at && (!first || *at < *first)) first = at;
  };
  if (const auto deadline = is_on() ? device_->deadline() : std::nullopt) wake_at(*deadline - clock_offset_);
  if (faults_)
    if (const auto due = faults_->messages().next_release()) wake_at(*due);
  return first;
}

void Channel::discard_pending() noexcept {
  for (DeviceLine& line : lines()) line.port->discard_pending();
  copies_.discard_pending();
  publish();
}

void Channel::commit() {
  std::exception_ptr failure;
  for (const std::span<DeviceLine> all : {lines(), copies_.lines()})
    for (DeviceLine& line : all) try {
        line.port->commit();
      } catch (const std::exception&) {
        if (!failure) failure = std::current_exception();
      }
  if (failure) std::rethrow_exception(failure);
}

std::optional<TruthTime> Channel::used_until() const noexcept {
  return has_sampled_ ? std::optional(imu_.advanced_to()) : std::nullopt;
}

}  // namespace imud
