// TextLayout::Compiler: makes a TextLayout of a message. Private to TextLayout.
#pragma once

#include "protocols/frames/text/text_layout.hpp"

namespace imud {

class TextLayout::Compiler {
 public:
  Compiler(TextLayout& out, const FrameDescription& description, const FrameDescription::Message& message)
      : out_(out), description_(description), message_(message) {}

  // Fills the layout. Throws std::invalid_argument, whose message has the first fault of the text.
  void compile();
  // Encodes the values of a test, and compares the text with the frame of the test. Adds the faults of the test to
  // `faults`.
  void test(const FrameDescription::Test& test, std::vector<FrameFault>& faults) const;

 private:
  std::size_t place_of(const std::string& label) const;
  void resolve(std::size_t index);
  void check_ends() const;
  void find_read_back();
  void name_fields();
  void make_rows();
  void give(const FrameDescription::Value& value, FrameTestValues& given) const;

  TextLayout& out_;
  const FrameDescription& description_;
  const FrameDescription::Message& message_;
};

}  // namespace imud
