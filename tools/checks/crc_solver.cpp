#include "tools/checks/crc_solver.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "protocols/frames/layout/frame_layout.hpp"
#include "protocols/wire/bits.hpp"
#include "tools/checks/check_rule.hpp"

namespace imud {
namespace {

using Piece = std::span<const std::byte>;

// A polynomial over GF(2); bit i of word j is the coefficient of x^(64 j + i).
class Polynomial {
 public:
  explicit Polynomial(std::size_t bits) : words_((bits + 63) / 64) {}

  void flip(std::size_t power) { words_[power / 64] ^= std::uint64_t{1} << power % 64; }
  // Returns the degree; nullopt for 0.
  std::optional<std::size_t> degree() const {
    for (std::size_t i = words_.size(); i > 0; --i)
      if (words_[i - 1] != 0) return 64 * (i - 1) + 63 - static_cast<std::size_t>(std::countl_zero(words_[i - 1]));
    return std::nullopt;
  }
  std::uint64_t low() const { return words_.front(); }

  // Replaces this by the remainder of its division by `divisor`. Requires a divisor other than 0.
  void reduce(const Polynomial& divisor) {
    const std::size_t last = *divisor.degree();
    while (true) {
      const auto own = degree();
      if (!own || *own < last) return;
      const std::size_t shift = *own - last, words = shift / 64, bits = shift % 64;
      for (std::size_t i = last / 64 + 1; i > 0; --i) {
        const std::uint64_t word = divisor.words_[i - 1];
        words_[i - 1 + words] ^= word << bits;
        if (bits != 0 && i + words < words_.size()) words_[i + words] ^= word >> (64 - bits);
      }
    }
  }
  // Divides by x as often as possible, because a generator is odd.
  void remove_powers() {
    const auto last = degree();
    if (!last) return;
    std::size_t zeros = 0;
    while ((words_[zeros / 64] >> zeros % 64 & 1U) == 0) ++zeros;
    if (zeros == 0) return;
    Polynomial shifted(64 * words_.size());
    for (std::size_t power = zeros; power <= *last; ++power)
      if ((words_[power / 64] >> power % 64 & 1U) != 0) shifted.flip(power - zeros);
    *this = std::move(shifted);
  }

 private:
  std::vector<std::uint64_t> words_;
};

Polynomial common_divisor(Polynomial a, Polynomial b) {
  while (b.degree()) {
    a.reduce(b);
    std::swap(a, b);
  }
  return a;
}

// Returns D x^width + C of two frames.
Polynomial difference(Piece one, Piece other, const CrcPlace& place, bool refin, bool refout) {
  const std::size_t width = 8 * place.size, count = place.range.second - place.range.first;
  Polynomial result(8 * count + width);
  std::size_t power = 8 * count + width;
  for (std::size_t i = place.range.first; i < place.range.second; ++i) {
    const auto byte = std::to_integer<unsigned>(one[i] ^ other[i]);
    for (unsigned bit = 0; bit < 8; ++bit) {
      --power;
      if ((byte >> (refin ? bit : 7 - bit) & 1U) != 0) result.flip(power);
    }
  }
  const std::uint64_t crc =
      number_at(one, place.at, place.size, place.is_big) ^ number_at(other, place.at, place.size, place.is_big);
  for (std::size_t bit = 0; bit < width; ++bit)
    if ((crc >> (refout ? width - 1 - bit : bit) & 1U) != 0) result.flip(bit);
  return result;
}

}  // namespace

std::optional<CrcParameters> find_polynomial(std::span<const Piece> frames, const CrcPlace& place, bool refin,
                                             bool refout) {
  const std::size_t width = 8 * place.size;
  constexpr std::size_t differences = 8;  // that a generator divides; by chance, a factor of degree d in 2^-8d cases
  for (std::size_t attempt = 0; attempt < 6; ++attempt) {
    const std::size_t begin = 2 * differences * attempt;
    if (begin + 2 * differences > frames.size()) break;
    std::optional<Polynomial> divisor;
    for (std::size_t i = 0; i < differences; ++i) {
      Polynomial next = difference(frames[begin + 2 * i], frames[begin + 2 * i + 1], place, refin, refout);
      if (!next.degree()) continue;
      divisor = divisor ? common_divisor(std::move(*divisor), std::move(next)) : std::move(next);
      if (*divisor->degree() < width) break;
    }
    if (!divisor) continue;
    divisor->remove_powers();
    if (divisor->degree() != width) continue;
    CrcParameters found;
    found.width = static_cast<unsigned>(width);
    found.poly = divisor->low() & low_bits(found.width);
    found.refin = refin;
    found.refout = refout;
    return found;
  }
  return std::nullopt;
}

std::uint64_t initial_value(const CrcParameters& parameters, Piece bytes, std::size_t zeros, std::uint64_t crc) {
  const unsigned width = parameters.width;
  std::uint64_t state = (crc ^ parameters.xorout) & low_bits(width);
  if (parameters.refin != parameters.refout) state = reflected(state, width);
  // The register runs backwards; unreflected, for both kinds.
  if (parameters.refin) state = reflected(state, width);
  const auto undo = [&](unsigned byte) {
    for (int bit = 0; bit < 8; ++bit) {
      const bool was_high = (state & 1U) != 0;
      if (was_high) state ^= parameters.poly;
      state >>= 1;
      if (was_high) state |= std::uint64_t{1} << (width - 1);
    }
    if (parameters.refin) byte = static_cast<unsigned>(reflected(byte, 8));
    state ^= std::uint64_t{byte} << (width - 8);
  };
  for (std::size_t i = 0; i < zeros; ++i) undo(0);
  for (std::size_t i = bytes.size(); i > 0; --i) undo(std::to_integer<unsigned>(bytes[i - 1]));
  return state;
}

std::optional<CrcParameters> solve_initial(const CrcParameters& parameters, const CrcExample& one,
                                           const CrcExample& other) {
  // A CRC is A init + B xorout + K, with A by its length. Bits of the initial value are columns of A, by trial.
  const unsigned width = parameters.width;
  const auto crc_of = [&](const CrcExample& example, std::uint64_t init) {
    CrcParameters with = parameters;
    with.init = init;
    with.xorout = 0;
    const Crc crc(with);
    return crc.finish(crc.update(crc.start(), example.bytes));
  };
  const std::uint64_t one_without = crc_of(one, 0), other_without = crc_of(other, 0);
  // (A1 + A2) init = K1 + K2, by elimination: rows are the bits of the CRC.
  std::uint64_t wanted = one.crc ^ other.crc ^ one_without ^ other_without;
  std::array<std::uint64_t, 64> columns{}, made{};
  for (unsigned i = 0; i < width; ++i) {
    columns[i] =
        crc_of(one, std::uint64_t{1} << i) ^ one_without ^ crc_of(other, std::uint64_t{1} << i) ^ other_without;
    made[i] = std::uint64_t{1} << i;
  }
  std::uint64_t init = 0;
  for (unsigned i = 0; i < width; ++i) {
    const unsigned pivot = static_cast<unsigned>(
        std::find_if(columns.begin() + i, columns.begin() + width, [](std::uint64_t c) { return c != 0; }) -
        columns.begin());
    if (pivot >= width) break;  // the remaining bits of the initial value are free: x + 1 divides many generators
    std::swap(columns[i], columns[pivot]);
    std::swap(made[i], made[pivot]);
    const std::uint64_t bit = std::bit_floor(columns[i]);
    for (unsigned j = i + 1; j < width; ++j)
      if ((columns[j] & bit) != 0) {
        columns[j] ^= columns[i];
        made[j] ^= made[i];
      }
    if ((wanted & bit) != 0) {
      wanted ^= columns[i];
      init ^= made[i];
    }
  }
  if (wanted != 0) return std::nullopt;
  CrcParameters solved = parameters;
  solved.init = init;
  solved.xorout = one.crc ^ crc_of(one, init);
  return solved;
}

}  // namespace imud
