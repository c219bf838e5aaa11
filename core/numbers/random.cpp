#include "core/numbers/random.hpp"

#include <Random123/philox.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <bit>
#include <cmath>

#include "core/numbers/elementary.hpp"
#include "core/numbers/normal_stock.hpp"

namespace imud {
namespace {

using Coefficients = std::array<double, 8>;  // c0 + c1 x + ... + c7 x^7

constexpr Coefficients central_numerator = {3.387132872796366608,  133.14166789178437745, 1971.5909503065514427,
                                            13731.693765509461125, 45921.953931549871457, 67265.770927008700853,
                                            33430.575583588128105, 2509.0809287301226727};
constexpr Coefficients central_denominator = {1.0,
                                              42.313330701600911252,
                                              687.1870074920579083,
                                              5394.1960214247511077,
                                              21213.794301586595867,
                                              39307.89580009271061,
                                              28729.085735721942674,
                                              5226.495278852545925};
constexpr Coefficients near_numerator = {1.42343711074968357734,   4.6303378461565452959,   5.7694972214606914055,
                                         3.64784832476320460504,   1.27045825245236838258,  0.24178072517745061177,
                                         0.0227238449892691845833, 7.7454501427834140764e-4};
constexpr Coefficients near_denominator = {1.0,
                                           2.05319162663775882187,
                                           1.6763848301838038494,
                                           0.68976733498510000455,
                                           0.14810397642748007459,
                                           0.0151986665636164571966,
                                           5.475938084995344946e-4,
                                           1.05075007164441684324e-9};
constexpr Coefficients far_numerator = {6.6579046435011037772,     5.4637849111641143699,    1.7848265399172913358,
                                        0.29656057182850489123,    0.026532189526576123093,  0.0012426609473880784386,
                                        2.71155556874348757815e-5, 2.01033439929228813265e-7};
constexpr Coefficients far_denominator = {1.0,
                                          0.59983220655588793769,
                                          0.13692988092273580531,
                                          0.0148753612908506148525,
                                          7.868691311456132591e-4,
                                          1.8463183175100546818e-5,
                                          1.4215117583164458887e-7,
                                          2.04426310338993978564e-15};

}  // namespace

namespace {

constexpr double central = 0.425;  // inverse_normal_cdf() is a function of p - 1/2 up to here

// inverse_normal_cdf() beyond `central`. Always inline, so that batches with AVX2 compute it with AVX2 instructions.
[[gnu::always_inline]] inline Lanes tail_of_normal(Lanes p) noexcept {
  using elementary::detail::polynomial;
  Lanes r = -elementary::log(select(p < 0.5, p, 1.0 - p));
  for (int i = 0; i < 4; ++i) r[i] = std::sqrt(r[i]);
  const Lanes near = r - 1.6;
  Lanes x = polynomial(near_numerator, near) / polynomial(near_denominator, near);
  for (int i = 0; i < 4; ++i)
    if (r[i] > 5.0) [[unlikely]]
      x[i] = polynomial(far_numerator, r[i] - 5.0) / polynomial(far_denominator, r[i] - 5.0);
  return select(p < 0.5, -x, x);
}

}  // namespace

double inverse_normal_cdf(double p) noexcept {
  using elementary::detail::polynomial;
  const double q = p - 0.5;
  if (std::abs(q) > central) return tail_of_normal(all_lanes(p))[0];
  const double r = 0.180625 - q * q;
  return q * polynomial(central_numerator, r) / polynomial(central_denominator, r);
}

std::uint32_t stream_id(std::string_view imu_name) noexcept {
  std::uint32_t hash = 2166136261U;  // FNV-1a
  for (const char c : imu_name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return hash;
}

namespace {

using Philox = r123::Philox4x32;

constexpr std::uint32_t low(std::uint64_t x) { return static_cast<std::uint32_t>(x); }
constexpr std::uint32_t high(std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32U); }

constexpr std::uint32_t purpose(Quantity quantity, Process process) {
  return static_cast<std::uint32_t>(process) << 8U | static_cast<std::uint32_t>(quantity) << 4U;
}

// uniform(), without a conversion from integer, which vector registers do not have: the bits of k + 2^52 are known.
double uniform_of_words(std::uint32_t word0, std::uint32_t word1) noexcept {
  const std::uint64_t bits = std::uint64_t{word1} << 32U | word0;
  const double k = std::bit_cast<double>(bits >> 12U | 0x4330'0000'0000'0000ULL) - 0x1p52;
  return (k + 0.5) * 0x1p-52;
}

}  // namespace

double Normals::uniform_of_axis(std::uint32_t purpose_and_axis, std::uint64_t k) const noexcept {
  const auto words = Philox{}({{low(k / 2), high(k / 2), purpose_and_axis, stream_}}, {{low(seed_), high(seed_)}});
  const std::size_t half = 2 * (k % 2);
  return uniform_of_words(words[half], words[half + 1]);
}

double Normals::uniform(Quantity quantity, Process process, std::uint64_t k) const noexcept {
  return uniform_of_axis(purpose(quantity, process), k);
}

namespace {

// Deviates holds one batch: all samples of x, then of y, then of z. One Philox counter gives two samples.
constexpr std::size_t per_axis = NormalBatch::samples / 2, counters = 3 * per_axis;
using Deviates = NormalBatch::Deviates;

Philox::key_type key_of(std::uint64_t seed) noexcept { return {{low(seed), high(seed)}}; }

// Turns uniform deviates into normal deviates. The first loop does the same for each deviate, so that a compiler can
// compute several at once.
[[gnu::always_inline]] inline void make_normal(Deviates& x) noexcept {
  using elementary::detail::polynomial;
  Deviates p = x;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double q = p[i] - 0.5;
    const double r = 0.180625 - q * q;
    x[i] = q * polynomial(central_numerator, r) / polynomial(central_denominator, r);
  }
  // Computes the deviates in the tails, four at once.
  std::array<std::uint8_t, std::tuple_size_v<Deviates> + 3> tails;
  std::size_t count = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    tails[count] = static_cast<std::uint8_t>(i);
    count += std::abs(p[i] - 0.5) > central ? 1 : 0;
  }
  if (count == 0) return;
  for (std::size_t i = count; i < count + 3; ++i) tails[i] = tails[0];
  for (std::size_t i = 0; i < count; i += 4) {
    const auto* const at = &tails[i];
    const Lanes tail = tail_of_normal(Lanes{p[at[0]], p[at[1]], p[at[2]], p[at[3]]});
    for (int j = 0; j < 4; ++j) x[at[j]] = tail[j];
  }
}

void compute_batch(const NormalBatch& batch, Deviates& deviates) noexcept {
  for (std::uint32_t i = 0; i < counters; ++i) {
    const std::uint64_t counter = batch.number * per_axis + i % per_axis;
    const std::uint32_t axis = i / per_axis;
    const auto words =
        Philox{}({{low(counter), high(counter), batch.purpose | axis, batch.stream}}, key_of(batch.seed));
    deviates[2 * i] = uniform_of_words(words[0], words[1]);
    deviates[2 * i + 1] = uniform_of_words(words[2], words[3]);
  }
  make_normal(deviates);
}

#if defined(__x86_64__)
// The same with the 256-bit registers of AVX2, each with four counters, a 32-bit word in each 64-bit lane, whose
// upper half has no meaning. Random123 has no such function.
[[gnu::target("avx2")]] inline __m256i all(std::uint32_t word) noexcept {
  return _mm256_set1_epi64x(std::int64_t{word});
}

[[gnu::target("avx2")]] inline __m256d uniform_of_words(__m256i word0, __m256i word1) noexcept {
  const __m256i bits = _mm256_blend_epi32(word0, _mm256_slli_epi64(word1, 32), 0b10101010);
  const __m256i k = _mm256_or_si256(_mm256_srli_epi64(bits, 12), _mm256_set1_epi64x(0x4330'0000'0000'0000));
  const __m256d exact = _mm256_sub_pd(_mm256_castsi256_pd(k), _mm256_set1_pd(0x1p52));
  return _mm256_mul_pd(_mm256_add_pd(exact, _mm256_set1_pd(0.5)), _mm256_set1_pd(0x1p-52));
}

struct Counters {
  __m256i word0, word1, word2, word3;
};

[[gnu::target("avx2")]] inline void apply_philox(Philox::key_type key, Counters& c) noexcept {
  for (int round = 0; round < 10; ++round, key[0] += PHILOX_W32_0, key[1] += PHILOX_W32_1) {
    const __m256i product0 = _mm256_mul_epu32(c.word0, all(PHILOX_M4x32_0));
    const __m256i product1 = _mm256_mul_epu32(c.word2, all(PHILOX_M4x32_1));
    c.word0 = _mm256_xor_si256(_mm256_xor_si256(_mm256_srli_epi64(product1, 32), c.word1), all(key[0]));
    c.word1 = product1;
    c.word2 = _mm256_xor_si256(_mm256_xor_si256(_mm256_srli_epi64(product0, 32), c.word3), all(key[1]));
    c.word3 = product0;
  }
}

[[gnu::target("avx2")]] void compute_batch_avx2(const NormalBatch& batch, Deviates& deviates) noexcept {
  static_assert(per_axis % 4 == 0);
  for (std::uint32_t i = 0; i < counters; i += 4) {
    // A multiple of 4: no carry within the four.
    const std::uint64_t counter = batch.number * per_axis + i % per_axis;
    Counters c = {_mm256_add_epi64(all(low(counter)), _mm256_set_epi64x(3, 2, 1, 0)), all(high(counter)),
                  all(batch.purpose | i / static_cast<std::uint32_t>(per_axis)), all(batch.stream)};
    apply_philox(key_of(batch.seed), c);
    const __m256d even = uniform_of_words(c.word0, c.word1), odd = uniform_of_words(c.word2, c.word3);
    const __m256d low_pairs = _mm256_unpacklo_pd(even, odd), high_pairs = _mm256_unpackhi_pd(even, odd);
    _mm256_storeu_pd(&deviates[2 * i], _mm256_permute2f128_pd(low_pairs, high_pairs, 0x20));
    _mm256_storeu_pd(&deviates[2 * i + 4], _mm256_permute2f128_pd(low_pairs, high_pairs, 0x31));
  }
  make_normal(deviates);
}

// Turns the uniform deviates of three axes into normal deviates, as inverse_normal_cdf() does.
[[gnu::always_inline]] inline void make_three_normal(std::array<double, 4>& x) noexcept {
  using elementary::detail::polynomial;
  const auto p = std::bit_cast<Lanes>(x);
  const Lanes q = p - 0.5, r = 0.180625 - q * q;
  Lanes normal = q * polynomial(central_numerator, r) / polynomial(central_denominator, r);
  const LaneMask is_tail = magnitude(q) > central;
  if ((is_tail[0] | is_tail[1] | is_tail[2]) != 0) normal = select(is_tail, tail_of_normal(p), normal);
  x = std::bit_cast<std::array<double, 4>>(normal);
}

// The three axes of sample k of the batch's stream.
[[gnu::target("avx2")]] Vector3 compute_one_avx2(const NormalBatch& batch, std::uint64_t k) noexcept {
  const __m256i axes = _mm256_or_si256(all(batch.purpose), _mm256_set_epi64x(2, 2, 1, 0));
  Counters c = {all(low(k / 2)), all(high(k / 2)), axes, all(batch.stream)};
  apply_philox(key_of(batch.seed), c);
  std::array<double, 4> deviates;
  _mm256_storeu_pd(deviates.data(),
                   k % 2 == 0 ? uniform_of_words(c.word0, c.word1) : uniform_of_words(c.word2, c.word3));
  make_three_normal(deviates);
  return {deviates[0], deviates[1], deviates[2]};
}
#endif

}  // namespace

Vector3 Normals::operator()(Quantity quantity, Process process, std::uint64_t k) const noexcept {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2"))
    return compute_one_avx2(
        {.seed = seed_, .stream = stream_, .purpose = purpose(quantity, process), .number = k / NormalBatch::samples},
        k);
#endif
  Vector3 n;
  for (std::uint32_t axis = 0; axis < 3; ++axis)
    n[axis] = inverse_normal_cdf(uniform_of_axis(purpose(quantity, process) | axis, k));
  return n;
}

void NormalBatch::compute(Deviates& deviates) const noexcept {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return compute_batch_avx2(*this, deviates);
#endif
  compute_batch(*this, deviates);
}

void NormalSequence::compute(const Normals& normals, std::uint64_t number) noexcept {
  number_ = number;
  const NormalBatch wanted = {
      .seed = normals.seed_, .stream = normals.stream_, .purpose = purpose(quantity_, process_), .number = number};
  if (stock_ == nullptr || !stock_->take(wanted, deviates_)) wanted.compute(deviates_);
}

}  // namespace imud
