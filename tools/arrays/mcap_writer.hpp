// McapWriter: writes measurements as an MCAP file (mcap.dev/spec, version 0), Foxglove's container of messages.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/arrays/row_clock.hpp"
#include "tools/arrays/row_output.hpp"
#include "tools/text_output.hpp"

namespace imud {

// One channel, `/NAME` of the imu, of JSON messages with a JSON Schema: the columns of measurement_columns(), vectors
// as objects with x, y and z; a value that is not carried is left out. Numbers are the shortest that give the same
// double. Log time and publish time are the measurement's. Chunks of at most 1 MiB and one message, compressed by
// zstd, with message indexes; summary, statistics, chunk index and all CRCs. The attributes are the metadata record
// `imud`. Without finish() the file has whole chunks but no summary, and a reader needs the specification's recovery.
class McapWriter final : public RowOutput {
 public:
  McapWriter(std::string path, bool with_truth, RowAttributes attributes);

  void write(const MeasurementRow& row) override;
  void flush() override;
  void finish() override;

 private:
  struct Span {  // ns
    std::uint64_t begin = 0, end = 0;
  };

  void write_bytes(std::string_view bytes);
  void write_metadata();
  void end_chunk();
  void write_summary();

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

}  // namespace imud
