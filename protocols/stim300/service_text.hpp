// The texts by which Service Mode of the STIM300 describes a unit.
#pragma once

#include "protocols/stim300/service.hpp"

namespace imud::stim300 {

inline constexpr std::array<std::string_view, 3> cluster_names = {"GYRO", "ACCELEROMETER", "INCLINOMETER"};
inline constexpr std::string_view axis_names = "XYZ";

// Writes one frame of text in lines, each of which ends with CR. The destructor completes the frame. Nothing is
// written if `out` has no room for the longest text.
class ServiceText {
 public:
  explicit ServiceText(FrameBuffer& out) noexcept : out_(out), room_(out.room(longest)) {}
  ~ServiceText() {
    if (size_ > 0) out_.push(size_);
  }
  ServiceText(const ServiceText&) = delete;
  ServiceText& operator=(const ServiceText&) = delete;

  struct Fixed {  // a number with a fixed number of decimals
    double value;
    int decimals;
  };
  template <class... Parts>
  void add(const Parts&... parts) noexcept {
    (put(parts), ...);
  }
  template <class... Parts>
  void line(const Parts&... parts) noexcept {
    add(parts..., '\r');
  }

 private:
  static constexpr std::size_t longest = 6000;

  void put(char c) noexcept {
    if (size_ < room_.size()) room_[size_++] = static_cast<std::byte>(c);
  }
  void put(std::string_view text) noexcept {
    for (const char c : text) put(c);
  }
  void put(unsigned number) noexcept {
    std::array<char, 20> text;
    put(std::string_view(text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr));
  }
  void put(Fixed number) noexcept {
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), std::clamp(number.value, -1e9, 1e9),
                                   std::chars_format::fixed, number.decimals);
    put(std::string_view(text.data(), end.ptr));
  }

  FrameBuffer& out_;
  std::span<std::byte> room_;
  std::size_t size_ = 0;
};

// print_information() prints the whole list of command i; print_part() prints the part with the letter `part` (Table
// 9-35), and returns false if there is no such part. Part 'e' clears the errors.
void print_information(ServiceText& text, const Memory& memory) noexcept;
bool print_part(ServiceText& text, Memory& memory, char part) noexcept;

// Print the answers of commands. `only` is the index of the axis to print; 3: all axes.
void print_unit(ServiceText& text, const Configuration& c, Cluster cluster) noexcept;
void print_pps_unit(ServiceText& text, const Configuration& c) noexcept;
void print_sample_rate(ServiceText& text, const Configuration& c) noexcept;
void print_filters(ServiceText& text, const Configuration& c, Cluster cluster, unsigned only = 3) noexcept;
void print_pps_filter(ServiceText& text, const Configuration& c) noexcept;
void print_g_compensation(ServiceText& text, const Configuration& c, std::string_view warning = "") noexcept;
void print_trims(ServiceText& text, const Memory& memory, Cluster cluster, unsigned only = 3) noexcept;
void print_reference(ServiceText& text, const Memory& memory) noexcept;
void print_datagram(ServiceText& text, const Configuration& c) noexcept;
void print_transmission(ServiceText& text, const UartSettings& line) noexcept;
void print_line_termination(ServiceText& text, const Configuration& c) noexcept;
void print_system(ServiceText& text, const Configuration& c, char which) noexcept;  // `which`: a letter of "vtb"

void print_measurement(ServiceText& text, const std::array<Axes, 3>& measured, const Reading& reading) noexcept;
// Prints every check with its result, which the accumulated errors determine.
void print_diagnostic(ServiceText& text, const Memory& memory) noexcept;

}  // namespace imud::stim300
