#include "core/earth/igrf.hpp"

#include <algorithm>
#include <cstddef>

namespace imud {
namespace {

constexpr double first_epoch = 2000.0, between_epochs = 5.0;  // years
constexpr std::size_t epochs = 6;

// One line of the published table.
struct Line {
  char kind;  // g or h
  int degree, order;
  double at[epochs];  // nT, at 2000, 2005, ..., 2025
  double yearly;      // nT/year, predicted secular variation from 2025 to 2030
};

// The columns 2000.0 to 2025.0 and 2025-30 of igrf14coeffs.txt, as IAGA published it for IGRF-14 in 2024
// (https://www.ngdc.noaa.gov/IAGA/vmod/coeffs/igrf14coeffs.txt, SHA-256 8f8d8840...d6b0903c). 2000 to 2020 are
// definitive. The copy in zzyztyy/pyIGRF (89d2f50) and IGRF14.shc in ESA-VirES/MagneticModel (2e72687), both read in
// November 2026, agree in every number.
constexpr Line lines[] = {
#include "core/earth/igrf14.inc"
};
static_assert(std::size(lines) == MagneticField::max_degree * (MagneticField::max_degree + 2));

}  // namespace

std::vector<GaussCoefficients> igrf14(double year) {
  const double interval = std::clamp((year - first_epoch) / between_epochs, 0.0, epochs - 1.0);
  const auto epoch = static_cast<std::size_t>(interval);
  const double years = year - (first_epoch + between_epochs * static_cast<double>(epoch));
  std::vector<GaussCoefficients> all;
  for (const Line& line : lines) {
    const double yearly = epoch + 1 == epochs ? line.yearly : (line.at[epoch + 1] - line.at[epoch]) / between_epochs;
    const double value = line.at[epoch] + years * yearly;
    if (line.kind == 'g')
      all.push_back({line.degree, line.order, value, 0.0});
    else
      all.back().h = value;  // it follows the g of its degree and order
  }
  return all;
}

}  // namespace imud
