#include "tools/input/mcap_reader.hpp"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <stdexcept>

namespace imud {
namespace {

constexpr std::uint64_t longest_mcap_record = std::uint64_t{1} << 30U;
constexpr std::size_t mcap_record_header_size = 9;  // opcode and length

}  // namespace

std::string_view McapFields::take(std::uint64_t size) {
  has_ended_ = has_ended_ || size > rest_.size();
  if (has_ended_) return {};
  const std::string_view bytes = rest_.substr(0, size);
  rest_.remove_prefix(size);
  return bytes;
}

CdrFields::CdrFields(std::string_view bytes) : bytes_(bytes) {
  is_good_ = bytes.size() >= 4 && bytes[0] == 0 && (bytes[1] == 0 || bytes[1] == 1);
  is_little_ = is_good_ && bytes[1] == 1;
}

void CdrFields::skip_text() {
  const auto size = number<std::uint32_t>();
  is_good_ = is_good_ && size <= bytes_.size() - at_;
  if (is_good_) at_ += size;
}

std::int64_t CdrFields::header_ns() {
  const std::int64_t seconds = number<std::int32_t>(), nanoseconds = number<std::uint32_t>();
  skip_text();
  return seconds * 1'000'000'000 + nanoseconds;
}

void McapReader::refuse(const std::string& fault) { throw std::runtime_error("mcap: " + fault); }

void McapReader::read(std::span<const std::byte> bytes) {
  held_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  constexpr std::string_view magic("\x89MCAP0\r\n", 8);
  std::size_t at = 0;
  if (!has_begun_) {
    if (held_.size() < magic.size()) return;
    if (!held_.starts_with(magic)) refuse("this is no MCAP file of version 0");
    has_begun_ = true;
    at = magic.size();
  }
  at += read_records(std::string_view(held_).substr(at));
  held_.erase(0, has_ended_ ? held_.size() : at);
}

std::size_t McapReader::end() const {
  if (!has_begun_) refuse("the file ends within its magic");
  return held_.size();
}

// Reads whole records. Returns how many bytes they have.
std::size_t McapReader::read_records(std::string_view bytes) {
  std::size_t at = 0;
  while (!has_ended_ && bytes.size() - at >= mcap_record_header_size) {
    McapFields header(bytes.substr(at + 1, 8));
    const auto size = header.number<std::uint64_t>();
    if (size > longest_mcap_record) refuse("a record of more than 1 GiB; the file is damaged");
    if (bytes.size() - at - mcap_record_header_size < size) break;
    read_record(bytes[at], bytes.substr(at + mcap_record_header_size, size));
    at += mcap_record_header_size + size;
  }
  return at;
}

void McapReader::read_record(char opcode, std::string_view body) {
  McapFields fields(body);
  if (opcode == 3) {
    const auto number = fields.number<std::uint16_t>();
    schemas_[number] = fields.text();
  } else if (opcode == 4) {
    const auto number = fields.number<std::uint16_t>(), schema = fields.number<std::uint16_t>();
    const std::string_view topic = fields.text(), encoding = fields.text();
    on_channel(number, schemas_[schema], topic, encoding);
  } else if (opcode == 5) {
    read_message(fields);
  } else if (opcode == 6 && !is_in_chunk_) {
    read_chunk(fields);
  } else if (opcode == 15) {
    has_ended_ = true;  // the summary repeats what came before
  }
  if (fields.has_ended()) count_malformed();
}

void McapReader::read_message(McapFields& fields) {
  const auto channel = fields.number<std::uint16_t>();
  fields.number<std::uint32_t>();
  const auto log_time = fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();
  if (!fields.has_ended()) on_message(channel, log_time, fields.rest());
}

void McapReader::read_chunk(McapFields& fields) {
  fields.number<std::uint64_t>();
  fields.number<std::uint64_t>();
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const std::string_view compression = fields.text();
  std::string_view content = fields.long_bytes();
  if (fields.has_ended()) return;
  std::string whole;
  if (compression == "zstd") {
    if (size > longest_mcap_record) refuse("a chunk of more than 1 GiB; the file is damaged");
    whole.resize(size);
    if (ZSTD_decompress(whole.data(), whole.size(), content.data(), content.size()) != size)
      return void(++damage_.checksum);
    content = whole;
  } else if (!compression.empty()) {
    refuse(fmt::format("its chunks are compressed by {}; right would be zstd or none", compression));
  }
  if (crc != 0 && ::crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()) != crc)
    return void(++damage_.checksum);
  is_in_chunk_ = true;
  if (read_records(content) != content.size()) count_malformed();
  is_in_chunk_ = false;
}

}  // namespace imud
