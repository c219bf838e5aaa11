#include "transports/uart/pty_access.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "core/numbers/number_text.hpp"

namespace imud {

PtyAccess::PtyAccess(const PortSpec& spec) {
  constexpr mode_t owner_rw = S_IRUSR | S_IWUSR, all_rw = 0666;
  if (const auto text = spec.text("mode")) {
    mode_ = number_in<mode_t>(*text, 8);
    if (!mode_ || (*mode_ & owner_rw) != owner_rw || (*mode_ & ~all_rw) != 0)
      throw spec.error(fmt::format("mode={}: right would be an octal number from 0600 to 0666, such as 0660", *text));
  }
  if (const auto text = spec.text("owner")) {
    owner_ = number_in<uid_t>(*text);
    if (const passwd* user = ::getpwnam(text->c_str())) owner_ = user->pw_uid;
    if (!owner_) throw spec.error(fmt::format("owner={}: there is no such user; 'getent passwd' lists them", *text));
  }
  if (const auto text = spec.text("group")) {
    group_ = number_in<gid_t>(*text);
    if (const group* named = ::getgrnam(text->c_str())) group_ = named->gr_gid;
    if (!group_) throw spec.error(fmt::format("group={}: there is no such group; 'getent group' lists them", *text));
  }
}

int PtyAccess::apply(int slave) const noexcept {
  constexpr uid_t same_owner = static_cast<uid_t>(-1);
  constexpr gid_t same_group = static_cast<gid_t>(-1);
  if (owner_ || group_)
    if (::fchown(slave, owner_.value_or(same_owner), group_.value_or(same_group)) != 0) return errno;
  if (mode_ && ::fchmod(slave, *mode_) != 0) return errno;
  return 0;
}

PortError PtyAccess::refusal(const PortSpec& spec, int error) {
  return spec.error(
      fmt::format("cannot set mode, owner or group: {}{}", std::strerror(error),
                  error == EPERM ? "; without root, right would be a group that this process belongs to" : ""));
}

}  // namespace imud
