#include "emulator/campaign/shards/result_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

using Json = nlohmann::ordered_json;

Json json_of(const ArrayShape& arrays) {
  Json dimensions = Json::array();
  for (const ArrayShape::Dimension& one : arrays.dimensions) {
    Json dimension = {{"name", one.name}};
    if (!one.values.empty())
      dimension["values"] = one.values;
    else
      dimension.update({{"first", one.first}, {"count", one.count}});
    dimensions.push_back(std::move(dimension));
  }
  return {{"rows", arrays.rows}, {"imus", arrays.imus}, {"dimensions", std::move(dimensions)}};
}

ArrayShape arrays_of(const Json& json) {
  ArrayShape arrays{.rows = json.at("rows"), .imus = json.at("imus")};
  for (const Json& one : json.at("dimensions"))
    arrays.dimensions.push_back({.name = one.at("name"),
                                 .values = one.value("values", std::vector<std::string>()),
                                 .first = one.value("first", std::uint64_t{0}),
                                 .count = one.value("count", std::uint64_t{0})});
  return arrays;
}

std::string text_of(const CampaignDescription& campaign, const std::filesystem::path& folder) {
  std::error_code error;
  const std::filesystem::path from_folder = std::filesystem::relative(campaign.plan, folder, error);
  Json json = {{"campaign", 1},
               {"plan", campaign.plan},
               {"plan_from_folder", error ? std::string() : from_folder.string()},
               {"plan_sha256", campaign.plan_sha256},
               {"cases", campaign.cases},
               {"batch", campaign.batch},
               {"version", campaign.version},
               {"build", campaign.build}};
  if (!campaign.until.empty()) json["until"] = campaign.until;
  if (campaign.arrays.rows > 0) json["arrays"] = json_of(campaign.arrays);
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// Nobody can ask another host whether a process runs: its file counts for a day.
bool is_left_behind(const std::filesystem::path& file, const TemporaryFile& name) {
  if (name.is_left_behind()) return true;
  constexpr std::chrono::hours longest(24);
  std::error_code error;
  const auto written = std::filesystem::last_write_time(file, error);
  return !error && std::filesystem::file_time_type::clock::now() - written > longest;
}

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Returns the first line in which two texts differ: "line 3 is X there and Y here".
std::string first_difference(const std::string& there, const std::string& here) {
  const auto next = [](const std::string& text, std::size_t& at) {
    const std::size_t begin = std::min(at, text.size()), end = std::min(text.find('\n', begin), text.size());
    at = end + 1;
    return text.substr(begin, end - begin);
  };
  std::size_t a = 0, b = 0;
  for (std::size_t line = 1; a < there.size() || b < here.size(); ++line) {
    const std::string old = next(there, a), now = next(here, b);
    if (old != now) return fmt::format("line {} of the plan is `{}` there and `{}` here", line, old, now);
  }
  return "the plans have the same lines";
}

}  // namespace

CaseRange CampaignDescription::shard_of(std::uint64_t index) const noexcept {
  const std::uint64_t first = index / batch * batch;
  return {first, std::min(first + batch, cases) - 1};
}

std::string CampaignDescription::difference_of_imud(const std::string& other_version,
                                                    const std::string& other_build) const {
  if (version != other_version) return fmt::format("imud is {} there and {} here", version, other_version);
  if (build == other_build) return {};
  return fmt::format("imud {} is {} there and build {} here", version,
                     build.empty() ? "of a build that is not stored" : "build " + build, other_build);
}

ResultFolder::ResultFolder(const std::filesystem::path& path) : path_(path) { read_description(); }

bool ResultFolder::is_at(const std::filesystem::path& path) {
  return ::access((path / "campaign.json").c_str(), F_OK) == 0;
}

ResultFolder::ResultFolder(const std::filesystem::path& path, const CampaignDescription& campaign,
                           std::string_view plan_text)
    : path_(path) {
  try {
    std::filesystem::create_directories(shards_path());
    check_writable();
    write_once(path_ / "campaign.json", text_of(campaign, path_));
    read_description();
    require_same(campaign, plan_text);
    keep_plan(plan_text);
  } catch (const std::filesystem::filesystem_error& error) {
    throw OpenError(fmt::format("{}: {}", shards_path().string(), error.code().message()));
  } catch (const OpenError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw OpenError(error.what());
  }
}

std::string ResultFolder::resume_command() const { return "imud campaign resume " + path_word(path_.string()); }

std::string ResultFolder::repeat_command(std::uint64_t index) const {
  return fmt::format("imud campaign repeat {} {} --record case_{}.pcapng", path_word(path_.string()), index, index);
}

void ResultFolder::keep_plan(std::string_view plan_text) const {
  if (::access((path_ / "plan.toml").c_str(), F_OK) == 0) return;
  try {
    write_once(path_ / "plan.toml", plan_text);
  } catch (const std::runtime_error& error) {
    throw OpenError(error.what());
  }
}

void ResultFolder::require_same(const CampaignDescription& campaign, std::string_view plan_text) const {
  std::vector<std::string> differences;
  const std::filesystem::path copy = path_ / "plan.toml";
  if (campaign_.plan_sha256 != campaign.plan_sha256)
    differences.push_back(::access(copy.c_str(), F_OK) != 0
                              ? fmt::format("the plan is another one ({} is missing there)", copy.string())
                              : first_difference(content_of(copy), std::string(plan_text)));
  if (campaign_.plan_sha256 == campaign.plan_sha256 && campaign_.cases != campaign.cases)
    differences.push_back(fmt::format("there are {} cases there and {} here", campaign_.cases, campaign.cases));
  const std::string of_imud = campaign_.difference_of_imud(campaign.version, campaign.build);
  const bool is_imud_alone = differences.empty();
  if (!of_imud.empty()) differences.push_back(of_imud);
  if (!differences.empty())
    throw OpenError(fmt::format("{}: has the results of another campaign: {}; {}give another folder", path_.string(),
                                fmt::join(differences, "; "), is_imud_alone ? "go on with that imud, or " : ""));
}

void ResultFolder::read_description() {
  const std::filesystem::path file = path_ / "campaign.json";
  if (::access(file.c_str(), R_OK) != 0)
    throw OpenError(
        fmt::format("{}: is no folder of a campaign: {}: {}", path_.string(), file.string(), std::strerror(errno)));
  try {
    const Json json = Json::parse(content_of(file));
    if (json.at("campaign") != 1) throw OpenError(fmt::format("{}: is of another version of imud", file.string()));
    campaign_ = {json.at("plan"),
                 json.at("plan_sha256"),
                 json.at("cases"),
                 json.at("batch"),
                 json.at("version"),
                 json.value("build", ""),
                 json.value("plan_from_folder", ""),
                 json.value("until", ""),
                 json.contains("arrays") ? arrays_of(json["arrays"]) : ArrayShape()};
  } catch (const nlohmann::json::exception&) {
    throw OpenError(fmt::format("{}: is damaged; give another folder", file.string()));
  }
  if (campaign_.cases == 0 || campaign_.batch == 0)
    throw OpenError(fmt::format("{}: is damaged; give another folder", file.string()));
}

void ResultFolder::check_writable() const {
  const std::filesystem::path probe = shards_path() / TemporaryFile("probe").file_name();
  const FileDescriptor file(::open(probe.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
  if (!file) throw OpenError(fmt::format("{}: cannot be written: {}", shards_path().string(), std::strerror(errno)));
  ::unlink(probe.c_str());
}

ResultFolder::Listing ResultFolder::list() const {
  Listing listing;
  std::error_code error;
  const auto check = [&] {
    if (error) throw OpenError(fmt::format("{}: cannot be read: {}", shards_path().string(), error.message()));
  };
  std::filesystem::directory_iterator at(shards_path(), error);
  if (error == std::errc::no_such_file_or_directory) return listing;  // no case has been done yet
  check();
  for (; at != std::filesystem::directory_iterator(); at.increment(error), check()) {
    const std::filesystem::directory_entry& entry = *at;
    const std::string name = entry.path().filename().string();
    if (const auto cases = cases_of_shard(name); cases && *cases == campaign_.shard_of(cases->first)) {
      listing.shards.push_back(*cases);
    } else if (auto temporary = TemporaryFile::parse(name)) {
      if (const auto of = cases_of_shard(temporary->name + ".jsonl");
          of && !is_left_behind(entry.path(), *temporary) && !is_older_than_its_shard(entry.path(), *of))
        listing.temporaries.emplace_back(std::move(*temporary), *of);
    } else if (const auto of = cases_of_array(name); !of || *of != campaign_.shard_of(of->first)) {
      listing.others.push_back(name);
    }
  }
  std::ranges::sort(listing.shards, {}, &CaseRange::first);
  return listing;
}

std::vector<CaseRange> ResultFolder::at_work() const {
  std::vector<CaseRange> all;
  for (const auto& [file, cases] : list().temporaries) all.push_back(cases);
  std::ranges::sort(all, {}, &CaseRange::first);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool ResultFolder::is_older_than_its_shard(const std::filesystem::path& file, const CaseRange& shard) const {
  std::error_code no_file, no_shard;
  const auto written = std::filesystem::last_write_time(file, no_file);
  const auto whole = std::filesystem::last_write_time(shards_path() / shard_name(shard), no_shard);
  return !no_file && !no_shard && whole > written;
}

bool ResultFolder::has(const CaseRange& shard) const {
  return ::access((shards_path() / shard_name(shard)).c_str(), F_OK) == 0;
}

std::optional<Shard> ResultFolder::read(const CaseRange& shard, std::string& fault) const {
  std::optional<Shard> read = read_shard(shards_path() / shard_name(shard), fault);
  if (read && read->head != campaign_.head(shard)) {
    fault = "is of another plan or another build of imud";
    return std::nullopt;
  }
  if (read && campaign_.arrays.rows > 0) {
    const std::uint64_t size = campaign_.arrays.bytes(shard.size());
    std::error_code error;
    const std::string name = array_name(shard);
    if (!read->arrays || read->arrays->bytes != size ||
        std::filesystem::file_size(shards_path() / name, error) != size || error) {
      fault = fmt::format("lacks its arrays: {} must have {} bytes", name, size);
      return std::nullopt;
    }
  }
  for (std::size_t i = 0; read && i < read->rows.size(); ++i) try {
      static_cast<void>(RowResult(read->rows[i]));
    } catch (const nlohmann::json::exception&) {
      fault = no_result_in_row_of(shard.first + i);
      return std::nullopt;
    }
  return read;
}

std::string ResultFolder::fault_of_arrays(const Shard& shard) const {
  if (campaign_.arrays.rows == 0) return {};
  const std::string name = array_name(shard.head.cases);
  return digest_of_array(shards_path() / name) == shard.arrays
             ? std::string()
             : fmt::format("has other arrays than its footer says: {} has changed", name);
}

std::size_t ResultFolder::remove_left_behind() const {
  std::size_t removed = 0;
  std::error_code error;
  for (const std::filesystem::path& folder : {path_, shards_path()})
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      const auto temporary = TemporaryFile::parse(entry.path().filename().string());
      if (temporary && is_left_behind(entry.path(), *temporary) && std::filesystem::remove(entry.path(), error))
        ++removed;
    }
  return removed;
}

}  // namespace imud
