#include "emulator/plan/expect_config.hpp"

#include <fmt/format.h>

namespace imud {

std::string ExpectConfig::text() const {
  const std::string bytes = text_of(pattern);
  std::string text;
  switch (what) {
    case What::host_sends:
      text = fmt::format("the host of {} sends {} within {:g} s", imu, bytes, within_s);
      break;
    case What::host_is_silent:
      text = fmt::format("the host of {} does not send {} for {:g} s", imu, bytes, within_s);
      break;
    case What::host_reopens:
      text = fmt::format("the host of {} reopens its port within {:g} s", imu, within_s);
      break;
  }
  if (fault_name.empty()) return text + fmt::format(", from {:g} s", at_s);
  return text + fmt::format(", from the {} of fault {}", after_end ? "end" : "begin", fault_name);
}

}  // namespace imud
