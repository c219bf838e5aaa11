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

// The content of a record, field by field.
class Content {
 public:
  template <typename T>
  Content& number(T value) {
    append_little(bytes_, value);
    return *this;
  }
  Content& text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  const std::string& bytes() const noexcept { return bytes_; }

 private:
  std::string bytes_;
};

void append_record(std::string& out, McapRecord opcode, std::string_view content) {
  out += opcode;
  append_little(out, std::uint64_t{content.size()});
  out += content;
}

std::string make_record(McapRecord opcode, const Content& content) {
  std::string record;
  append_record(record, opcode, content.bytes());
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
    write_bytes(make_record(header_record, Content().text("").text("imud " IMUD_VERSION)));
    write_metadata();
    schema_ = make_record(schema_record, Content()
                                             .number(only_id)
                                             .text("imud.Measurement")
                                             .text("jsonschema")
                                             .text(json_schema(measurement_columns(with_truth_))));
    channel_ = make_record(
        channel_record, Content().number(only_id).number(only_id).text("/" + attributes_.imu).text("json").text(""));
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
    append_little(index_entries_, *time);
    append_little(index_entries_, std::uint64_t{chunk_.size()});
    ++messages_;
    ++chunk_messages_;

    message_.clear();
    append_little(message_, only_id);
    append_little(message_, row.counter == MeasurementRow::no_counter ? 0 : static_cast<std::uint32_t>(row.counter));
    append_little(message_, *time);
    append_little(message_, *time);
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
    write_bytes(make_record(data_end_record, Content().number(std::uint32_t{crc_})));
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
    Content entries;
    for (const auto& [key, text] : attributes_.texts) entries.text(key).text(text);
    if (attributes_.seed) entries.text("seed").text(std::to_string(*attributes_.seed));
    const std::string record = make_record(metadata_record, Content().text("imud").text(entries.bytes()));
    metadata_index_ = make_record(metadata_index_record,
                                  Content().number(position_).number(std::uint64_t{record.size()}).text("imud"));
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
    Content chunk;
    chunk.number(chunk_time_.begin).number(chunk_time_.end).number(std::uint64_t{chunk_.size()});
    chunk.number(add_to_crc(0, chunk_)).text(compression).number(std::uint64_t{stored.size()});
    std::string record(1, chunk_record);
    append_little(record, std::uint64_t{chunk.bytes().size() + stored.size()});
    write_bytes(record + chunk.bytes());
    write_bytes(stored);

    const std::uint64_t index_begin = position_;
    write_bytes(make_record(message_index_record, Content().number(only_id).text(index_entries_)));
    chunk_indexes_ += make_record(chunk_index_record, Content()
                                                          .number(chunk_time_.begin)
                                                          .number(chunk_time_.end)
                                                          .number(begin)
                                                          .number(index_begin - begin)
                                                          .text(Content().number(only_id).number(index_begin).bytes())
                                                          .number(position_ - index_begin)
                                                          .text(compression)
                                                          .number(std::uint64_t{stored.size()})
                                                          .number(std::uint64_t{chunk_.size()}));
    ++chunks_;
    chunk_.clear();
    index_entries_.clear();
    chunk_messages_ = 0;
  }
  void write_summary() {
    constexpr std::uint32_t none = 0, one = 1;
    const std::string statistics =
        make_record(statistics_record, Content()
                                           .number(messages_)
                                           .number(std::uint16_t{1})
                                           .number(one)
                                           .number(none)
                                           .number(one)
                                           .number(chunks_)
                                           .number(file_time_.begin)
                                           .number(file_time_.end)
                                           .text(Content().number(only_id).number(messages_).bytes()));
    const std::uint64_t begin = position_;
    crc_ = 0;
    std::string offsets;
    for (const std::string* group : std::initializer_list<const std::string*>{&schema_, &channel_, &statistics,
                                                                              &chunk_indexes_, &metadata_index_}) {
      if (group->empty()) continue;
      offsets += make_record(summary_offset_record,
                             Content().number(group->front()).number(position_).number(std::uint64_t{group->size()}));
      write_bytes(*group);
    }
    const std::uint64_t offsets_begin = position_;
    write_bytes(offsets);
    // The CRC covers the footer up to the CRC itself.
    std::string footer(1, footer_record);
    append_little(footer, std::uint64_t{2 * sizeof(std::uint64_t) + sizeof(std::uint32_t)});
    append_little(footer, begin);
    append_little(footer, offsets_begin);
    write_bytes(footer);
    write_bytes(Content().number(std::uint32_t{crc_}).bytes());
    write_bytes(mcap_magic);
  }

  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  TextOutput file_;
  RowClock clock_;
  std::uint64_t position_ = 0;  // in the file
  std::uint32_t crc_ = 0;       // of all before it; the summary's, from its begin

  std::string schema_, channel_;  // records
  std::string chunk_, message_, index_entries_;
  Span chunk_time_, file_time_;
  std::uint64_t messages_ = 0, chunk_messages_ = 0;
  std::uint32_t chunks_ = 0;
  std::string chunk_indexes_, metadata_index_;
};

}  // namespace

extern constexpr RowFormat mcap_row_format = {
    .option = "--mcap",
    .help = "also writes MCAP, Foxglove's format: a channel of JSON messages",
    .keeps_attributes = true,
    .needs_time = true,
    .make = make_writer<McapWriter>};

}  // namespace imud
