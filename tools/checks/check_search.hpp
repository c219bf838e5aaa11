// CheckSearch: finds the checks of frames, and the ranges of bytes that each check covers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/wire/crc.hpp"
#include "tools/checks/check_rule.hpp"

namespace imud {

// A byte is constant if it is the same in this share of the frames; the rest is damage.
inline constexpr double constant_share = 0.97;
// A check covers the whole frame if its ranges contain at least this share of the bytes that vary.
inline constexpr double whole_share = 0.85;

// A check, and all of its forms that agree with the same frames.
struct FoundCheck {
  struct Form {
    std::string name;              // for FrameCheck; empty: `own`
    std::size_t begin = 0;         // of the first range
    std::vector<std::byte> extra;  // bytes that follow the ranges and are not sent
    std::optional<CrcParameters> own = {};
    // Returns true if `extra` has more than zeros.
    bool has_constant() const;
  };
  std::vector<Form> forms;       // at least one; the most probable first
  std::size_t at = 0, size = 1;  // bytes
  bool is_big = false;
  std::vector<FrameCheck::Range> ranges;   // [begin, end); the first range begins where the form says
  std::size_t agreeing = 0, compared = 0;  // frames
  double chance_log2 = 0;                  // of a match by chance, given all that was tried
  std::size_t deciding = 0;                // distinct frames from which on such a chance is below 1 in 1000
  double share = 0;                        // share of the varying bytes of a frame that are in the ranges

  // Returns true if the check covers the whole frame and is no accidental relation of data: a sum has no constant
  // that fits.
  bool is_whole() const;
  // Returns the check's ranges with this form.
  std::vector<FrameCheck::Range> ranges_of(const Form& form) const;
};

// The windows are pieces of the stream of equal size, at the same place before or in the frames, and in their order.
class CheckSearch {
 public:
  using Window = std::span<const std::byte>;

  // `length`: bytes of a frame, no more than a window has.
  CheckSearch(std::vector<Window> windows, std::size_t length);

  // Searches checks of all known families. A range, with its check, is no longer than a frame, and ends after
  // `first_end` bytes of the window.
  enum class Place : std::uint8_t {
    behind_range,  // the check follows its range
    before_range,  // the check stands before its range, or near the beginning of the range
  };
  std::vector<FoundCheck> find(Place place, std::size_t first_end) const;
  // Searches CRCs of 8 to 32 bits with a polynomial that is in no catalogue, that cover all other bytes of a frame
  // and are followed by a constant byte.
  std::vector<FoundCheck> find_unknown(std::size_t first_end) const;

  // Returns the same check in these frames if a check of frames of another length holds here, too: it begins at
  // the same place before the frame, and ends as far from the frame's end.
  std::optional<FoundCheck> adopted(FoundCheck check, std::size_t other_length) const;

  // Returns true if a byte of the window is the same in nearly all frames.
  bool is_constant(std::size_t at) const { return !varies_[at]; }

 private:
  struct Candidate {
    const CheckRule* rule = nullptr;
    std::vector<FrameCheck::Range> ranges;
    std::size_t at = 0;
    bool is_big = false;
  };
  void before_pair(const std::vector<CheckRule>& rules, std::size_t first_end, std::size_t pair,
                   std::vector<Candidate>& found) const;
  void after_pair(const std::vector<CheckRule>& rules, std::size_t first_end, std::size_t pair,
                  std::vector<Candidate>& found) const;
  bool holds(const Candidate& candidate) const;
  // Returns the check of a candidate; nullopt if there is too little evidence for it.
  std::optional<FoundCheck> resolved(const Candidate& candidate, double tried_log2) const;
  void find_forms(const Candidate& candidate, FoundCheck& check) const;
  void find_own_forms(const Candidate& candidate, FoundCheck& check) const;
  // Returns the first byte at which a frame may begin that ends with the check and its ranges.
  std::size_t frame_begin(const FoundCheck& check) const;
  std::size_t agreeing(const FoundCheck& check, const FoundCheck::Form& form) const;
  std::size_t varying_in(std::size_t begin, std::size_t end) const;
  std::vector<FoundCheck> chosen(std::vector<FoundCheck> found) const;

  std::vector<Window> windows_;
  std::size_t length_;
  std::vector<bool> varies_;
  std::vector<std::size_t> starts_;  // where a range may begin: at bytes that vary
};

}  // namespace imud
