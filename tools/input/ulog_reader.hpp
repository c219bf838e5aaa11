// UlogReader: the messages of a ULog, PX4's format of flight logs (docs.px4.io, "ULog File Format", version 1).
#pragma once

#include <boost/endian/conversion.hpp>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace imud {

// The fields of a topic, and where they are in its messages.
struct UlogFormat {
  struct Field {
    std::string type, name;
    std::size_t count = 1, offset = 0, size = 0;  // `size` of one element, bytes
    bool is_real() const noexcept { return type == "float" || type == "double"; }
  };
  // Returns nullptr if there is no field of that name.
  const Field* find(std::string_view name) const;

  std::vector<Field> fields;
  std::size_t size = 0;
};

// A message of a topic. A message refers to the reader's memory, and is valid until the call that it is an
// argument of returns.
struct UlogMessage {
  const UlogFormat& format;
  std::string_view body;  // at least format.size

  // Returns a field that is one number of that size; nullopt if there is no such field.
  template <typename T>
  std::optional<T> number(std::string_view name) const {
    const UlogFormat::Field* field = format.find(name);
    if (field == nullptr || field->size != sizeof(T) || field->count != 1) return {};
    return boost::endian::endian_load<T, sizeof(T), boost::endian::order::little>(
        reinterpret_cast<const unsigned char*>(body.data() + field->offset));
  }
  // Returns element `i` of a field that is_real().
  double real(const UlogFormat::Field& field, std::size_t i = 0) const;
  // Returns the time of the measurement, ns since the start of the system: timestamp_sample, or timestamp where that
  // is absent or 0; nullopt if it is out of range.
  std::optional<std::int64_t> time_ns() const;
};

// Fed the bytes of a file in pieces of any size. Keeps a message in memory. All functions throw std::runtime_error,
// with the fault and the remedy, if the file is another kind of file or has an unknown incompatible flag.
class UlogReader {
 public:
  virtual ~UlogReader() = default;
  void read(std::span<const std::byte> bytes);
  // Call it after the last byte. Returns the size of the message that was cut short; 0: no message was.
  std::size_t end() const;
  // Returns how many messages were malformed since the last call.
  std::uint64_t take_malformed() noexcept { return std::exchange(malformed_, 0); }

 protected:
  [[noreturn]] static void refuse(const std::string& fault);
  // Returns the format of that name with the places of its fields. If this format or a format nested in it is
  // unknown, counts it as malformed and returns nullptr.
  const UlogFormat* format(std::string_view name);
  // Returns the message, padded to its size. If the message is too short, counts it as malformed and returns
  // nullopt.
  std::optional<UlogMessage> message(const UlogFormat& format, std::string_view body);
  void count_malformed() noexcept { ++malformed_; }

 private:
  virtual void on_subscription(std::uint8_t instance, std::uint16_t number, std::string_view topic) = 0;
  virtual void on_data(std::uint16_t number, std::string_view body) = 0;

  void read_message(char type, std::string_view body);
  void define(std::string_view text);
  std::size_t lay_out(const std::string& name, int depth = 0);

  std::string held_, padded_;
  std::uint64_t position_ = 0, appended_ = std::numeric_limits<std::uint64_t>::max(), malformed_ = 0;
  std::map<std::string, UlogFormat> formats_;
};

}  // namespace imud
