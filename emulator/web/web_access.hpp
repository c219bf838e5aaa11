// WebAccess: whose requests the web server answers.
#pragma once

#include <string>
#include <string_view>

#include "emulator/control/token.hpp"

namespace imud {

// Returns true if no page of another site can have made a browser send this value of Host: an address,
// `localhost`, or the name of this machine. The owner of any other name can make the name lead to this machine
// (DNS rebinding); the browser would then take imud for that owner's site. The port is not compared, because ports
// can be forwarded.
bool is_own_host(std::string_view host, std::string_view machine);

// Returns true if the request comes from a page that was loaded from `host`, or from a program that is no browser and
// sends no Origin.
bool is_own_origin(std::string_view origin, std::string_view host);

// Checks the token in the header Authorization: `Bearer TOKEN`, or `Basic` with the user `imud` and the token as
// the password, for which browsers ask.
class WebToken {
 public:
  explicit WebToken(const std::string& secret);
  // Returns true if the header has the token. The duration does not depend on how much of the token is right.
  bool is_in(std::string_view authorization) const noexcept;

 private:
  Token bearer_, basic_;  // the whole header
};

}  // namespace imud
