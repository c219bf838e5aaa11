// WebAccess: whose requests the web server answers.
#pragma once

#include <string>
#include <string_view>

#include "emulator/control/token.hpp"

namespace imud {

// Returns true if no page of another site can have made a browser send this value of Host: an address, `localhost`,
// or the name of this machine. Any other name may be given any address at any time (DNS rebinding), so that the
// browser takes imud for that site. The port may be another one, because ports can be forwarded.
bool is_own_host(std::string_view host, std::string_view machine);

// Returns true if the request comes from a page that was loaded from `host`, or from a program that is no browser and
// sends no Origin.
bool is_own_origin(std::string_view origin, std::string_view host);

// The token in the header Authorization: as `Bearer TOKEN`, or as `Basic`, which browsers ask for, as the password of
// the user `imud`.
class WebToken {
 public:
  explicit WebToken(const std::string& secret);
  // Takes a time that does not depend on how much of the token is right.
  bool is_in(std::string_view authorization) const noexcept;

 private:
  Token bearer_, basic_;  // the whole header
};

}  // namespace imud
