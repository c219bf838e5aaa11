#include "emulator/rack/rack_record.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/rack/host_scripts.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "emulator/watch/run_text.hpp"
#include "transports/capture/pcapng_merge.hpp"
#include "transports/file/file_replacement.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

constexpr int failed = 1, incomplete = 3;

// A file without a name, which the system removes when this process ends.
class CopyOfRecord {
 public:
  // Throws std::runtime_error.
  explicit CopyOfRecord(const std::filesystem::path& folder) {
    std::string name = (folder / ".imud-rack.XXXXXX").string();
    file_.reset(::mkostemp(name.data(), O_CLOEXEC));
    if (!file_) throw std::runtime_error(fmt::format("{}: {}", folder.string(), std::strerror(errno)));
    ::unlink(name.c_str());
  }
  void write(std::string_view bytes) noexcept {
    if (error_ == 0) error_ = write_whole(file_.get(), std::as_bytes(std::span(bytes)));
  }
  int error() const noexcept { return error_; }  // errno of the first write that has failed; 0: none has
  std::string path() const { return fmt::format("/proc/self/fd/{}", file_.get()); }

 private:
  FileDescriptor file_;
  int error_ = 0;
};

// A run, and its record as far as it is known.
struct RecordOfRun {
  const RackHost* host = nullptr;
  const RackRun* run = nullptr;
  UnitRecord record;
  std::string fault;  // the reason why there is no whole record; empty if there is
  std::unique_ptr<CopyOfRecord> copy;
};

std::string question(const RackHost& host) {
  std::string script;
  for (const RackRun& run : host.runs)
    script += fmt::format("{}{} show --property=ExecStart --value {} || exit 1\n", section("unit " + run.name),
                          systemctl(host), shell_word(run.text()));
  return script;
}

// Asks the hosts where their runs record.
std::vector<RecordOfRun> find_records(const Rack& rack) {
  std::vector<std::string> scripts;
  for (const RackHost& host : rack.hosts) scripts.push_back(question(host));
  const std::vector<HostAnswer> answers = run_on_hosts(rack.hosts, scripts, rack.time_limit, workers_stop());
  std::vector<RecordOfRun> runs;
  for (std::size_t i = 0; i < rack.hosts.size(); ++i)
    for (const RackRun& run : rack.hosts[i].runs) {
      RecordOfRun one{&rack.hosts[i], &run, unit_record(answers[i].text("unit " + run.name)), answers[i].fault,
                      nullptr};
      if (one.fault.empty() && one.record.file.empty())
        one.fault = fmt::format("its unit has no --record FILE; give it one by `{} edit imud@.service` there",
                                systemctl(*one.host));
      runs.push_back(std::move(one));
    }
  return runs;
}

// Returns a script that prints the record. A relative path begins at the folder in which systemd starts the run.
std::string reading_script(const RackHost& host, const UnitRecord& record) {
  std::string script = host.service == RackHost::Service::system ? "cd /\n" : "cd \"$HOME\"\n";
  if (!record.is_split) return script + "exec cat -- " + shell_word(record.file) + "\n";
  constexpr std::string_view suffix = ".pcapng";
  std::string_view stem = record.file;
  if (stem.ends_with(suffix)) stem.remove_suffix(suffix.size());
  return script + fmt::format("exec cat -- {}-[0-9][0-9][0-9][0-9][0-9]*{}\n", shell_word(stem), suffix);
}

// Copies the records that were found to files of `folder`. A run whose record is not whole gets a fault.
void copy_records(std::vector<RecordOfRun>& runs, const Rack& rack, const std::filesystem::path& folder) {
  std::vector<Download> downloads;
  std::vector<RecordOfRun*> wanted;
  for (RecordOfRun& run : runs) {
    if (!run.fault.empty()) continue;
    run.copy = std::make_unique<CopyOfRecord>(folder);
    downloads.push_back({run.host, reading_script(*run.host, run.record),
                         [&copy = *run.copy](std::string_view bytes) { copy.write(bytes); }});
    wanted.push_back(&run);
  }
  const std::vector<std::string> faults = download(downloads, rack.time_limit, workers_stop());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    RecordOfRun& run = *wanted[i];
    if (const int error = run.copy->error(); error != 0)
      throw std::runtime_error(fmt::format("{}: {}", folder.string(), std::strerror(error)));
    run.fault = faults[i];
    if (run.fault.empty() && !is_pcapng(run.copy->path())) run.fault = run.record.file + " is no record (pcapng)";
  }
}

}  // namespace

UnitRecord unit_record(std::string_view exec_start) {
  UnitRecord record;
  std::string_view option;  // the option whose value is the next word
  while (!exec_start.empty()) {
    const std::string_view word = exec_start.substr(0, exec_start.find(' '));
    exec_start.remove_prefix(std::min(exec_start.size(), word.size() + 1));
    const std::size_t equals = word.find('=');
    const std::string_view name = word.substr(0, equals);
    if (option == "--record") record.file = word;
    option = equals == word.npos ? name : std::string_view();
    if (name == "--record" && equals != word.npos) record.file = word.substr(equals + 1);
    if (name == "--record-max-mb") record.is_split = true;
  }
  if (record.file == "-") record.file.clear();  // standard output, which the journal has
  return record;
}

int rack_record(const std::string& path, const std::string& output) {
  const Rack rack = read_rack(path);
  if (const std::string fault = foreign_link_fault(output); !fault.empty()) throw std::runtime_error(fault);
  const auto target = is_standard_output(output) ? std::nullopt : FileReplacement::target(output);
  if (!target) throw std::runtime_error(output + ": is no file; give the name of one, such as rack.pcapng");
  FileReplacement file({"pcapng", output, {}}, *target);
  catch_workers_stop();
  std::vector<RecordOfRun> runs = find_records(rack);
  const std::filesystem::path folder = std::filesystem::path(*target).parent_path();
  copy_records(runs, rack, folder.empty() ? "." : folder);

  std::vector<MergedCapture> captures;
  for (const RecordOfRun& run : runs)
    if (run.fault.empty())
      captures.push_back({run.copy->path(), fmt::format("{}/{}/", run.host->name, run.run->name), 0, {}});
  if (!captures.empty())
    if (const int error = merge_pcapng(captures, file.descriptor(), "imud " IMUD_VERSION, workers_stop()); error != 0)
      throw std::runtime_error(fmt::format("{}: {}", output, std::strerror(error)));
  bool is_whole = true;
  std::string text;
  auto merged = captures.begin();
  for (const RecordOfRun& run : runs) {
    const std::string name = run.run->text();
    if (run.fault.empty())
      text += fmt::format("{}: merged {}, {} packets of {}", run.host->name, name, merged->packets, run.record.file);
    else
      text += fmt::format("{}: NOT merged {}", run.host->name, name);
    const std::string& remark = run.fault.empty() ? (merged++)->end_warning : run.fault;
    text += remark.empty() ? "\n" : fmt::format(": {}\n", remark);
    is_whole = is_whole && remark.empty();
  }
  TextFile("-").write(printable(std::move(text)));
  if (captures.empty()) {
    fmt::print(stderr, "there is no record; {} was not written\n", output);
    return failed;
  }
  file.commit();
  return is_whole ? 0 : incomplete;
}

}  // namespace imud
