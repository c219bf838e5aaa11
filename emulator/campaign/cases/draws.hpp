// CampaignDraws: values of keys that are drawn. A value is a pure function of the seed, the key and the draw's
// number, and, with a Latin hypercube, of how many draws there are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "emulator/campaign/cases/distribution.hpp"

namespace imud {

enum class DrawMethod : std::uint8_t {
  random,           // each draw is independent of the others
  latin_hypercube,  // each of `count` equally probable strata of a key has one draw
};

inline constexpr auto draw_method_words = std::to_array<Word<DrawMethod>>(
    {{DrawMethod::random, "random"}, {DrawMethod::latin_hypercube, "latin_hypercube"}});

struct DrawPlan {
  static constexpr std::uint64_t most = 1'000'000;  // draws
  std::uint64_t count = 0, seed = 1;
  DrawMethod method = DrawMethod::random;
};

// A key with its draws.
class DrawnKey {
 public:
  DrawnKey(std::string key, Distribution distribution, const DrawPlan& plan);

  const std::string& key() const noexcept { return key_; }
  // Returns the value of a draw as TOML: a number in its shortest exact form, or a list of such numbers.
  std::string text(std::uint64_t draw) const;
  // Returns how many numbers a draw has: the length of a list, or 1.
  std::size_t size() const noexcept { return streams_.size(); }
  // Returns the share of the distribution's values that are below the draw's value: uniform in (0, 1). Each component
  // of a list has its own share.
  double share(std::uint64_t draw, std::size_t component) const noexcept;

 private:
  std::string key_;
  Distribution distribution_;
  DrawPlan plan_;
  std::vector<std::uint32_t> streams_;  // of random numbers, by component
  // The stratum of each draw, by component; empty unless the method is latin_hypercube.
  std::vector<std::shared_ptr<const std::vector<std::uint32_t>>> strata_;
};

struct CampaignDraws {
  DrawPlan plan;
  std::vector<DrawnKey> keys;  // in the order of the plan
  std::uint32_t line = 0;      // in the plan
};

}  // namespace imud
