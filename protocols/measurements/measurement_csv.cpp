#include "protocols/measurements/measurement_csv.hpp"

#include <charconv>
#include <cmath>
#include <concepts>
#include <limits>

#include "core/numbers/number_text.hpp"
#include "protocols/measurements/measured_vectors.hpp"
#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

class RowWriter {
 public:
  RowWriter(std::span<char, measurement_csv_row_max> row, int digits)
      : begin_(row.data()), at_(begin_), end_(begin_ + row.size()), digits_(digits) {}

  void field(bool carried, double number, char separator = ',') noexcept {
    if (carried) at_ = digits_ == all_digits ? write_shortest(at_, number) : write_rounded(at_, number, digits_);
    *at_++ = separator;
  }
  template <std::integral Number>
  void field(bool carried, Number number, char separator = ',') noexcept {
    if (carried) at_ = std::to_chars(at_, end_, number).ptr;
    *at_++ = separator;
  }

  std::size_t length() const noexcept { return static_cast<std::size_t>(at_ - begin_); }

 private:
  char* begin_;
  char* at_;
  char* end_;
  int digits_;
};

// Reads fields one after another. After a wrong field `good` is false for the rest of the row.
class RowReader {
 public:
  explicit RowReader(std::string_view row) : rest_(row) {}

  // Returns true if the next field exists and is not empty; sets `number` if it is a finite number.
  bool field(double& number) noexcept {
    const std::string_view text = next();
    if (text.empty()) return false;
    const auto parsed = parse_real(text);
    good = good && parsed && std::isfinite(*parsed);
    if (good) number = *parsed;
    return true;
  }

  template <class Integer>
  bool field(Integer& number) noexcept {
    const std::string_view text = next();
    if (text.empty()) return false;
    const auto parsed = number_in<Integer>(text);
    good = good && parsed;
    number = parsed.value_or(0);
    return true;
  }

  bool at_end() const noexcept { return rest_.data() == nullptr; }

  bool good = true;

 private:
  std::string_view next() noexcept {
    good = good && !at_end();
    return trim(take_field(rest_));
  }

  std::string_view rest_;
};

std::size_t write_fields(const Sample& sample, std::uint32_t fields, std::span<char, measurement_csv_row_max> row,
                         bool with_inclination, int digits) noexcept {
  const auto carried = [&](Measurement::Field field) { return (fields & field) != 0; };
  RowWriter writer(row, digits);
  writer.field(carried(Measurement::time), sample.stamp().ns);
  writer.field(carried(Measurement::counter), sample.counter);
  for (const auto& [field, vector] : measured_vectors)
    for (const double component : sample.*vector) writer.field(carried(field) && !std::isnan(component), component);
  writer.field(carried(Measurement::temperature), sample.temperature_c);
  writer.field(carried(Measurement::status), sample.status, with_inclination ? ',' : '\n');
  if (!with_inclination) return writer.length();
  const Vector3 inclination = sample.inclination.value_or(Vector3::Zero());
  for (int axis = 0; axis < 3; ++axis)
    writer.field(sample.inclination.has_value(), inclination[axis], axis < 2 ? ',' : '\n');
  return writer.length();
}

}  // namespace

std::size_t write_measurement_csv(const Measurement& measurement, std::span<char, measurement_csv_row_max> row,
                                  bool with_inclination, int digits) noexcept {
  return write_fields(measurement.sample, measurement.fields, row, with_inclination, digits);
}

std::size_t write_measurement_csv(const Sample& sample, std::span<char, measurement_csv_row_max> row,
                                  bool with_inclination, int digits) noexcept {
  return write_fields(sample, Measurement::all, row, with_inclination, digits);
}

bool read_measurement_csv(std::string_view row, Measurement& measurement) noexcept {
  measurement = {};
  Sample& sample = measurement.sample;
  RowReader reader(row);
  const auto carry = [&](bool carried, Measurement::Field field) { measurement.fields |= carried ? field : 0U; };
  const auto read = [&reader](Vector3& vector) {
    int components = 0;
    for (double& component : vector) {
      const bool has_value = reader.field(component);
      if (!has_value) component = std::numeric_limits<double>::quiet_NaN();
      components += has_value ? 1 : 0;
    }
    return components;
  };
  carry(reader.field(sample.time.ns), Measurement::time);
  carry(reader.field(sample.counter), Measurement::counter);
  for (const auto& [field, vector] : measured_vectors) {
    const bool is_carried = read(sample.*vector) != 0;
    if (!is_carried) (sample.*vector).setZero();
    carry(is_carried, field);
  }
  carry(reader.field(sample.temperature_c), Measurement::temperature);
  carry(reader.field(sample.status), Measurement::status);
  if (reader.good && !reader.at_end()) {
    Vector3 inclination;
    const int components = read(inclination);
    if (components != 0 && components != 3) return false;
    if (components == 3) sample.inclination = inclination;
  }
  return reader.good && reader.at_end();
}

}  // namespace imud
