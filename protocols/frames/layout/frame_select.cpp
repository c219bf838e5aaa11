// The optional elements of a frame, which settings switch.
#include <algorithm>
#include <array>

#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {

// Makes the layout from the whole layout: leaves out the elements that are not sent, and moves the elements behind
// them. Nothing is allocated, because no part is larger than in the whole layout.
void FrameLayout::select(std::span<const FrameValue> values) noexcept {
  if (conditions_.empty()) return;
  std::uint64_t absent = 0;  // bits of the conditions that do not hold
  for (std::size_t i = 0; i < conditions_.size(); ++i)
    if (!conditions_[i].allows(values[conditions_[i].setting])) absent |= std::uint64_t{1} << i;
  const auto place = [&](std::size_t offset) {
    std::size_t before = 0;
    for (const Whole::Part& part : whole_.parts)
      if (part.offset < offset && (part.needs & absent) != 0) before += part.size;
    return offset - before;
  };
  template_.clear();
  constant_.clear();
  std::size_t from = 0;
  const auto copy = [&](std::size_t to) {
    const auto add = [&](const std::vector<std::byte>& all, std::vector<std::byte>& out) {
      out.insert(out.end(), all.begin() + static_cast<std::ptrdiff_t>(from),
                 all.begin() + static_cast<std::ptrdiff_t>(to));
    };
    add(whole_.bytes, template_);
    add(whole_.constant, constant_);
  };
  for (const Whole::Part& part : whole_.parts) {
    if ((part.needs & absent) == 0) continue;
    copy(part.offset);
    from = part.offset + part.size;
  }
  copy(whole_.bytes.size());
  fields_.clear();
  for (const Field& field : whole_.fields) {
    if ((field.needs & absent) != 0) continue;
    fields_.push_back(field);
    fields_.back().offset = place(field.offset);
  }
  for (std::size_t i = 0; i < checks_.size(); ++i) {
    checks_[i].offset = place(whole_.checks[i].offset);
    for (std::size_t k = 0; k < checks_[i].ranges.size(); ++k) {
      const auto [begin, end] = whole_.checks[i].ranges[k];
      checks_[i].ranges[k] = {place(begin), place(end)};
    }
  }
  for (const Whole::Length& one : whole_.lengths) {
    const std::size_t bytes = place(one.range.second) - place(one.range.first);
    store_number(static_cast<std::uint64_t>(one.of(bytes)), one.number, template_.data() + place(one.offset));
  }
  find_read_back();
}

// --- Frames of which some bytes are not known ---
constexpr std::size_t most_ranges = 16;  // of a check of such a frame

bool FrameLayout::have_places(const Around& place) const noexcept {
  const auto has_range = [&](const FrameCheck::Range& range) { return place(range.first) && place(range.second); };
  return std::ranges::all_of(whole_.lengths,
                             [&](const Whole::Length& one) { return place(one.offset) && has_range(one.range); }) &&
         std::ranges::all_of(conditions_.empty() ? checks_ : whole_.checks, [&](const Check& one) {
           return place(one.offset) && one.ranges.size() <= most_ranges && std::ranges::all_of(one.ranges, has_range);
         });
}

// Returns true if the lengths in the frame are right. Requires that all places are known.
bool FrameLayout::has_lengths(std::span<const std::byte> frame, const Around& place) const noexcept {
  return std::ranges::all_of(whole_.lengths, [&](const Whole::Length& one) {
    const std::size_t bytes = *place(one.range.second) - *place(one.range.first);
    return load_number(one.number, frame.data() + *place(one.offset)) == static_cast<std::uint64_t>(one.of(bytes));
  });
}

std::uint64_t FrameLayout::check_at(const Check& one, std::span<const std::byte> frame,
                                    const Around& place) const noexcept {
  std::array<FrameCheck::Range, most_ranges> ranges;
  for (std::size_t k = 0; k < one.ranges.size(); ++k)
    ranges[k] = {*place(one.ranges[k].first), *place(one.ranges[k].second)};
  return one.check.of(frame, std::span(ranges).first(one.ranges.size()), one.extra, one.is_big);
}

void FrameLayout::seal_at(std::span<const Check> checks, std::span<std::byte> frame,
                          const Around& place) const noexcept {
  for (const Check& one : checks)
    store_number(check_at(one, frame, place), {FrameNumber::Format::unsigned_integer, one.check.size(), one.is_big},
                 frame.data() + *place(one.offset));
}

void FrameLayout::seal(std::span<std::byte> frame) const noexcept {
  if (!variable_) return write_checks(frame);
  seal_at(checks_, frame, {*variable_, *variable_ + 1, size(), frame.size()});
}

bool FrameLayout::reseal_any(std::span<std::byte> frame) const noexcept {
  const Around place{whole_.parts.front().offset, whole_.parts.back().offset + whole_.parts.back().size,
                     whole_.bytes.size(), frame.size()};
  if (checks_.empty() || frame.size() < place.first + (place.whole - place.last) || frame.size() > place.whole ||
      !have_places(place))
    return false;
  const auto has_constants = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool is_length = std::ranges::any_of(whole_.lengths, [i](const Whole::Length& one) {
        return i >= one.offset && i < one.offset + one.number.bytes;
      });
      if (!is_length && ((frame[*place(i)] ^ whole_.bytes[i]) & whole_.constant[i]) != std::byte{0}) return false;
    }
    return true;
  };
  if (!has_constants(0, place.first) || !has_constants(place.last, place.whole) || !has_lengths(frame, place))
    return false;
  seal_at(whole_.checks, frame, place);
  return true;
}

// Requires a layout for which the compiler has checked that a length of the variable bytes precedes these, and that
// all places are known.
FrameLayout::Found FrameLayout::match_variable(std::span<const std::byte> held) const noexcept {
  const std::size_t first = *variable_;
  if (!has_constants(held.first(std::min(first, held.size())))) return {Match::no, 0};
  if (held.size() < first) return {Match::unfinished, 0};
  const Whole::Length& length = *std::ranges::find_if(whole_.lengths, [first](const Whole::Length& one) {
    return one.offset < first && one.range.first <= first && one.range.second > first;
  });
  const std::uint64_t sent = load_number(length.number, held.data() + length.offset);
  constexpr std::uint64_t most = 4 * FrameDescription::longest_frame;
  if (sent > most) return {Match::no, 0};
  const std::int64_t content = static_cast<std::int64_t>(sent) - length.plus -
                               static_cast<std::int64_t>(length.range.second - length.range.first) + 1;
  if (content < 0 || content > static_cast<std::int64_t>(FrameDescription::longest_frame)) return {Match::no, 0};
  const Around place{first, first + 1, size(), size() - 1 + static_cast<std::size_t>(content)};
  for (std::size_t i = place.last; i < place.whole && *place(i) < held.size(); ++i)
    if (((held[*place(i)] ^ template_[i]) & constant_[i]) != std::byte{0}) return {Match::no, 0};
  if (held.size() < place.frame) return {Match::unfinished, 0};
  const std::span<const std::byte> frame = held.first(place.frame);
  if (!has_lengths(frame, place)) return {Match::no, 0};
  for (const Check& one : checks_) {
    const FrameNumber type{FrameNumber::Format::unsigned_integer, one.check.size(), one.is_big};
    if (((load_number(type, frame.data() + *place(one.offset)) ^ check_at(one, frame, place)) &
         low_bits(static_cast<unsigned>(8 * type.bytes))) != 0)
      return {Match::wrong_check, 0};
  }
  return {Match::yes, place.frame};
}

std::vector<std::byte> FrameLayout::with_content(std::span<const std::byte> content) const {
  std::vector<std::byte> frame = template_;
  if (!variable_) return frame;
  const auto at = frame.erase(frame.begin() + static_cast<std::ptrdiff_t>(*variable_));
  frame.insert(at, content.begin(), content.end());
  const Around place{*variable_, *variable_ + 1, size(), frame.size()};
  for (const Whole::Length& one : whole_.lengths) {
    const std::size_t bytes = *place(one.range.second) - *place(one.range.first);
    store_number(static_cast<std::uint64_t>(one.of(bytes)), one.number, frame.data() + *place(one.offset));
  }
  return frame;
}

void FrameLayout::find_read_back() noexcept {
  ReadBack read;
  clock_ = counter_ = alive_counter_ = frame_counter_ = std::nullopt;
  has_time_ = false;
  const auto longest = [this](std::optional<std::size_t>& best, std::size_t i) {
    const auto round = [this](std::size_t one) {
      const Field& field = fields_[one];
      const double values = field.period == 0 ? 0x1p64 : static_cast<double>(field.period);
      return values * static_cast<double>(std::max<std::int64_t>(field.time_lsb_ns, 1));
    };
    if (!best || round(i) > round(*best)) best = i;
  };
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const Field& field = fields_[i];
    if (field.source == Source::alive_counter) longest(alive_counter_, i);
    if (field.source == Source::frame_counter) longest(frame_counter_, i);
    if (field.quantity == nullptr || field.source == Source::flag) continue;
    if (field.quantity->kind == MeasuredQuantity::Kind::counter) longest(counter_, i);
    if (field.time_lsb_ns != 0 && field.quantity->is_clock()) longest(clock_, i);
    has_time_ |= field.quantity->is_clock();
    if (field.quantity->set != nullptr && field.modulus == 0) field.quantity->set(0, read);
  }
  components_ = read.components;
}

}  // namespace imud
