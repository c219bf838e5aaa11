#include "protocols/frames/host/frame_host.hpp"

#include <algorithm>
#include <utility>

namespace imud {
namespace {

constexpr Nanoseconds timeout = std::chrono::seconds(1);

bool is_end(std::byte byte) noexcept { return byte == std::byte{'\r'} || byte == std::byte{'\n'}; }
bool is_printable(std::byte byte) noexcept {
  return (byte >= std::byte{' '} && byte <= std::byte{'~'}) || byte == std::byte{'\t'};
}

}  // namespace

FrameHost::FrameHost(std::shared_ptr<const FrameRequests> requests)
    : requests_(std::move(requests)), stored_(requests_->delivered()), values_(stored_) {
  if (std::ranges::any_of(requests_->all(), [](const FrameRequest& one) { return one.delay.count() != 0; }))
    delayed_bytes_.resize(most_delayed * requests_->longest_answer());
  power_on();
}

void FrameHost::store(FrameChosen chosen) noexcept {
  stored_[chosen.setting] = chosen.value;
  power_on();
}

void FrameHost::power_on() noexcept {
  start();
  static_cast<void>(search_.finish());
  old_ = 0;
}

void FrameHost::start() noexcept {
  std::ranges::copy(stored_, values_.begin());
  if (const auto baud = requests_->baud_setting()) line_value_ = values_[*baud];
  is_streaming_ = true;
  delayed_count_ = 0;
}

std::optional<unsigned> FrameHost::baud() const noexcept {
  const auto setting = requests_->baud_setting();
  if (!setting) return std::nullopt;
  return static_cast<unsigned>(requests_->settings().number({*setting, line_value_}));
}

void FrameHost::step_clock(Nanoseconds by) noexcept {
  last_ = last_ + by;
  begun_ = begun_ + by;
  for (Delayed& one : delayed_) one.due = one.due + by;
}

void FrameHost::receive(std::span<const std::byte> bytes, DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept {
  expire(now, unit, replies);
  if (bytes.empty()) return;
  last_ = now;
  const std::size_t before = search_.size() + bytes.size();
  unknown_bytes_ +=
      search_.feed(bytes, [&](std::span<const std::byte> held) { return parse(held, now, unit, replies); });
  if (const std::size_t gone = before - search_.size(); gone < old_) {
    old_ -= gone;
  } else {
    begun_ = now;
    old_ = search_.size();
  }
}

// Returns the time at which held bytes are to be discarded. Requires held bytes.
DeviceTime FrameHost::expiry() const noexcept { return (holds_line_ ? last_ : begun_) + timeout; }

void FrameHost::expire(DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept {
  while (!search_.is_empty() && now >= expiry()) {
    if (holds_line_) {
      unknown_bytes_ += search_.finish();
    } else {
      const std::size_t newer = search_.size() - old_;
      do
        unknown_bytes_ +=
            search_.resync([&](std::span<const std::byte> held) { return parse(held, now, unit, replies); });
      while (search_.size() > newer && !holds_line_);
      begun_ = last_;
    }
    old_ = search_.size();
  }
}

std::size_t FrameHost::parse(std::span<const std::byte> held, DeviceTime now, Unit& unit,
                             FrameBuffer& replies) noexcept {
  const std::span<const FrameRequest> all = requests_->all();
  bool is_unfinished = false;
  FrameCaptures captures;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all[i].bytes || !all_hold(all[i].when, values_)) continue;
    const FrameLayout::Match match = all[i].bytes->match(held, requests_->settings(), captures);
    is_unfinished |= match == FrameLayout::Match::unfinished;
    if (match != FrameLayout::Match::yes || !all[i].accepts(captures)) continue;
    execute(i, captures, now, unit, replies);
    return captures.bytes.size();
  }
  if (const std::size_t size = parse_unknown(held, is_unfinished, unit, replies); size > 0) return size;
  holds_line_ = false;
  if (requests_->has_lines()) {
    const std::span<const std::byte> line = held.first(std::min(held.size(), FrameHostDescription::longest_line));
    const auto end = std::ranges::find_if_not(line, is_printable);
    if (end != line.end() && is_end(*end))
      return parse_line(held, static_cast<std::size_t>(end - line.begin()), is_unfinished, now, unit, replies);
    if (end == line.end() && line.size() < FrameHostDescription::longest_line)
      holds_line_ = !std::exchange(is_unfinished, true);
  }
  return is_unfinished && held.size() < FrameHostDescription::longest_request ? Search::need_more : Search::reject;
}

// Answers bytes that have the form of a FrameUnknown, but are no request. Returns 0 if the bytes have no such form.
std::size_t FrameHost::parse_unknown(std::span<const std::byte> held, bool& is_unfinished, const Unit& unit,
                                     FrameBuffer& replies) noexcept {
  FrameCaptures captures;
  for (const FrameUnknown& one : requests_->unknown()) {
    if (is_unfinished) break;
    if (!one.form) continue;
    const FrameLayout::Match match = one.form->match(held, requests_->settings(), captures);
    is_unfinished = match == FrameLayout::Match::unfinished;
    if (match != FrameLayout::Match::yes) continue;
    unknown_bytes_ += captures.bytes.size();
    answer(one.answer, captures, unit, replies);
    return captures.bytes.size();
  }
  return 0;
}

// Processes a line of `size` bytes, without its end.
std::size_t FrameHost::parse_line(std::span<const std::byte> held, std::size_t size, bool is_unfinished,
                                  DeviceTime now, Unit& unit, FrameBuffer& replies) noexcept {
  if (size == 0) return 1;
  const std::span<const FrameRequest> all = requests_->all();
  FrameCaptures captures;
  captures.line = {reinterpret_cast<const char*>(held.data()), size};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all[i].text || !all_hold(all[i].when, values_) ||
        !all[i].text->match(captures.line, requests_->settings(), captures))
      continue;
    if (!all[i].accepts(captures)) continue;
    execute(i, captures, now, unit, replies);
    return size + 1;
  }
  if (is_unfinished && held.size() < FrameHostDescription::longest_request) return Search::need_more;
  unknown_bytes_ += size;
  for (const FrameUnknown& one : requests_->unknown())
    if (!one.form) answer(one.answer, captures, unit, replies);
  return size + 1;
}

void FrameHost::set(FrameChosen chosen) noexcept {
  values_[chosen.setting] = chosen.value;
  if (requests_->settings()[chosen.setting].is_kept) stored_[chosen.setting] = chosen.value;
}

void FrameHost::change_settings(const FrameRequest& request, const FrameCaptures& captures) noexcept {
  for (const FrameChosen chosen : request.set) set(chosen);
  if (request.sets_captured)
    for (std::size_t i = 0; i < captures.count; ++i) set(captures.chosen[i]);
  if (request.restores)
    for (std::size_t i = 0; i < values_.size(); ++i) set({i, requests_->delivered()[i]});
  if (request.saves) std::ranges::copy(values_, stored_.begin());
  if (request.streams) is_streaming_ = *request.streams;
}

void FrameHost::execute(std::size_t index, const FrameCaptures& captures, DeviceTime now, Unit& unit,
                        FrameBuffer& replies) noexcept {
  const FrameRequest& request = requests_->all()[index];
  newest_request_ = index;
  if (captures.is_allowed) {
    change_settings(request, captures);
    unit.switch_messages();
  }
  const FrameAnswer& given = captures.is_allowed ? request.answer : request.otherwise;
  if (request.delay.count() != 0) return delay(index, given, captures, now, unit);
  answer(given, captures, unit, replies);
  if (captures.is_allowed) finish(index, now, unit, replies);
}

void FrameHost::answer(const FrameAnswer& answer, const FrameCaptures& captures, const Unit& unit,
                       FrameBuffer& out) noexcept {
  if (!answer.is_given()) return;
  const std::span<std::byte> room = out.room(answer.longest());
  if (room.size() < answer.longest()) {
    ++lost_answers_;
    return;
  }
  out.push(answer.write(captures, {requests_->settings(), values_, unit.newest()}, room));
}

std::span<std::byte> FrameHost::delayed_bytes(std::size_t slot) noexcept {
  const std::size_t size = requests_->longest_answer();
  return std::span(delayed_bytes_).subspan(slot * size, size);
}

void FrameHost::delay(std::size_t index, const FrameAnswer& answer, const FrameCaptures& captures, DeviceTime now,
                      const Unit& unit) noexcept {
  if (delayed_count_ == most_delayed) {
    ++lost_answers_;
    return;
  }
  const std::size_t slot = (first_delayed_ + delayed_count_++) % most_delayed;
  Delayed& one = delayed_[slot];
  one = {now + requests_->all()[index].delay, index, 0, !captures.is_allowed};
  if (answer.is_given())
    one.size = answer.write(captures, {requests_->settings(), values_, unit.newest()}, delayed_bytes(slot));
}

std::optional<DeviceTime> FrameHost::deadline() const noexcept {
  std::optional<DeviceTime> next;
  if (delayed_count_ > 0) next = delayed_[first_delayed_].due;
  if (!search_.is_empty()) next = std::min(next.value_or(expiry()), expiry());
  return next;
}

void FrameHost::poll(DeviceTime now, Unit& unit, FrameBuffer& out) noexcept {
  while (delayed_count_ > 0 && delayed_[first_delayed_].due <= now) {
    const std::size_t slot = std::exchange(first_delayed_, (first_delayed_ + 1) % most_delayed);
    --delayed_count_;
    const Delayed& one = delayed_[slot];
    if (one.size > 0) {
      const std::span<std::byte> room = out.room(one.size);
      if (room.size() == one.size) {
        std::ranges::copy(delayed_bytes(slot).first(one.size), room.begin());
        out.push(one.size);
      } else {
        ++lost_answers_;
      }
    }
    if (one.is_refusal)
      set_line();
    else
      finish(one.request, now, unit, out);
  }
  expire(now, unit, out);
}

// Changes the bit rate, unless an answer is still to be sent.
void FrameHost::set_line() noexcept {
  if (const auto baud = requests_->baud_setting(); baud && delayed_count_ == 0) line_value_ = values_[*baud];
}

// Executes the effects of a request after its answer.
void FrameHost::finish(std::size_t index, DeviceTime now, Unit& unit, FrameBuffer& out) noexcept {
  const FrameRequest& request = requests_->all()[index];
  if (request.poll) unit.poll_message(*request.poll, out);
  set_line();
  if (!request.resets) return;
  start();
  unit.restart(now);
}

}  // namespace imud
