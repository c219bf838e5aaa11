// JsonFields: the quantities of truth in a JSON object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/truth_map.hpp"

namespace imud {

// Reads a JSON object (RFC 8259) and the values at given paths in it. A path is names with dots between them, an
// array's elements counted from 0: "imu.gyro.2". A name is compared as it is written, so that one with an escape
// matches nothing. If an object has a name twice, the last value is used. Without paths, the names at the top
// level are quantities' names.
//
// read() allocates nothing. One thread.
class JsonFields {
 public:
  static constexpr std::size_t max_depth = 32;  // objects and arrays in one another

  JsonFields() : JsonFields(TruthMap{}) {}
  // Throws std::invalid_argument, "columns: ...", if a path is used twice, or goes on beyond the value of another.
  explicit JsonFields(TruthMap map);
  JsonFields(JsonFields&&) noexcept = default;
  JsonFields(const JsonFields&) = delete;

  enum class Outcome : std::uint8_t {
    whole,   // an object; what follows it is left
    cut,     // the text ends before the object does
    faulty,  // no object, or no JSON; position() is where
    refused  // an object with a value that refused() describes
  };
  // Reads the object at the begin of `text`, which may have blanks before it.
  Outcome read(std::string_view text, TruthReading& reading) noexcept;
  // The quantities of the last object.
  const QuantitySet& given() const noexcept { return given_; }
  // The number of characters that were read.
  std::size_t position() const noexcept { return at_; }

  struct Refused {
    TruthResult cause = TruthResult::ok;
    std::size_t quantity = 0;
    std::string_view value;  // as it is written
  };
  // The first value of the last object that is not as it should be.
  const Refused& refused() const noexcept { return refused_; }
  const TruthMap& map() const noexcept { return map_; }

 private:
  // A name in a path. The nodes with the same parent form a list.
  struct Node {
    std::string name;
    std::size_t child = 0, sibling = 0;  // index in nodes_; 0: there is none
    const MappedQuantity* mapped = nullptr;
  };
  std::size_t child_of(std::size_t node, std::string_view name) const noexcept;

  void skip_blanks() noexcept;
  bool take(char c) noexcept;
  bool read_value(std::size_t node, std::size_t depth) noexcept;
  bool read_object(std::size_t node, std::size_t depth) noexcept;
  bool read_array(std::size_t node, std::size_t depth) noexcept;
  bool read_text(std::string_view& text) noexcept;
  bool read_number() noexcept;
  bool read_digits() noexcept;
  bool read_word() noexcept;
  void set(const TruthField& field, std::string_view value) noexcept;

  TruthMap map_;
  std::vector<Node> nodes_;  // the first one is the object itself
  std::string_view text_;
  std::size_t at_ = 0;
  TruthReading* reading_ = nullptr;
  QuantitySet given_;
  Refused refused_;
};

}  // namespace imud
