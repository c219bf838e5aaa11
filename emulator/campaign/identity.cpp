#include <fmt/format.h>
#include <sha256.h>
#include <sys/stat.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>
#include <string_view>
#include <tuple>

#include "emulator/campaign/campaign.hpp"
#include "emulator/config/config_text.hpp"
#include "emulator/ground/text_file.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

// The SHA-256 of files, in hexadecimal. Any thread may call it.
class FileDigests {
 public:
  // Throws OpenError.
  std::string of(const std::string& path) {
    struct stat now {};
    if (::stat(path.c_str(), &now) != 0) throw OpenError(fmt::format("{}: {}", path, std::strerror(errno)));
    const Version version{now.st_dev, now.st_ino, now.st_size, now.st_mtim.tv_sec, now.st_mtim.tv_nsec};
    const std::lock_guard lock(mutex_);
    Known& known = known_[path];
    if (known.digest.empty() || known.version != version) {
      std::array<char, SHA256_DIGEST_STRING_LENGTH> text;
      if (SHA256File(path.c_str(), text.data()) == nullptr)
        throw OpenError(fmt::format("{}: {}", path, std::strerror(errno)));
      known = {version, text.data()};
    }
    return known.digest;
  }

 private:
  using Version = std::tuple<dev_t, ino_t, off_t, time_t, long>;
  struct Known {
    Version version;
    std::string digest;
  };
  std::mutex mutex_;
  std::map<std::string, Known> known_;
};

bool is_file_at(const std::string& path) {
  struct stat file {};
  return ::stat(path.c_str(), &file) == 0 && S_ISREG(file.st_mode);
}

FileDigests& file_digests() {
  static FileDigests digests;
  return digests;
}

// Returns the text of a port of truth with the path replaced by the digest of the file.
std::string with_digest(const std::string& port) {
  const Transport* transport = transport_of(port);
  if (transport == nullptr || !transport->has_path) return port;
  const std::size_t begin = transport->name.size() + 1;
  const std::size_t end = std::min(port.find('?'), port.size());
  return port.substr(0, begin) + file_digests().of(port.substr(begin, end - begin)) + port.substr(end);
}

// Returns the settings behind "?" in the text of an imu's port. No case opens this port, so that only these count.
std::string settings_of(const std::string& port) { return port.substr(std::min(port.find('?'), port.size())); }

// Replaces the path of each file by the file's digest.
void replace_paths(toml::node& node, std::string_view key, bool is_truth) {
  if (auto* table = node.as_table())
    for (auto&& [name, value] : *table) replace_paths(value, name.str(), is_truth || name == "truth");
  if (auto* array = node.as_array())
    for (toml::node& item : *array) replace_paths(item, key, is_truth);
  auto* text = node.as_string();
  if (text == nullptr) return;
  const bool is_port = key == "port" || key == "second_port" || key == "also";
  if (is_port) {
    *text = is_truth ? with_digest(text->get()) : settings_of(text->get());
  } else if (const bool may_be_path =
                 text->get().find('/') != std::string::npos || key.ends_with("_file") || key == "gnss_almanac";
             may_be_path && is_file_at(text->get())) {
    *text = file_digests().of(text->get());
  }
}

}  // namespace

std::string identity_without_seed(const Campaign& campaign, const Config& config) {
  toml::table all = toml::parse(config.resolved());
  all.erase("control");
  all.erase("web");
  all.erase("seed");
  replace_paths(all, "", false);
  std::string text = fmt::format("imud {} {}\n{}", IMUD_VERSION, campaign.build, toml_text(std::move(all)));
  if (campaign.test)
    text +=
        fmt::format("test {} {}\n{}\n", campaign.test->time_limit_s, campaign.test->settle_s, campaign.test->command);
  return sha256(text);
}

std::string capture_digest(const TruthConfig& truth) { return with_digest(truth.port); }

std::string identity_with_seed(const std::string& without_seed, std::uint64_t seed) {
  return sha256(fmt::format("{} seed {}", without_seed, seed));
}

std::string identity_of(const Campaign& campaign, const Config& config) {
  return identity_with_seed(identity_without_seed(campaign, config), config.seed);
}

std::string identity_of(const Campaign& campaign, const CampaignCase& c) {
  return identity_of(campaign, config_of(campaign, c));
}

}  // namespace imud
