// JsonFields: the quantities of truth in a JSON object.
#pragma once

#include <boost/container/static_vector.hpp>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/quantities/truth_map.hpp"

namespace imud {

// Reads a JSON object (RFC 8259) and the values at given paths in it. A path is a sequence of names separated by
// dots; the elements of an array are numbered from 0: "imu.gyro.2". Names are compared without decoding escapes,
// so that a name with an escape matches nothing. An object must have a quantity once. Without paths, the names at the
// top level must be names of quantities. NaN, Infinity and -Infinity, which are not of RFC 8259, are values, too:
// Python's json.dumps() writes them.
//
// read() allocates nothing. One thread.
class JsonFields {
 public:
  static constexpr std::size_t max_depth = 32;  // nested objects and arrays

  JsonFields() : JsonFields(TruthMap{}) {}
  // Throws std::invalid_argument, "columns: ...", if two paths are equal, or one path is the begin of another.
  explicit JsonFields(TruthMap map);
  JsonFields(JsonFields&&) noexcept = default;
  JsonFields(const JsonFields&) = delete;

  enum class Outcome : std::uint8_t {
    whole,   // an object; text after the object is not read
    cut,     // the text ends before the object does
    faulty,  // no object, or no JSON; position() is the place of the fault
    refused  // an object with a value that refused() describes
  };
  // Reads the object at the begin of `text`; blanks before the object are allowed.
  Outcome read(std::string_view text, TruthReading& reading) noexcept;
  // The quantities of the last object.
  const QuantitySet& given() const noexcept { return given_; }
  // The number of characters that were read.
  std::size_t position() const noexcept { return at_; }

  struct Refused {
    TruthResult cause = TruthResult::ok;
    std::size_t quantity = 0;
    std::string_view value;  // as it is written
    bool is_twice = false;   // the object has the quantity twice
  };
  // The first refused value of the last object.
  const Refused& refused() const noexcept { return refused_; }
  const TruthMap& map() const noexcept { return map_; }
  // The first names at the top level of the last object that are in no path, and are no quantity; views of its text.
  std::span<const std::string_view> unknown() const noexcept { return {unknown_.data(), unknown_.size()}; }

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
  bool read_word(std::initializer_list<std::string_view> words) noexcept;
  bool read_not_finite() noexcept;
  void set(const TruthField& field, std::string_view value) noexcept;

  TruthMap map_;
  std::vector<Node> nodes_;  // the first one is the object itself
  std::string_view text_;
  std::size_t at_ = 0;
  TruthReading* reading_ = nullptr;
  QuantitySet given_;
  Refused refused_;
  boost::container::static_vector<std::string_view, 4> unknown_;
};

}  // namespace imud
