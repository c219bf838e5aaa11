// The optional elements of a frame, which settings switch.
#include <algorithm>
#include <array>

#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {

// Removes the elements that are not sent from the whole layout, and moves what follows them. Nothing is allocated: no
// part becomes larger than it was.
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
    store_number(static_cast<std::uint64_t>(static_cast<std::int64_t>(bytes / one.divisor) + one.plus), one.number,
                 template_.data() + place(one.offset));
  }
  find_read_back();
}

// Which elements there are between the first and the last optional one is not known, but what precedes and follows
// these has its place from the begin and from the end of the frame.
bool FrameLayout::reseal_any(std::span<std::byte> frame) const noexcept {
  const std::size_t size = whole_.bytes.size(), first = whole_.parts.front().offset,
                    last = whole_.parts.back().offset + whole_.parts.back().size;
  if (checks_.empty() || frame.size() < first + (size - last) || frame.size() > size) return false;
  const auto place = [&](std::size_t offset) -> std::optional<std::size_t> {
    if (offset <= first) return offset;
    return offset >= last ? std::optional(offset - size + frame.size()) : std::nullopt;
  };
  const auto has_constants = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool is_length = std::ranges::any_of(whole_.lengths, [i](const Whole::Length& one) {
        return i >= one.offset && i < one.offset + one.number.bytes;
      });
      if (!is_length && ((frame[*place(i)] ^ whole_.bytes[i]) & whole_.constant[i]) != std::byte{0}) return false;
    }
    return true;
  };
  if (!has_constants(0, first) || !has_constants(last, size)) return false;
  for (const Whole::Length& one : whole_.lengths) {
    const auto at = place(one.offset), from = place(one.range.first), to = place(one.range.second);
    if (!at || !from || !to) return false;
    const auto length = static_cast<std::int64_t>((*to - *from) / one.divisor) + one.plus;
    if (load_number(one.number, frame.data() + *at) != static_cast<std::uint64_t>(length)) return false;
  }
  constexpr std::size_t most_ranges = 16;
  std::array<FrameCheck::Range, most_ranges> ranges;
  const auto set_ranges = [&](const Check& one) {
    for (std::size_t k = 0; k < one.ranges.size(); ++k) {
      const auto from = place(one.ranges[k].first), to = place(one.ranges[k].second);
      if (!from || !to || *from > *to) return false;
      ranges[k] = {*from, *to};
    }
    return true;
  };
  for (const Check& one : whole_.checks)
    if (one.ranges.size() > most_ranges || !place(one.offset) || !set_ranges(one)) return false;
  for (const Check& one : whole_.checks) {
    set_ranges(one);
    const std::span<const FrameCheck::Range> all = std::span(ranges).first(one.ranges.size());
    store_number(one.check.of(frame, all, one.extra, one.is_big),
                 {FrameNumber::Format::unsigned_integer, one.check.size(), one.is_big},
                 frame.data() + *place(one.offset));
  }
  return true;
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
    if (field.quantity == nullptr) continue;
    if (field.quantity->kind == MeasuredQuantity::Kind::counter) longest(counter_, i);
    if (field.time_lsb_ns != 0) longest(clock_, i);
    has_time_ |= field.quantity->kind == MeasuredQuantity::Kind::time;
    if (field.quantity->set != nullptr && field.modulus == 0) field.quantity->set(0, read);
  }
  components_ = read.components;
}

}  // namespace imud
