// McapReader: the messages of MCAP, Foxglove's container (mcap.dev/spec, version 0), and the fields of ROS 2's.
#pragma once

#include <boost/endian/conversion.hpp>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace imud {

// Reads the fields of a record, one after another. After a read beyond the end of the record, has_ended() is true
// and all values are 0.
class McapFields {
 public:
  explicit McapFields(std::string_view bytes) : rest_(bytes) {}
  template <typename T>
  T number() {
    const std::string_view bytes = take(sizeof(T));
    if (bytes.empty()) return 0;
    return boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(
        reinterpret_cast<const unsigned char*>(bytes.data()));
  }
  std::string_view text() { return take(number<std::uint32_t>()); }
  std::string_view long_bytes() { return take(number<std::uint64_t>()); }
  std::string_view rest() const noexcept { return rest_; }
  bool has_ended() const noexcept { return has_ended_; }

 private:
  std::string_view take(std::uint64_t size);

  std::string_view rest_;
  bool has_ended_ = false;
};

// The Common Data Representation of a ROS 2 message (DDS-XTypes 7.4.3.4, XCDR1): four bytes of encapsulation, then
// values at multiples of their size. After a read beyond the end, is_good() is false and all values are 0.
class CdrFields {
 public:
  explicit CdrFields(std::string_view bytes);
  template <typename T>
  T number() {
    at_ = 4 + (at_ - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    is_good_ = is_good_ && at_ + sizeof(T) <= bytes_.size();
    if (!is_good_) return 0;
    const auto* from = reinterpret_cast<const unsigned char*>(bytes_.data() + at_);
    at_ += sizeof(T);
    return is_little_ ? boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(from)
                      : boost::endian::endian_load<T, sizeof(T), boost::endian::order::big>(from);
  }
  void skip_text();
  // Reads a std_msgs/msg/Header. Returns its stamp, ns.
  std::int64_t header_ns();
  bool is_good() const noexcept { return is_good_; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 4;
  bool is_good_ = false, is_little_ = false;
};

// Fed the bytes of a file in pieces of any size. Keeps a record in memory. All functions throw std::runtime_error,
// with the fault and the remedy, if the file is another kind of file or has an unknown compression.
class McapReader {
 public:
  struct Damage {
    std::uint64_t malformed = 0, checksum = 0;  // records
  };
  virtual ~McapReader() = default;
  void read(std::span<const std::byte> bytes);
  // Call it after the last byte. Returns the size of the record that was cut short; 0: no record was.
  std::size_t end() const;
  // Returns the numbers of damaged records since the last call.
  Damage take_damage() noexcept { return std::exchange(damage_, {}); }

 protected:
  [[noreturn]] static void refuse(const std::string& fault);
  void count_malformed() noexcept { ++damage_.malformed; }

 private:
  virtual void on_channel(std::uint16_t number, std::string_view schema, std::string_view topic,
                          std::string_view encoding) = 0;
  virtual void on_message(std::uint16_t channel, std::uint64_t log_time_ns, std::string_view data) = 0;

  std::size_t read_records(std::string_view bytes);
  void read_record(char opcode, std::string_view body);
  void read_message(McapFields& fields);
  void read_chunk(McapFields& fields);

  std::string held_;
  bool has_begun_ = false, has_ended_ = false, is_in_chunk_ = false;
  std::map<std::uint16_t, std::string> schemas_;  // names
  Damage damage_;
};

}  // namespace imud
