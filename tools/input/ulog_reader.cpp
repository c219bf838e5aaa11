#include "tools/input/ulog_reader.hpp"

#include <algorithm>
#include <charconv>
#include <stdexcept>

namespace imud {
namespace {

constexpr std::size_t ulog_header_size = 16;

template <typename T>
T little_at(const char* bytes) {
  return boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(
      reinterpret_cast<const unsigned char*>(bytes));
}

std::size_t size_of_ulog_type(std::string_view type) {
  if (type == "char" || type == "bool") return 1;
  if (type == "float") return 4;
  if (type == "double") return 8;
  for (const auto& [name, size] : {std::pair{"int8_t", 1}, {"int16_t", 2}, {"int32_t", 4}, {"int64_t", 8}})
    if (type == name || (type.starts_with('u') && type.substr(1) == name)) return static_cast<std::size_t>(size);
  return 0;
}

}  // namespace

const UlogFormat::Field* UlogFormat::find(std::string_view name) const {
  const auto found = std::ranges::find(fields, name, &Field::name);
  return found == fields.end() ? nullptr : &*found;
}

double UlogMessage::real(const UlogFormat::Field& field, std::size_t i) const {
  const char* from = body.data() + field.offset + i * field.size;
  return field.size == sizeof(float) ? double{little_at<float>(from)} : little_at<double>(from);
}

std::optional<std::int64_t> UlogMessage::time_ns() const {
  std::uint64_t time_us = number<std::uint64_t>("timestamp_sample").value_or(0);
  if (time_us == 0) time_us = number<std::uint64_t>("timestamp").value_or(0);
  if (time_us > std::uint64_t{std::numeric_limits<std::int64_t>::max()} / 1000) return std::nullopt;
  return static_cast<std::int64_t>(time_us) * 1000;
}

void UlogReader::refuse(const std::string& fault) { throw std::runtime_error("ulog: " + fault); }

void UlogReader::read(std::span<const std::byte> bytes) {
  held_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::size_t at = 0;
  if (position_ == 0) {
    if (held_.size() < ulog_header_size) return;
    if (!held_.starts_with("ULog\x01\x12\x35")) refuse("this is no ULog; right would be a file .ulg of PX4");
    at = ulog_header_size;
  }
  while (held_.size() - at >= 3 && position_ + at < appended_) {
    const std::size_t size = little_at<std::uint16_t>(held_.data() + at);
    if (held_.size() - at < 3 + size) break;
    read_message(held_[at + 2], std::string_view(held_).substr(at + 3, size));
    at += 3 + size;
  }
  if (position_ + at >= appended_) at = held_.size();  // what PX4 appends after a crash has no samples
  position_ += at;
  held_.erase(0, at);
}

std::size_t UlogReader::end() const {
  if (position_ == 0) refuse("the file ends within its header");
  return held_.size();
}

void UlogReader::read_message(char type, std::string_view body) {
  if (type == 'B' && body.size() >= 40) {
    constexpr std::uint64_t known = 1;  // data are appended
    if ((little_at<std::uint64_t>(body.data() + 8) & ~known) != 0)
      refuse("it has an incompatible flag that is unknown");
    if (const auto offset = little_at<std::uint64_t>(body.data() + 16); offset > 0) appended_ = offset;
  } else if (type == 'F') {
    define(body);
  } else if (type == 'A' && body.size() > 3) {
    on_subscription(static_cast<std::uint8_t>(body[0]), little_at<std::uint16_t>(body.data() + 1), body.substr(3));
  } else if (type == 'D' && body.size() >= 2) {
    on_data(little_at<std::uint16_t>(body.data()), body.substr(2));
  }
}

// Parses "name:type[3] field;type field;". A type may be the name of another format, which is defined before or
// after this format.
void UlogReader::define(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) return count_malformed();
  const auto [place, is_new] = formats_.try_emplace(std::string(text.substr(0, colon)));
  if (!is_new) return;  // a subscription's fields stay
  UlogFormat& format = place->second;
  for (text.remove_prefix(colon + 1); !text.empty();) {
    const std::string_view one = text.substr(0, text.find(';'));
    text.remove_prefix(std::min(one.size() + 1, text.size()));
    const std::size_t blank = one.find(' '), bracket = one.find('[');
    if (blank == std::string_view::npos) return count_malformed();
    UlogFormat::Field field{std::string(one.substr(0, std::min(blank, bracket))), std::string(one.substr(blank + 1))};
    if (bracket < blank) std::from_chars(one.data() + bracket + 1, one.data() + blank, field.count);
    format.fields.push_back(std::move(field));
  }
}

// Computes where the fields are. Returns the format's size, bytes; 0 if the format or a format nested in it is
// unknown.
std::size_t UlogReader::lay_out(const std::string& name, int depth) {
  const auto found = formats_.find(name);
  if (found == formats_.end() || depth > 8) return 0;
  UlogFormat& format = found->second;
  format.size = 0;
  for (UlogFormat::Field& field : format.fields) {
    field.size = size_of_ulog_type(field.type);
    if (field.size == 0) field.size = lay_out(field.type, depth + 1);
    if (field.size == 0 || field.count > 65536) return 0;
    field.offset = format.size;
    format.size += field.size * field.count;
    if (format.size > std::numeric_limits<std::uint16_t>::max()) return 0;
  }
  return format.size;
}

const UlogFormat* UlogReader::format(std::string_view name) {
  if (lay_out(std::string(name)) > 0) return &formats_[std::string(name)];
  count_malformed();
  return nullptr;
}

// A message may lack the padding at its end.
std::optional<UlogMessage> UlogReader::message(const UlogFormat& format, std::string_view body) {
  if (body.size() < format.size) {
    const UlogFormat::Field& last = format.fields.back();
    if (!last.name.starts_with("_padding") || body.size() < last.offset) {
      count_malformed();
      return std::nullopt;
    }
    body = padded_.assign(body).append(last.size * last.count, '\0');
  }
  return UlogMessage{format, body};
}

}  // namespace imud
