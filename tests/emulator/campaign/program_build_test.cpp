// Builds of one version of imud: how they are told apart, and that their results are never mixed.
#include "emulator/campaign/shards/program_build.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

std::string bytes_of(const std::string& hexadecimal) {
  std::string bytes;
  for (std::size_t i = 0; i < hexadecimal.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hexadecimal.substr(i, 2), nullptr, 16));
  return bytes;
}

// elf(5): the sizes of name and content, the type, the name and the content, both filled up to 4 bytes.
TEST(ProgramBuild, IsInItsNote) {
  const auto id = [](const std::string& notes, std::size_t alignment = 4) {
    return build_id_in(std::as_bytes(std::span(notes)), alignment);
  };
  const std::string other = bytes_of(
                        "04000000"
                        "06000000"
                        "01000000"
                        "474e5500"
                        "aabbccddeeff0000"),
                    build = bytes_of(
                        "04000000"
                        "03000000"
                        "03000000"
                        "474e5500"
                        "12abef00");
  EXPECT_EQ(id(build), "12abef");
  EXPECT_EQ(id(other + build), "12abef");
  EXPECT_EQ(id(other), "");
  EXPECT_EQ(id(build.substr(0, 18)), "");
  std::string of_others = build;
  of_others[12] = 'X';
  EXPECT_EQ(id(of_others), "");
  // Aligned to 8 bytes: the name ends at 16, the content of the first note at 24.
  EXPECT_EQ(id(other + build, 8), "12abef");
  EXPECT_EQ(id(bytes_of("04000000"
                        "04000000"
                        "01000000"
                        "474e5500"
                        "aabbccdd00000000") +
                   build,
               8),
            "12abef");
}

class CampaignBuilds : public CampaignWithResults {
 protected:
  // Makes the program `name`: imud with another text in place of the only one that is `old`.
  std::string imud_with(const std::string& name, const std::string& old, const std::string& changed) const {
    std::string program = read_file(IMUD_BIN_DIR "/imud");
    const std::size_t at = program.find(old);
    EXPECT_NE(at, program.npos);
    EXPECT_EQ(program.find(old, at + 1), program.npos) << "the build id stands in one place";
    const std::string file = write(name, program.replace(at, old.size(), changed));
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return file;
  }
};

TEST_F(CampaignBuilds, AreNotMixed) {
  plan("seeds = \"1..8\"\nbatch = 4\n");
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  const std::string build = build_of("runs");
  ASSERT_EQ(build.size(), 40U) << "the linker writes a build id: a SHA-1";
  std::string other = build;
  other.front() = other.front() == '0' ? '1' : '0';
  const std::string imud = imud_with("other_imud", bytes_of(build), bytes_of(other));
  const auto before = shards("runs");
  const std::string difference =
      fmt::format("imud " IMUD_VERSION " is build {} there and build {} here", build, other);
  const std::vector<std::vector<std::string>> all = {{"campaign", "resume", path("runs")},
                                                     {"campaign", "repeat", path("runs"), "1"},
                                                     {"campaign", "run", path("plan.toml"), "--into", path("runs")}};
  for (const std::vector<std::string>& arguments : all) {
    const ProgramResult refused = run_program(imud, arguments);
    EXPECT_EQ(refused.exit_code, 2) << arguments[1];
    EXPECT_TRUE(contains(refused.errors, difference + "; go on with that imud, or give another folder"))
        << refused.errors;
  }
  EXPECT_EQ(shards("runs"), before);
  const ProgramResult shown = run_program(imud, {"campaign", "status", path("runs")});
  EXPECT_TRUE(contains(shown.output, "\nbuild    " + difference + ": go on with that imud")) << shown.output;
  EXPECT_EQ(nlohmann::json::parse(status("runs", {"--json"}).output)["is_of_this_imud"], true);
  // The other build has identities of its own, and the same bytes.
  ASSERT_EQ(run_program(imud, {"campaign", "run", path("plan.toml"), "--into", path("others")}).exit_code, 0);
  EXPECT_EQ(build_of("others"), other);
  EXPECT_NE(rows("others")[0]["identity"], rows("runs")[0]["identity"]);
  EXPECT_EQ(rows("others")[0]["digest"], rows("runs")[0]["digest"]);
  // A shard of the other build that was copied is damage.
  write("runs/shards/" + shard_name({4, 7}), shards("others").at(shard_name({4, 7})));
  EXPECT_TRUE(contains(status("runs").output, "is of another plan or another build of imud"));
  EXPECT_EQ(resume("runs").exit_code, 0);
  EXPECT_EQ(shards("runs").at(shard_name({0, 3})), before.begin()->second);
}

TEST_F(CampaignBuilds, AProgramWithoutAnIdHasTheDigestOfItsFile) {
  plan("seeds = \"1..2\"\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  const std::string id = bytes_of(build_of("runs")), owner("GNU\0", 4), nobody("XXX\0", 4);
  const std::string imud = imud_with("imud_without_id", owner + id, nobody + id);
  ASSERT_EQ(run_program(imud, {"campaign", "run", path("plan.toml"), "--into", path("others")}).exit_code, 0);
  Sha256Stream digest;
  digest.add(read_file(imud));
  EXPECT_EQ(build_of("others"), digest.end());
}

}  // namespace
}  // namespace imud
