#include "emulator/campaign/campaign_commands.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "emulator/campaign/campaign_check.hpp"
#include "emulator/campaign/campaign_repeat.hpp"
#include "emulator/campaign/status/campaign_page.hpp"
#include "emulator/campaign/status/campaign_status.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/plan/number_check.hpp"

namespace imud {
namespace {

// Replaces this process by `imu-campaign ACTION ARGUMENTS...`, a program in the same folder: only this program needs
// the libraries that write SQLite and pictures. Throws OpenError if the program cannot be executed.
[[noreturn]] void become_tool(const std::string& action, const std::vector<std::string>& arguments) {
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe");
  std::vector<std::string> words = {(self.parent_path() / "imu-campaign").string(), action};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execv(argv.front(), argv.data());
  throw OpenError(fmt::format("{}: {}; it is installed beside imud", words.front(), std::strerror(errno)));
}

}  // namespace

CampaignCommands::CampaignCommands(CLI::App& app, bool is_given) {
  CLI::App* campaign = app.add_subcommand("campaign",
                                          "Replay the many cases of a plan: values of keys, captures, "
                                          "scenarios, random draws and seeds");
  if (!is_given) return;
  campaign->require_subcommand(1);
  CLI::App* check = campaign->add_subcommand(
      "check", "List every fault of a plan, or show how many cases it has, how long they take and what they write");
  check->add_option("PLAN", plan_, "Plan of the campaign, TOML")->required();
  check_ = check;
  add_run(*campaign);
  add_bisect(*campaign);
  add_tools(*campaign);
}

void CampaignCommands::add_bisect(CLI::App& campaign) {
  CLI::App* bisect =
      campaign.add_subcommand("bisect", "Find the values of an axis between which a case begins to fail, or to pass");
  bisect->add_option("PLAN", plan_, "Plan of the campaign, or folder of the results")->required();
  bisect->add_option("--axis", bisect_options_.axis, "Axis of numbers, by its name in the plan")
      ->type_name("KEY")
      ->required();
  bisect->add_option("--case", bisect_options_.index, "Beside the other values of this case alone (each combination)")
      ->type_name("CASE");
  bisect
      ->add_option("--tolerance", bisect_options_.tolerance,
                   "Distance to come down to, in the unit of the axis (a thousandth of the plan's values' distance)")
      ->type_name("X")
      ->check(number_check(1e-300, 1e300));
  bisect->add_option("--jobs", bisect_options_.jobs, "Processes (the processors)")
      ->type_name("N")
      ->check(CLI::Range(1, 1024));
  bisect->footer("Example: imud campaign bisect plan.toml --axis imu.imu1.gyro.bias_rad_per_s --case 0");
  bisect_ = bisect;
}

void CampaignCommands::add_tools(CLI::App& campaign) {
  const auto add = [&](const std::string& name, const std::string& help) {
    CLI::App* tool = campaign.add_subcommand(name, help);
    tool->prefix_command();
    tools_.push_back(tool);
    return tool;
  };
  add("collect", "Write the cases in DIR as a table; the options of `imu-campaign collect` follow")
      ->footer("Example: imud campaign collect DIR --csv cases.csv --sqlite cases.db");
  add("report",
      "Print the statistics of the cases in DIR, and draw them; the options of `imu-campaign report` follow")
      ->footer("Example: imud campaign report DIR --figure imu1.angle_error_x_rad --plot histogram.svg");
}

void CampaignCommands::add_run(CLI::App& campaign) {
  const auto with_run = [this](CLI::App* command) {
    command->add_option("--jobs", run_options_.jobs, "Processes (the processors)")
        ->type_name("N")
        ->check(CLI::Range(1, 1024));
    command->add_flag("-q,--quiet", run_options_.quiet, "Show no progress");
    command->add_option("--engine", engine_, "Run on this machine (local), or on a cluster as job arrays (slurm)")
        ->type_name("ENGINE")
        ->check(CLI::IsMember({"local", "slurm"}));
    command
        ->add_option("--slurm-option", slurm_options_.options,
                     "Further option of sbatch, such as --slurm-option=--mem=2G; may be repeated")
        ->type_name("TEXT")
        ->allow_extra_args(false);
    command->add_option("--slurm-task", slurm_options_.cases_per_task, "Cases of a task (as many as take minutes)")
        ->type_name("CASES")
        ->check(CLI::Range(1, 1'000'000'000));
  };
  CLI::App* run =
      campaign.add_subcommand("run", "Run the cases of a plan on this machine or on a cluster, into a folder");
  run->add_option("PLAN", plan_, "Plan of the campaign, TOML")->required();
  run->add_option("--into", folder_, "Folder of the results; with results of the same plan the others are added")
      ->type_name("DIR")
      ->required();
  run->add_option_function<std::string>(
         "--case", [this](const std::string& text) { run_options_.cases = CaseRange::parse(text); },
         "Run these cases alone: whole shards, of `batch` cases each")
      ->type_name("K..L")
      ->check([](const std::string& text) {
        return CaseRange::parse(text) ? std::string() : "give the number of a case, or a range such as 0..99";
      });
  with_run(run);
  run_ = run;
  CLI::App* resume = campaign.add_subcommand(
      "resume", "Run the cases that are missing in a folder, are in a damaged shard, or could not be run before");
  resume->add_option("DIR", folder_, "Folder of the results")->required();
  with_run(resume);
  resume_ = resume;
  CLI::App* status = campaign.add_subcommand("status", "Show how far a campaign has come");
  status->add_option("DIR", folder_, "Folder of the results")->required();
  status_options_.add_to(*status);
  status_ = status;
  CLI::App* repeat =
      campaign.add_subcommand("repeat", "Run one case alone, print its row, and compare it with the stored one");
  repeat->add_option("PLAN", plan_, "Folder of the results, or plan of the campaign")->required();
  repeat->add_option("CASE", case_, "Number of the case")->required()->check([](const std::string& text) {
    const bool is_number = !text.empty() && text.find_first_not_of("0123456789") == text.npos;
    return is_number ? std::string() : "give the number of a case, such as 17";
  });
  repeat->add_option("--record", record_, "Also record the run as pcapng, which Wireshark opens and replay repeats")
      ->type_name("FILE");
  repeat
      ->add_option("--axis", values_,
                   "Another value of an axis than the case has, as bisect prints it; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  repeat_ = repeat;
}

bool CampaignCommands::is_for_slurm() const {
  const bool is_slurm = engine_ == "slurm" || (engine_.empty() && resume_->parsed() && is_on_slurm(folder_));
  if (is_slurm && (run_options_.cases || run_options_.jobs > 0))
    throw OpenError(
        "--case and --jobs are for --engine local; a task of Slurm has as many processes as processors "
        "(--slurm-option=--cpus-per-task=N)");
  if (!is_slurm && (!slurm_options_.options.empty() || slurm_options_.cases_per_task > 0))
    throw OpenError("--slurm-option and --slurm-task are for --engine slurm");
  return is_slurm;
}

std::optional<int> CampaignCommands::execute() const {
  if (check_ == nullptr) return std::nullopt;
  SlurmRunOptions slurm = slurm_options_;
  slurm.quiet = run_options_.quiet;
  if (check_->parsed()) return campaign_check(plan_);
  if (run_->parsed())
    return is_for_slurm() ? run_on_slurm(plan_, folder_, slurm) : run_campaign(plan_, folder_, run_options_);
  if (resume_->parsed())
    return is_for_slurm() ? resume_on_slurm(folder_, slurm) : resume_campaign(folder_, run_options_);
  if (status_->parsed())
    return status_options_.has_page() ? serve_campaign(folder_, status_options_.web)
                                      : campaign_status(folder_, status_options_.json);
  if (repeat_->parsed()) return repeat_case(plan_, case_, record_, values_);
  if (bisect_->parsed()) return bisect_campaign(plan_, bisect_options_);
  for (const CLI::App* tool : tools_)
    if (tool->parsed()) become_tool(tool->get_name(), tool->remaining());
  return std::nullopt;
}

}  // namespace imud
