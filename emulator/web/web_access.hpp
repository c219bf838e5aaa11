// WebAccess: whose requests the web server answers.
#pragma once

#include <string_view>

namespace imud {

// Returns true if no page of another site can have made a browser send this value of Host: an address, `localhost`,
// or the name of this machine. Any other name may be given any address at any time (DNS rebinding), so that the
// browser takes imud for that site. The port may be another one, because ports can be forwarded.
bool is_own_host(std::string_view host, std::string_view machine);

// Returns true if the request comes from a page that was loaded from `host`, or from a program that is no browser and
// sends no Origin.
bool is_own_origin(std::string_view origin, std::string_view host);

// Returns true if the header Authorization has the token: as `Bearer TOKEN`, or as `Basic`, which browsers ask for,
// as the password of the user `imud`. The time that it takes does not depend on how much of the token is right.
bool has_token(std::string_view authorization, std::string_view token);

}  // namespace imud
