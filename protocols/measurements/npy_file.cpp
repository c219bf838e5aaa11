#include "protocols/measurements/npy_file.hpp"

#include <algorithm>
#include <bit>
#include <boost/endian/conversion.hpp>
#include <charconv>
#include <limits>
#include <stdexcept>
#include <string_view>

namespace imud {
namespace {

constexpr std::string_view npy_magic = "\x93NUMPY";

// Returns the first characters of a text of the file, with ? in place of characters that cannot be printed.
std::string printable(std::string_view text) {
  std::string result(text.substr(0, 40));
  std::ranges::replace_if(
      result, [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

[[noreturn]] void refuse(const std::string& fault) {
  throw std::runtime_error(fault + "; right would be a file of numpy.save(FILE, array.astype(float))");
}

std::string read_bytes(std::istream& in, std::size_t size, const std::string& part) {
  std::string bytes(size, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::size_t>(in.gcount()) != size) refuse("the file ends within its " + part);
  return bytes;
}

std::size_t little_endian(std::string_view bytes) {
  std::size_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8U | static_cast<unsigned char>(bytes[i]);
  return value;
}

// Returns the text after "'key':" in the header, which is a Python dictionary.
std::string_view after_key(std::string_view header, const std::string& key) {
  const std::size_t at = header.find("'" + key + "':");
  if (at == std::string_view::npos) refuse("the header has no '" + key + "'");
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

std::string npy_header(std::span<const MeasurementColumn> columns, std::span<const std::uint64_t> shape) {
  constexpr char order = std::endian::native == std::endian::little ? '<' : '>';
  std::string text = "{'descr': [";
  for (const MeasurementColumn& column : columns) {
    text.append("('").append(column.name).append("', '").append(1, order).append(column.type).append("'");
    text += column.values > 1 ? ", (" + std::to_string(column.values) + ",)), " : "), ";
  }
  text += "], 'fortran_order': False, 'shape': (";
  std::string numbers;
  for (const std::uint64_t size : shape) numbers += std::to_string(size) + ", ";
  // The header, with npy_magic, version and length, is padded with blanks to a multiple of 64. Its size has room for
  // the longest shape.
  constexpr std::string_view end = "), }";
  constexpr std::size_t before = 10, alignment = 64, longest_shape = 2 * 22;
  const std::size_t longest = before + text.size() + longest_shape + end.size() + 1;
  const std::size_t size = (longest + alignment - 1) / alignment * alignment - before;
  text.append(numbers).append(end);
  text.append(size - text.size() - 1, ' ');
  text += '\n';
  std::string header(npy_magic);
  header.append("\x01\x00", 2);
  header += static_cast<char>(text.size() & 0xFFU);
  header += static_cast<char>(text.size() >> 8U);
  return header + text;
}

NpyRows::NpyRows(std::istream& in) : in_(in) {
  constexpr std::size_t longest_header = 1'000'000;
  std::string begin(npy_magic.size(), '\0');
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (begin != npy_magic) refuse("this is no NumPy file");
  const std::string version = read_bytes(in, 2, "header");
  if (version[0] < 1 || version[0] > 3) refuse("version " + std::to_string(version[0]) + " of the format is unknown");
  const std::size_t header_size = little_endian(read_bytes(in, version[0] == 1 ? 2 : 4, "header"));
  if (header_size > longest_header) refuse("the header has " + std::to_string(header_size) + " bytes");
  const std::string header = read_bytes(in, header_size, "header");

  const std::string_view type = after_key(header, "descr");
  is_little_ = type.starts_with("'<f8'");
  const bool is_big = type.starts_with("'>f8'");
  if (!is_little_ && !is_big) refuse("its type is " + printable(type.substr(0, type.find(','))) + ", not float64");
  const std::vector<std::size_t> shape = read_shape(after_key(header, "shape"));
  if (shape.empty() || shape.size() > 2) refuse("it has " + std::to_string(shape.size()) + " dimensions, not 1 or 2");
  rows_ = shape[0];
  columns_ = shape.size() == 2 ? shape[1] : 1;
  if (rows_ == 0 || columns_ == 0) refuse("it is empty");
  if (columns_ > 1000 || rows_ > std::numeric_limits<std::size_t>::max() / 8000)
    refuse("its shape is " + std::to_string(rows_) + " x " + std::to_string(columns_));
  if (!after_key(header, "fortran_order").starts_with("False") && columns_ > 1)
    throw std::runtime_error(
        "it is in Fortran order; right would be a file of numpy.save(FILE, numpy.ascontiguousarray(array))");
}

std::span<const double> NpyRows::next() {
  if (taken_ == block_.size()) {
    if (read_ == rows_) {
      if (in_.peek() != std::istream::traits_type::eof()) refuse("the file has more data than its shape");
      return {};
    }
    constexpr std::size_t values = 8192;
    const std::size_t ahead = std::min(std::max<std::size_t>(1, values / columns_), rows_ - read_);
    block_.resize(ahead * columns_);
    taken_ = 0;
    in_.read(reinterpret_cast<char*>(block_.data()), static_cast<std::streamsize>(block_.size() * sizeof(double)));
    if (static_cast<std::size_t>(in_.gcount()) != block_.size() * sizeof(double))
      refuse("the file ends before row " + std::to_string(read_ + ahead));
    for (double& value : block_) {
      auto& bits = reinterpret_cast<std::uint64_t&>(value);
      if (is_little_)
        boost::endian::little_to_native_inplace(bits);
      else
        boost::endian::big_to_native_inplace(bits);
    }
    read_ += ahead;
  }
  taken_ += columns_;
  return std::span<const double>(block_).subspan(taken_ - columns_, columns_);
}

}  // namespace imud
