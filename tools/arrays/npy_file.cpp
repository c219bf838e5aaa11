#include "tools/arrays/npy_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

namespace imud {

namespace {

// Returns the begin of a text of the file, fit to be printed.
std::string printable(std::string_view text) {
  std::string result(text.substr(0, 40));
  std::ranges::replace_if(
      result, [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

[[noreturn]] void refuse(std::string_view fault) {
  throw std::runtime_error(fmt::format("{}; right would be a file of numpy.save(FILE, array.astype(float))", fault));
}

std::string read_bytes(std::istream& in, std::size_t size, std::string_view part) {
  std::string bytes(size, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::size_t>(in.gcount()) != size) refuse(fmt::format("the file ends within its {}", part));
  return bytes;
}

std::size_t little_endian(std::string_view bytes) {
  std::size_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8U | static_cast<unsigned char>(bytes[i]);
  return value;
}

// Returns the text after "'key':" in the header, which is a Python dictionary.
std::string_view after_key(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  if (at == std::string_view::npos) refuse(fmt::format("the header has no '{}'", key));
  std::string_view rest = header.substr(at + key.size() + 3);
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  return rest;
}

// Reads the tuple "(7200, 6)" or "(7200,)".
std::vector<std::size_t> read_shape(std::string_view text) {
  std::vector<std::size_t> shape;
  const std::size_t end = text.find(')');
  if (!text.starts_with('(') || end == std::string_view::npos) refuse("the shape in the header is no tuple");
  text = text.substr(1, end - 1);
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(" ,"), text.size()));
    if (text.empty()) return shape;
    std::size_t number = 0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{}) refuse("the shape in the header is no tuple of numbers");
    shape.push_back(number);
    text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
  }
}

}  // namespace

NpyArray read_npy(std::istream& in) {
  constexpr std::string_view magic = "\x93NUMPY";
  constexpr std::size_t longest_header = 1'000'000;
  std::string begin(magic.size(), '\0');
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (begin != magic) refuse("this is no NumPy file");
  const std::string version = read_bytes(in, 2, "header");
  if (version[0] < 1 || version[0] > 3) refuse(fmt::format("version {} of the format is unknown", int{version[0]}));
  const std::size_t header_size = little_endian(read_bytes(in, version[0] == 1 ? 2 : 4, "header"));
  if (header_size > longest_header) refuse(fmt::format("the header has {} bytes", header_size));
  const std::string header = read_bytes(in, header_size, "header");

  const std::string_view type = after_key(header, "descr");
  const bool is_little = type.starts_with("'<f8'"), is_big = type.starts_with("'>f8'");
  if (!is_little && !is_big)
    refuse(fmt::format("its type is {}, not float64", printable(type.substr(0, type.find(',')))));
  const std::vector<std::size_t> shape = read_shape(after_key(header, "shape"));
  if (shape.empty() || shape.size() > 2) refuse(fmt::format("it has {} dimensions, not 1 or 2", shape.size()));
  NpyArray array;
  array.rows = shape[0];
  array.columns = shape.size() == 2 ? shape[1] : 1;
  if (array.rows == 0 || array.columns == 0) refuse("it is empty");
  if (array.columns > 1000 || array.rows > std::numeric_limits<std::size_t>::max() / 8000)
    refuse(fmt::format("its shape is {} x {}", array.rows, array.columns));
  if (!after_key(header, "fortran_order").starts_with("False") && array.columns > 1)
    throw std::runtime_error(
        "it is in Fortran order; right would be a file of numpy.save(FILE, numpy.ascontiguousarray(array))");

  const std::size_t count = array.rows * array.columns;
  std::array<double, 8192> block;
  while (array.values.size() < count) {
    const std::size_t wanted = std::min(block.size(), count - array.values.size());
    in.read(reinterpret_cast<char*>(block.data()), static_cast<std::streamsize>(wanted * sizeof(double)));
    if (static_cast<std::size_t>(in.gcount()) != wanted * sizeof(double))
      refuse(fmt::format("the file ends before row {}", (array.values.size() + wanted) / array.columns));
    if (is_little)
      for (double& value : block) boost::endian::little_to_native_inplace(reinterpret_cast<std::uint64_t&>(value));
    else
      for (double& value : block) boost::endian::big_to_native_inplace(reinterpret_cast<std::uint64_t&>(value));
    array.values.insert(array.values.end(), block.begin(), block.begin() + static_cast<std::ptrdiff_t>(wanted));
  }
  if (in.peek() != std::istream::traits_type::eof()) refuse("the file has more data than its shape");
  return array;
}

}  // namespace imud
