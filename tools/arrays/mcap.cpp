// McapWriter: writes measurements as an MCAP file (mcap.dev/spec, version 0), Foxglove's container of messages.
#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "tools/arrays/little_endian.hpp"
#include "tools/arrays/row_clock.hpp"
#include "tools/arrays/row_output.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

// Opcodes of the records.
enum McapRecord : char {
  header_record = 1,
  footer_record,
  schema_record,
  channel_record,
  message_record,
  chunk_record,
  message_index_record,
  chunk_index_record,
  statistics_record = 11,
  metadata_record,
  metadata_index_record,
  summary_offset_record,
  data_end_record
};

constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);
constexpr std::uint16_t only_id = 1;  // of the schema and of the channel
constexpr std::size_t chunk_size = 1024 * 1024;

// Returns the content of a record: numbers, and texts after their sizes.
template <typename... Fields>
std::string content_of(const Fields&... fields) {
  std::string content;
  const auto append = [&content](const auto& field) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(field)>>) {
      append_little(content, field);
    } else {
      const std::string_view text = field;
      append_little(content, static_cast<std::uint32_t>(text.size()));
      content += text;
    }
  };
  (append(fields), ...);
  return content;
}

void append_record(std::string& out, McapRecord opcode, std::string_view content) {
  out += opcode;
  append_little(out, std::uint64_t{content.size()});
  out += content;
}

template <typename... Fields>
std::string make_record(McapRecord opcode, const Fields&... fields) {
  std::string record;
  append_record(record, opcode, content_of(fields...));
  return record;
}

std::uint32_t add_to_crc(std::uint32_t crc, std::string_view bytes) {
  return static_cast<std::uint32_t>(::crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string json_schema(std::span<const MeasurementColumn> columns) {
  nlohmann::ordered_json properties;
  for (const MeasurementColumn& column : columns) {
    nlohmann::ordered_json one{{"type", column.values > 1 ? "object" : column.type == "f8" ? "number" : "integer"}};
    one["description"] =
        fmt::format("{} [{}]{}{}", column.meaning, column.unit, column.frame.empty() ? "" : "; ", column.frame);
    if (column.values > 1)
      for (const char* axis : {"x", "y", "z"}) one["properties"][axis] = {{"type", "number"}};
    properties[std::string(column.name)] = std::move(one);
  }
  return nlohmann::ordered_json{{"title", "imud.Measurement"}, {"type", "object"}, {"properties", properties}}.dump();
}

template <typename T>
T value_at(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

void append_member(std::string& out, std::string_view name, auto value) {
  fmt::format_to(std::back_inserter(out), "{}\"{}\":{}", out.back() == '{' ? "" : ",", name, value);
}

void append_json(std::string& out, const MeasurementRow& row, bool with_truth) {
  out += '{';
  const char* from = reinterpret_cast<const char*>(&row);
  for (const MeasurementColumn& column : measurement_columns(with_truth)) {
    if (column.type == "i8") {
      if (const auto value = value_at<std::int64_t>(from); value != MeasurementRow::no_time)
        append_member(out, column.name, value);
    } else if (column.type == "u8") {
      if (const auto value = value_at<std::uint64_t>(from); value != MeasurementRow::no_counter)
        append_member(out, column.name, value);
    } else if (column.type == "u4") {
      append_member(out, column.name, value_at<std::uint32_t>(from));
    } else if (column.values == 1) {
      if (const auto value = value_at<double>(from); std::isfinite(value)) append_member(out, column.name, value);
    } else {
      std::string vector = "{";
      for (std::size_t axis = 0; axis < column.values; ++axis)
        if (const auto value = value_at<double>(from + axis * sizeof(double)); std::isfinite(value))
          append_member(vector, std::string_view("xyz").substr(axis, 1), value);
      if (vector.size() > 1) append_member(out, column.name, vector + '}');
    }
    from += column.size();
  }
  out += '}';
}

// One channel, `/NAME` of the imu, of JSON messages with a JSON Schema: the columns of measurement_columns(), vectors
// as objects with x, y and z; a value that is not carried is left out. Numbers are the shortest that give the same
// double. Log time and publish time are the measurement's. Chunks of at most 1 MiB and one message, compressed by
// zstd, with message indexes; summary, statistics, chunk index and all CRCs. The attributes are the metadata record
// `imud`. Without finish() the file has whole chunks but no summary, and a reader needs the specification's recovery.
class McapWriter final : public RowOutput {
 public:
  McapWriter(std::string path, bool with_truth, RowAttributes attributes)
      : path_(std::move(path)),
        with_truth_(with_truth),
        attributes_(std::move(attributes)),
        file_(path_),
        clock_(attributes_.rate_hz) {
    write_bytes(mcap_magic);
    write_bytes(make_record(header_record, "", "imud " IMUD_VERSION));
    write_metadata();
    schema_ = make_record(schema_record, only_id, "imud.Measurement", "jsonschema",
                          json_schema(measurement_columns(with_truth_)));
    channel_ = make_record(channel_record, only_id, only_id, "/" + attributes_.imu, "json", "");
    write_bytes(schema_);
    write_bytes(channel_);
  }

  void write(const MeasurementRow& row) override {
    const auto time = clock_.next(row);
    if (!time) return;
    const auto include = [&](Span& span, bool is_first) {
      span = is_first ? Span{*time, *time} : Span{std::min(span.begin, *time), std::max(span.end, *time)};
    };
    include(file_time_, messages_ == 0);
    include(chunk_time_, chunk_messages_ == 0);
    append_little(index_entries_, *time, std::uint64_t{chunk_.size()});
    ++messages_;
    ++chunk_messages_;

    message_.clear();
    const std::uint32_t sequence =
        row.counter == MeasurementRow::no_counter ? 0 : static_cast<std::uint32_t>(row.counter);
    append_little(message_, only_id, sequence, *time, *time);
    append_json(message_, row, with_truth_);
    append_record(chunk_, message_record, message_);
    if (chunk_.size() >= chunk_size) end_chunk();
  }
  void flush() override {
    end_chunk();
    file_.flush();
  }
  void finish() override {
    end_chunk();
    write_bytes(make_record(data_end_record, crc_));
    write_summary();
    file_.flush();
    if (!file_.is_open()) throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(file_.error())));
    if (const std::string fault = clock_.fault(); !fault.empty())
      throw std::runtime_error(fmt::format("{}: {}", path_, fault));
  }

 private:
  struct Span {  // ns
    std::uint64_t begin = 0, end = 0;
  };

  void write_bytes(std::string_view bytes) {
    crc_ = add_to_crc(crc_, bytes);
    position_ += bytes.size();
    file_.write(bytes);
  }
  void write_metadata() {
    std::string entries;
    for (const auto& [key, text] : attributes_.texts) entries += content_of(key, text);
    if (attributes_.seed) entries += content_of("seed", std::to_string(*attributes_.seed));
    const std::string record = make_record(metadata_record, "imud", entries);
    metadata_index_ = make_record(metadata_index_record, position_, std::uint64_t{record.size()}, "imud");
    write_bytes(record);
  }
  void end_chunk() {
    if (chunk_messages_ == 0) return;
    std::string compressed(ZSTD_compressBound(chunk_.size()), '\0');
    const std::size_t size = ZSTD_compress(compressed.data(), compressed.size(), chunk_.data(), chunk_.size(), 3);
    const bool is_compressed = ZSTD_isError(size) == 0;
    compressed.resize(is_compressed ? size : 0);
    const std::string& stored = is_compressed ? compressed : chunk_;
    const std::string_view compression = is_compressed ? "zstd" : "";

    const std::uint64_t begin = position_;
    const std::string head = content_of(chunk_time_.begin, chunk_time_.end, std::uint64_t{chunk_.size()},
                                        add_to_crc(0, chunk_), compression, std::uint64_t{stored.size()});
    std::string record(1, chunk_record);
    append_little(record, std::uint64_t{head.size() + stored.size()});
    write_bytes(record + head);
    write_bytes(stored);

    const std::uint64_t index_begin = position_;
    write_bytes(make_record(message_index_record, only_id, index_entries_));
    chunk_indexes_ += make_record(chunk_index_record, chunk_time_.begin, chunk_time_.end, begin, index_begin - begin,
                                  content_of(only_id, index_begin), position_ - index_begin, compression,
                                  std::uint64_t{stored.size()}, std::uint64_t{chunk_.size()});
    ++chunks_;
    chunk_.clear();
    index_entries_.clear();
    chunk_messages_ = 0;
  }
  void write_summary() {
    constexpr std::uint32_t none = 0, one = 1;
    const std::string statistics =
        make_record(statistics_record, messages_, std::uint16_t{1}, one, none, one, chunks_, file_time_.begin,
                    file_time_.end, content_of(only_id, messages_));
    const std::uint64_t begin = position_;
    crc_ = 0;
    std::string offsets;
    for (const std::string* group : std::initializer_list<const std::string*>{&schema_, &channel_, &statistics,
                                                                              &chunk_indexes_, &metadata_index_}) {
      if (group->empty()) continue;
      offsets += make_record(summary_offset_record, group->front(), position_, std::uint64_t{group->size()});
      write_bytes(*group);
    }
    const std::uint64_t offsets_begin = position_;
    write_bytes(offsets);
    // The CRC covers the footer up to the CRC itself.
    std::string footer(1, footer_record);
    footer += content_of(std::uint64_t{2 * sizeof begin + sizeof crc_}, begin, offsets_begin);
    write_bytes(footer);
    write_bytes(content_of(crc_));
    write_bytes(mcap_magic);
  }

  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  TextOutput file_;
  RowClock clock_;
  std::uint64_t position_ = 0;  // in the file
  std::uint32_t crc_ = 0;       // of all bytes before it; in the summary, from its beginning

  std::string schema_, channel_;  // records
  std::string chunk_, message_, index_entries_;
  Span chunk_time_, file_time_;
  std::uint64_t messages_ = 0, chunk_messages_ = 0;
  std::uint32_t chunks_ = 0;
  std::string chunk_indexes_, metadata_index_;
};

}  // namespace

extern constexpr RowFormat mcap_row_format = {
    .name = "mcap",
    .help = "also writes MCAP, Foxglove's format: a channel of JSON messages",
    .keeps_attributes = true,
    .needs_time = true,
    .make = make_writer<McapWriter>};

}  // namespace imud
