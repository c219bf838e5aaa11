// imu-campaign: the cases of a campaign as one table, their statistics and pictures.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/campaign/campaign_arrays.hpp"
#include "tools/campaign/campaign_plot.hpp"
#include "tools/campaign/campaign_report.hpp"
#include "tools/campaign/campaign_rows.hpp"
#include "tools/campaign/case_statistics.hpp"
#include "tools/campaign/case_table.hpp"
#include "tools/gnuplot.hpp"
#include "tools/output_options.hpp"
#include "tools/program.hpp"
#include "tools/text_output.hpp"
#include "transports/file/files_in_use.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

constexpr int incomplete = 3;

struct Options {
  std::string action, folder;
  std::string csv, sqlite, json, hdf5;            // collect; json of report, too
  std::vector<std::string> figures, over, worst;  // report
  std::size_t count = 10;
  std::string picture;
};

// Reports what is missing. Returns the exit code.
int end(const CampaignRows& rows, std::uint64_t not_run) {
  constexpr std::size_t most_lines = 10;
  const std::vector<std::string>& faults = rows.faults();
  for (std::size_t i = 0; i < faults.size() && i < most_lines; ++i)
    fmt::print(stderr, "imu-campaign: {}\n", faults[i]);
  if (faults.size() > most_lines)
    fmt::print(stderr, "imu-campaign: and {} more of these\n", faults.size() - most_lines);
  if (not_run > 0) fmt::print(stderr, "imu-campaign: {} cases could not be run, as their errors state\n", not_run);
  const std::uint64_t missing = rows.cases() - rows.found() + not_run;
  if (missing == 0 && faults.empty()) return 0;
  fmt::print(stderr, "imu-campaign: {} of {} cases are complete; to run the others: {}\n", rows.cases() - missing,
             rows.cases(), rows.resume_command());
  return incomplete;
}

int collect(const Options& options, CampaignRows& rows, bool& running) {
  std::vector<std::unique_ptr<CaseTable>> tables;
  if (!options.csv.empty()) tables.push_back(csv_table(options.csv));
  if (!options.json.empty()) tables.push_back(json_table(options.json));
  if (!options.sqlite.empty()) tables.push_back(sqlite_table(options.sqlite));
  if (tables.empty() && options.hdf5.empty())
    throw std::invalid_argument(
        "collect: no table is asked for; right would be --csv FILE, --sqlite FILE, --json FILE, or --hdf5 FILE for "
        "arrays");
  if (!options.hdf5.empty()) {
    check_campaign_arrays(rows.campaign(), options.hdf5);
    rows.check_arrays();
  }
  running = true;
  const CollectedCases collected = collect_cases(rows, tables);
  if (!options.hdf5.empty()) write_campaign_arrays(rows, options.hdf5);
  fmt::print(stderr, "imu-campaign: {} rows of {} columns\n", rows.found(), collected.columns);
  if (const std::string until = rows.until(); !until.empty()) fmt::print(stderr, "imu-campaign: {}\n", until);
  return end(rows, collected.not_run);
}

// Returns the numbers of the named items. Throws std::invalid_argument if one is unknown.
template <class Find, class Items>
std::vector<std::size_t> numbers_of(const std::vector<std::string>& names, const Find& find, const Items& all,
                                    std::string_view option) {
  std::vector<std::size_t> numbers;
  for (const std::string& name : names) {
    const auto number = find(name);
    if (!number) {
      std::string known;
      for (const auto& item : all) known += (known.empty() ? "" : ", ") + item.name;
      throw std::invalid_argument(
          fmt::format("{} {}: no case has it{}{}", option, name, known.empty() ? "" : "; there are ", known));
    }
    numbers.push_back(*number);
  }
  return numbers;
}

// Throws std::invalid_argument if a figure has no values over time.
void require_over_time(const CaseStatistics& statistics, const std::vector<std::string>& figures) {
  for (const std::string& name : figures)
    if (statistics.find_over_time(name).empty())
      throw std::invalid_argument(
          fmt::format("--over time: no case has {}@TIME; integrated errors have it with the plan's key "
                      "integrated_errors_every_s, "
                      "and a test may write metrics of such names",
                      name));
}

int report(const Options& options, CampaignRows& rows, bool& running) {
  const std::string data_path = options.picture.empty() ? std::string() : data_path_beside(options.picture);
  if (!options.picture.empty()) {
    check_plot(options.picture);
    check_data_path(data_path, campaign_data);
    if (options.figures.size() != 1 || options.over.size() > 2)
      throw std::invalid_argument("--plot: right would be one --figure, and --over for no, one or two axes");
  }
  const bool asks_for_time = options.over == std::vector<std::string>{"time"};
  if (asks_for_time && options.figures.empty())
    throw std::invalid_argument("--over time: right would be --figure NAME, whose values are NAME@TIME");
  CaseStatistics statistics(
      {.figures = options.figures, .over_time = asks_for_time, .worst = options.worst, .count = options.count});
  CaseRow row;
  running = true;
  {
    ProgressLine line;
    rows.read(
        [&](std::string_view text, std::uint64_t index) {
          row.read(text, index);
          statistics.add(row);
        },
        [&](double done) {
          if (line.is_due()) line.show(done, "the cases");
        });
  }
  running = false;  // a wrong name is of the command line
  ReportChoice choice = {figures_to_show(statistics, !options.figures.empty()), {}};
  const bool is_over_time = asks_for_time && !statistics.find_axis("time");
  std::vector<std::size_t> asked;
  if (is_over_time) {
    require_over_time(statistics, options.figures);
  } else {
    const auto find_figure = [&](const std::string& name) { return statistics.find_figure(name); };
    asked = numbers_of(options.figures, find_figure, statistics.figures(), "--figure");
    choice.axes = numbers_of(
        options.over, [&](const std::string& name) { return statistics.find_axis(name); }, statistics.axes(),
        "--over");
  }
  for (const CaseStatistics::Worst& worst : statistics.worst())
    if (!worst.is_known) throw std::invalid_argument(fmt::format("--worst {}: no case has it", worst.figure));
  if (options.over.empty())
    for (std::size_t axis = 0; axis < statistics.axes().size(); ++axis) choice.axes.push_back(axis);
  running = true;
  if (!is_standard_output(options.json)) fmt::print("{}", campaign_text(statistics, rows, choice));
  if (!options.json.empty()) write_file(options.json, campaign_json(statistics, rows, choice));
  if (!options.picture.empty()) {
    if (options.over.empty()) choice.axes.clear();
    const CampaignPicture picture =
        is_over_time ? draw_over_time(statistics, options.figures.front(), data_path, options.picture)
                     : draw_campaign(statistics, asked.front(), choice.axes, data_path, options.picture);
    write_file(data_path, picture.data);
    run_gnuplot(picture.commands);
  }
  return end(rows, statistics.not_run());
}

int execute(int argc, char** argv, bool& running) {
  CLI::App app(
      "Collects the cases of a campaign (imud campaign run PLAN --into DIR) as one table, or reports their\n"
      "statistics: pass rates, percentiles by the values of each axis, the worst cases and pictures.",
      "imu-campaign");
  app.set_version_flag("--version", "imu-campaign " IMUD_VERSION);
  Options options;
  add(app, "ACTION", options.action, "", "collect: writes tables; report: prints statistics")
      ->required()
      ->check(CLI::IsMember({"collect", "report"}, CLI::ignore_case));
  add(app, "DIR", options.folder, "", "folder of the campaign")->required();
  OutputOptions outputs(app);
  outputs.add("--csv", options.csv, "collect: writes a row for each case as CSV; - is standard output");
  outputs.add("--sqlite", options.sqlite, "collect: writes the same rows as a database with the table `cases`");
  outputs.add("--json", options.json,
              "collect: writes an object for each case, in a line of its own; report: writes the statistics; - is "
              "standard output");
  outputs.add("--hdf5", options.hdf5,
              "collect: writes the arrays of a plan with the key `arrays`: a virtual data set for each imu, with a\n"
              "dimension for each axis, the draws, the seeds and the rows; the measurements stay in DIR");
  add(app, "--figure", options.figures, "NAME",
      "report: this column, such as imu1.samples, test.error_deg or expect.settles; may be repeated; default: the\n"
      "metrics of the test or, without any, the figures that are not the same in all cases")
      ->allow_extra_args(false);
  add(app, "--over", options.over, "AXIS",
      "report: divided by the values of this axis; may be repeated; default: all. time: the values NAME@TIME of "
      "each\n"
      "--figure NAME, with TIME in s")
      ->allow_extra_args(false);
  add(app, "--worst", options.worst, "NAME",
      "report: lists the cases with the greatest magnitude of this figure; may be repeated")
      ->allow_extra_args(false);
  add(app, "--count", options.count, "N", "report: lists so many of the worst and of the failed cases; default: 10")
      ->check(number_check(0, 1000));
  outputs
      .add("--plot", options.picture,
           "report: picture of the --figure: its histogram, over one axis or time a fan of its percentiles, or over\n"
           "two axes a heat map of its mean; the data stand beside it, as FILE.plot.csv")
      ->type_name("FILE.svg|FILE.png");
  app.footer(
      "\nExit codes: 0 done, 1 failed while running, 2 the command line is wrong or DIR is no campaign, 3 done, but "
      "cases are missing or could not be run.\n"
      "Example: imu-campaign collect results --csv cases.csv --sqlite cases.db");
  if (const auto exit_code = parse(app, argc, argv)) return *exit_code;
  const bool is_collect = options.action == "collect";
  for (const CLI::Option* option : app.get_options())
    if (option->count() > 0 && option->get_description().starts_with(is_collect ? "report:" : "collect:") &&
        option->get_description().find(is_collect ? "collect:" : "report:") == std::string::npos)
      throw std::invalid_argument(fmt::format("{}: {} is no option of it", options.action, option->get_name()));
  FilesInUse files;
  for (const char* own : {"/campaign.json", "/plan.toml"}) files.add(options.folder + own, "the campaign's own");
  CampaignRows rows(options.folder);
  files.add(rows.campaign().plan, "the campaign's plan");
  if (const std::string fault = outputs.claim(files); !fault.empty()) throw std::invalid_argument(fault);
  const std::string cases = canonical_path(rows.shards_path().string()) + "/";
  for (const std::string& path : {options.csv, options.sqlite, options.json, options.hdf5, options.picture})
    if (!path.empty() && canonical_path(path).starts_with(cases))
      throw std::invalid_argument(fmt::format("{}: is in the folder of the cases; give another file", path));
  return is_collect ? collect(options, rows, running) : report(options, rows, running);
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) { return imud::run_tool("imu-campaign", imud::execute, argc, argv); }
