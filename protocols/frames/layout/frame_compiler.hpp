// FrameLayout::Compiler: makes a FrameLayout of a message. Private to FrameLayout.
#pragma once

#include <map>
#include <utility>

#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {

class FrameLayout::Compiler {
 public:
  Compiler(FrameLayout& out, const FrameDescription& description, const FrameDescription::Message& message, Use use)
      : out_(out), description_(description), message_(message), use_(use) {}

  // Fills the layout. Throws FrameFaults with every fault of the message.
  void compile();
  // Encodes the values of the tests and compares the bytes with their frames. Throws FrameFaults.
  void test();

 private:
  struct Placed {
    FrameElement element;
    std::uint32_t line = 0;
    std::size_t offset = 0;
    std::uint64_t needs = 0;  // bit of the condition of an optional element
  };
  void place(FrameElement element, std::uint32_t line);
  void add_field(const Placed& placed);
  void add_bits(const Placed& placed);
  void resolve_length(const Placed& placed);
  void resolve_check(const Placed& placed);
  void order_checks();
  void check_sync();
  std::uint64_t condition_of(const FrameElement& element);
  void require_whole(const FrameCheck::Range& range, std::size_t bytes, const std::string& pieces) const;
  void require_sizes(const Whole::Length& length) const;
  void make_optional();
  void set_variable(const FrameElement& element);
  void make_variable();
  void set_increments() noexcept;
  void make_rows();
  void set_number(Field& field, const FrameElement& element);
  void set_counting(Field& field, const FrameSource& source) const;
  FrameCheck::Range range(const FrameElement::Range& range, std::size_t own) const;
  std::size_t place_of(const std::string& label) const;
  void give(const FrameDescription::Value& value, FrameTestValues& given) const;
  void test(const FrameDescription::Test& test);
  void test_selected(const FrameDescription::Test& test);
  void copy_elements(FrameElement::Kind kind, std::span<const std::byte> from, std::span<std::byte> to) const;
  std::pair<std::size_t, std::vector<Row>::const_iterator> first_difference(std::span<const std::byte> got,
                                                                            std::span<const std::byte> wanted) const;
  // Return texts for a fault: bytes differ from the test frame; their number differs; a check differs from the check
  // in the test frames.
  std::string difference(std::span<const std::byte> got, std::span<const std::byte> wanted) const;
  std::string wrong_size(std::span<const std::byte> got, std::span<const std::byte> wanted) const;
  std::string wrong_check(const Check& check) const;
  void constant(std::size_t offset, std::span<const std::byte> bytes);

  // Calls `act` and adds the fault that it throws.
  template <class Act>
  void attempt(std::uint32_t line, const std::string& text, Act act);
  void fault(std::uint32_t line, const std::string& key, std::string what);

  FrameLayout& out_;
  const FrameDescription& description_;
  const FrameDescription::Message& message_;
  const Use use_;
  std::optional<FrameSettings> settings_;  // made if an element is optional
  std::vector<Placed> placed_;
  std::map<std::string, std::size_t> labels_;
  std::vector<FrameFault> faults_;
};

}  // namespace imud
