#include "emulator/campaign/shards/shard.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "core/numbers/number_text.hpp"
#include "emulator/ground/exit_code.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view suffix_of_shard = ".jsonl", suffix_of_temporary = ".tmp";

std::optional<CaseRange> range_of(std::string_view text, std::string_view between) noexcept {
  const auto range = range_in<std::uint64_t>(text, between);
  return range ? std::optional(CaseRange{range->first, range->second}) : std::nullopt;
}

// Returns the name of this host.
std::string this_host() {
  std::array<char, HOST_NAME_MAX + 1> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
}

// Returns in which space a number of a process is unique: the begin of the identifier of the host's boot, and the
// number of the namespace. Containers may share the name of a host.
std::string this_space() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string boot;
  file >> boot;
  struct stat space {};
  ::stat("/proc/self/ns/pid", &space);
  return fmt::format("{:.8}-{}", boot, space.st_ino);
}

[[noreturn]] void fail(const std::filesystem::path& path, int error) {
  throw std::runtime_error(fmt::format("{}: {}", path.string(), std::strerror(error)));
}

// Creates a temporary file. Another one of that name is of an ended process that had the number of this one.
FileDescriptor create(const std::filesystem::path& path) {
  constexpr mode_t mode = 0666;
  ::unlink(path.c_str());
  FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode));
  if (!file) fail(path, errno);
  return file;
}

// Opens a temporary file that a worker of this process may have created.
FileDescriptor open_claimed(const std::filesystem::path& path) {
  FileDescriptor file(::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC));
  return file ? std::move(file) : create(path);
}

void write_text(int file, std::string_view text, const std::filesystem::path& path) {
  if (const int error = write_whole(file, std::as_bytes(std::span(text))); error != 0) fail(path, error);
}

// Waits until the disk has the names in a folder. A file system that cannot do that is no fault.
void keep_names(const std::filesystem::path& folder) noexcept {
  const FileDescriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file) ::fsync(file.get());
}

std::string header_of(const ShardHead& head) {
  return Json({{"campaign", 1},
               {"plan", head.plan},
               {"version", head.version},
               {"build", head.build},
               {"first", head.cases.first},
               {"last", head.cases.last}})
      .dump();
}

std::string footer_of(std::uint64_t rows, const std::optional<ArrayDigest>& arrays, std::string sha256) {
  Json footer = {{"rows", rows}};
  if (arrays) footer["arrays"] = {{"bytes", arrays->bytes}, {"sha256", arrays->sha256}};
  footer["sha256"] = std::move(sha256);
  return footer.dump();
}

// Returns the JSON object in a line; an empty one if the line has none.
Json object_in(const std::string& line) {
  Json object = Json::parse(line, nullptr, false);
  return object.is_object() ? object : Json::object();
}

std::optional<ShardHead> head_in(const std::string& line) {
  try {
    const Json object = object_in(line);
    if (object.at("campaign") != 1) return std::nullopt;
    return ShardHead{
        object.at("plan"), object.at("version"), object.value("build", ""), {object.at("first"), object.at("last")}};
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

std::optional<ArrayDigest> arrays_in(const std::string& footer) {
  try {
    const Json arrays = object_in(footer).at("arrays");
    return ArrayDigest{arrays.at("bytes"), arrays.at("sha256")};
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

// Returns true if no process has that number, or one that has ended and for which its parent has not waited.
bool has_ended(pid_t process) {
  if (::kill(process, 0) != 0) return errno == ESRCH;
  std::ifstream file(fmt::format("/proc/{}/stat", process));
  std::string text;
  std::getline(file, text);
  const std::size_t name_end = text.rfind(')');
  return name_end != std::string::npos && text.compare(name_end, 3, ") Z") == 0;
}

}  // namespace

std::optional<CaseRange> CaseRange::parse(std::string_view text) noexcept {
  if (const auto one = number_in<std::uint64_t>(text)) return CaseRange{*one, *one};
  return range_of(text, "..");
}

RowResult::RowResult(std::string_view row) {
  // Most rows are good, and reading all of them as JSON takes long. A quote within a text has a backslash before it,
  // and the metrics of a test, which may have members of any name, come behind the digest.
  if (row.substr(0, row.find("\"digest\":")).find("\"exit_code\":0,\"ended_by\"") != row.npos) {
    exit_code = 0;
    return;
  }
  const Json json = Json::parse(row);
  exit_code = json.at("exit_code");
  for (const auto& [name, holds] : json.at("expect").items())
    expectation_failed = expectation_failed || holds == false;
  could_not_be_run = !json.at("error").is_null();
  if (could_not_be_run) error = json.at("error");
  if (const auto all = json.find("shortfalls");
      all != json.end() && all->is_array() && !all->empty() && !could_not_be_run)
    shortfall = all->front().get<std::string>();
}

void CaseTally::add(const RowResult& row) noexcept {
  CaseTally one{.exit_code = row.exit_code};
  if (row.could_not_be_run)
    one.could_not_be_run = 1;
  else if (row.exit_code != 0)
    (row.expectation_failed ? one.expectations_failed : one.incomplete) = 1;
  add(one);
}

void CaseTally::add(const CaseTally& other) noexcept {
  could_not_be_run += other.could_not_be_run;
  expectations_failed += other.expectations_failed;
  incomplete += other.incomplete;
  exit_code = worse_exit_code(exit_code, other.exit_code);
}

std::string CaseTally::text() const {
  return fmt::format("cases    {} could not be run, {} incomplete or with failed expectations\n", could_not_be_run,
                     expectations_failed + incomplete);
}

std::string no_result_in_row_of(std::uint64_t index) {
  return fmt::format("has no result in the row of case {}", index);
}

std::string shard_name(const CaseRange& cases) {
  return fmt::format("{:09}-{:09}{}", cases.first, cases.last, suffix_of_shard);
}

std::optional<CaseRange> cases_of_shard(std::string_view name) noexcept {
  if (!name.ends_with(suffix_of_shard)) return std::nullopt;
  return range_of(name.substr(0, name.size() - suffix_of_shard.size()), "-");
}

std::optional<Shard> read_shard(const std::filesystem::path& path, std::string& fault) {
  const auto refuse = [&fault](std::string text) {
    fault = std::move(text);
    return std::nullopt;
  };
  std::ifstream file(path, std::ios::binary);
  if (!file) return refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
  Shard shard;
  Sha256Stream digest;
  std::string line;
  // A line without its line feed is cut short.
  const auto next = [&] { return std::getline(file, line) && !file.eof(); };
  if (!next()) return refuse("is cut short in its header");
  std::optional<ShardHead> head = head_in(line);
  if (!head) return refuse("has no header of a shard");
  shard.head = std::move(*head);
  const std::optional<CaseRange> named = cases_of_shard(path.filename().string());
  if (named && *named != shard.head.cases)
    return refuse(fmt::format("has the header of the cases {}..{}", shard.head.cases.first, shard.head.cases.last));
  const std::uint64_t rows = shard.head.cases.size();
  const auto add = [&] {
    digest.add(line);
    digest.add("\n");
  };
  add();
  while (next()) {
    if (shard.rows.size() == rows) {
      shard.arrays = arrays_in(line);
      if (line != footer_of(rows, shard.arrays, digest.end()))
        return refuse("has a footer that does not agree with its content");
      if (file.peek() != std::ifstream::traits_type::eof()) return refuse("goes on behind its footer");
      return shard;
    }
    add();
    shard.rows.push_back(line);
  }
  return refuse(fmt::format("is cut short after {} of {} rows", shard.rows.size(), rows));
}

TemporaryFile::TemporaryFile(std::string of)
    : name(std::move(of)), host(this_host()), space(this_space()), process(::getpid()) {}

TemporaryFile TemporaryFile::of_shard(const CaseRange& cases) {
  return TemporaryFile(fmt::format("{:09}-{:09}", cases.first, cases.last));
}

std::optional<TemporaryFile> TemporaryFile::parse(std::string_view file_name) {
  if (!file_name.starts_with('.') || !file_name.ends_with(suffix_of_temporary)) return std::nullopt;
  file_name = file_name.substr(1, file_name.size() - 1 - suffix_of_temporary.size());
  const std::size_t begin = file_name.find('.'), end = file_name.rfind('.');
  if (begin == end) return std::nullopt;
  const std::size_t middle = file_name.rfind('.', end - 1);  // a host's name may have dots
  TemporaryFile file;
  const auto process = number_in<pid_t>(file_name.substr(end + 1));
  if (middle <= begin || !process) return std::nullopt;
  file.process = *process;
  file.name = file_name.substr(0, begin);
  file.host = file_name.substr(begin + 1, middle - begin - 1);
  file.space = file_name.substr(middle + 1, end - middle - 1);
  return file;
}

std::string TemporaryFile::file_name() const {
  return fmt::format(".{}.{}.{}.{}{}", name, host, space, process, suffix_of_temporary);
}

bool TemporaryFile::is_left_behind() const {
  return host == this_host() && space == this_space() && process > 0 && has_ended(process);
}

ShardWriter::ShardWriter(std::filesystem::path folder, const ShardHead& head)
    : folder_(std::move(folder)),
      cases_(head.cases),
      temporary_(folder_ / TemporaryFile::of_shard(cases_).file_name()),
      file_(open_claimed(temporary_)) {
  write(header_of(head));
}

ShardWriter::~ShardWriter() {
  if (!is_whole_) ::unlink(temporary_.c_str());
}

void ShardWriter::write(std::string_view line) {
  constexpr std::size_t most = 65536;
  digest_.add(line);
  digest_.add("\n");
  held_.append(line).push_back('\n');
  if (held_.size() >= most) flush();
}

void ShardWriter::flush() {
  write_text(file_.get(), held_, temporary_);
  held_.clear();
}

void ShardWriter::add(std::string_view row) {
  ++rows_;
  write(row);
}

bool ShardWriter::commit(const std::optional<ArrayDigest>& arrays) {
  if (rows_ != cases_.size())
    throw std::runtime_error(fmt::format("{}: {} of {} rows", temporary_.string(), rows_, cases_.size()));
  const std::string footer = footer_of(rows_, arrays, digest_.end());
  held_.append(footer).push_back('\n');
  flush();
  if (::fsync(file_.get()) != 0) fail(temporary_, errno);
  // A worker that claims the shard later creates another file of that name.
  struct stat mine {};
  if (::fstat(file_.get(), &mine) == 0 && mine.st_nlink == 0) return false;
  file_.reset();
  const std::filesystem::path path = folder_ / shard_name(cases_);
  if (::rename(temporary_.c_str(), path.c_str()) != 0) {
    if (errno == ENOENT) return false;
    fail(path, errno);
  }
  is_whole_ = true;
  keep_names(folder_);
  return true;
}

bool write_once(const std::filesystem::path& path, std::string_view text) {
  const std::filesystem::path temporary = path.parent_path() / TemporaryFile(path.stem().string()).file_name();
  FileDescriptor file = create(temporary);
  int error = 0;
  try {
    write_text(file.get(), text, temporary);
    if (::fsync(file.get()) != 0) fail(temporary, errno);
    // Unlike rename(2), link(2) leaves a file of that name as it is. Some file systems have no links.
    if (::link(temporary.c_str(), path.c_str()) != 0) error = errno;
    if (error == EPERM || error == EOPNOTSUPP || error == ENOSYS) {
      error = ::access(path.c_str(), F_OK) == 0 ? EEXIST : 0;
      if (error == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
    }
    if (error != 0 && error != EEXIST) fail(path, error);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
  ::unlink(temporary.c_str());
  keep_names(path.parent_path());
  return error == 0;
}

}  // namespace imud
