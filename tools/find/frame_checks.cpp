#include "tools/find/frame_checks.hpp"

#include <algorithm>

#include "protocols/frames/layout/frame_number.hpp"
#include "tools/checks/check_rule.hpp"

namespace imud {

FrameChecks::FrameChecks(const FoundMessage& message) {
  for (const FoundCheck& check : message.checks) {
    const FoundCheck::Form& form = check.forms.front();
    std::vector<FrameDescription::Check> own;
    if (form.own) own.push_back({"own", *form.own});
    const auto known = FrameCheck::find(form.own ? "own" : form.name, own);
    are_known_ = are_known_ && known;
    if (known) checks_.push_back({*known, check.ranges_of(form), form.extra, check.at, check.size, check.is_big});
  }
}

bool FrameChecks::hold(std::span<const std::byte> frame) const {
  return are_known_ && std::ranges::all_of(checks_, [frame](const Check& one) {
           return (one.check.of(frame, one.ranges, one.extra, one.is_big) &
                   low_bits(static_cast<unsigned>(8 * one.size))) == number_at(frame, one.at, one.size, one.is_big);
         });
}

}  // namespace imud
