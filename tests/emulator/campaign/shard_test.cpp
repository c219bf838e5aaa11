// Shards: what is read back, what is refused, and what is left in the folder when a writer ends early.
#include "emulator/campaign/shards/shard.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/shard_arrays.hpp"
#include "emulator/ground/text_file.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"

namespace imud {
namespace {

class Shards : public testing::Test {
 protected:
  Shards() {
    std::string name = testing::TempDir() + "imud_shards_XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~Shards() override { std::filesystem::remove_all(folder_); }

  // Writes a shard of three rows, and returns its path.
  std::filesystem::path write_three() const {
    const ShardHead head{"abc", "1.2", "b1", {3, 5}};
    ShardWriter writer(folder_, head);
    for (std::uint64_t i = head.cases.first; i <= head.cases.last; ++i) writer.add(fmt::format("{{\"case\":{}}}", i));
    writer.commit();
    return folder_ / shard_name(head.cases);
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      all.push_back(entry.path().filename().string());
    return all;
  }
  static std::string fault_of(const std::filesystem::path& path) {
    std::string fault;
    return read_shard(path, fault) ? std::string() : fault;
  }

  std::filesystem::path folder_;
};

TEST_F(Shards, AreReadAsTheyAreWritten) {
  const std::filesystem::path path = write_three();
  EXPECT_EQ(path.filename(), "000000003-000000005.jsonl");
  std::string fault;
  const std::optional<Shard> shard = read_shard(path, fault);
  ASSERT_TRUE(shard) << fault;
  EXPECT_EQ(shard->head, (ShardHead{"abc", "1.2", "b1", {3, 5}}));
  EXPECT_EQ(shard->rows, (std::vector<std::string>{"{\"case\":3}", "{\"case\":4}", "{\"case\":5}"}));
  EXPECT_EQ(names(), std::vector<std::string>{"000000003-000000005.jsonl"});
  // As another program would check it: the footer is the SHA-256 of the bytes before it.
  const std::string text = read_file(path);
  const std::size_t footer = text.rfind('\n', text.size() - 2) + 1;
  Sha256Stream digest(false);
  digest.add(std::string_view(text).substr(0, footer));
  EXPECT_EQ(text.substr(footer), fmt::format("{{\"rows\":3,\"sha256\":\"{}\"}}\n", digest.end()));
}

// The cases are written in any order, by any process; a file that was removed between them lacks one.
TEST_F(Shards, HaveArraysOfAllCasesOrNone) {
  const CaseRange cases{3, 4};
  const ShardArrays arrays(folder_, {.rows = 2, .imus = {"a", "b"}});
  const std::vector<std::byte> rows = rows_without_value(2);
  const auto write = [&](std::uint64_t index, std::size_t imu) {
    std::vector<std::byte> block = rows;
    block.back() = static_cast<std::byte>(10 * index + imu);
    arrays.writer(cases, index)(imu, block);
  };
  EXPECT_FALSE(arrays.commit(cases));
  for (const bool is_removed : {true, false}) {
    write(4, 0);
    write(3, 0);
    if (is_removed) arrays.release(cases);
    write(4, 1);
    write(3, 1);
    EXPECT_EQ(arrays.commit(cases).has_value(), !is_removed);
  }
  EXPECT_EQ(names(), std::vector<std::string>{"000000003-000000004.rows"});
  const std::string text = read_file(folder_ / "000000003-000000004.rows");
  ASSERT_EQ(text.size(), 4 * rows.size());
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(text[(i + 1) * rows.size() - 1], (std::array{30, 40, 31, 41})[i]);
  EXPECT_THROW(arrays.writer(cases, 3)(2, rows), std::runtime_error);
  EXPECT_THROW(arrays.writer(cases, 3)(0, std::span(rows).first(128)), std::runtime_error);
}

TEST_F(Shards, ThatAreCutAnywhereAreNotWhole) {
  const std::filesystem::path path = write_three();
  const std::string text = read_file(path);
  for (std::size_t size = 0; size < text.size(); ++size) {
    std::ofstream(path, std::ios::binary) << text.substr(0, size);
    EXPECT_FALSE(fault_of(path).empty()) << size;
  }
  std::ofstream(path, std::ios::binary) << text.substr(0, text.find("{\"case\":5"));
  EXPECT_EQ(fault_of(path), "is cut short after 2 of 3 rows");
  std::ofstream(path, std::ios::binary) << text << text;
  EXPECT_EQ(fault_of(path), "goes on behind its footer");
}

TEST_F(Shards, WithAChangedByteAreNotWhole) {
  const std::filesystem::path path = write_three();
  const std::string text = read_file(path);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    std::ofstream(path, std::ios::binary) << changed;
    EXPECT_FALSE(fault_of(path).empty()) << i;
  }
}

TEST_F(Shards, AreNotReadUnderTheNameOfOtherCases) {
  const std::filesystem::path path = write_three(), other = folder_ / shard_name({6, 8});
  std::filesystem::rename(path, other);
  EXPECT_EQ(fault_of(other), "has the header of the cases 3..5");
}

TEST_F(Shards, AWriterThatEndsEarlyLeavesNothing) {
  {
    ShardWriter writer(folder_, {"abc", "1.2", "b1", {0, 1}});
    writer.add("{}");
    ASSERT_EQ(names().size(), 1U);
    EXPECT_TRUE(TemporaryFile::parse(names().front())) << names().front();
    EXPECT_THROW(writer.commit(), std::runtime_error);  // it lacks a row
  }
  EXPECT_EQ(names(), std::vector<std::string>());
}

// A limit of the file's size fails as a full disk does.
TEST_F(Shards, AFailedWriteIsNamed) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{1000, before.rlim_max};
  std::string fault;
  ::setrlimit(RLIMIT_FSIZE, &small);
  try {
    ShardWriter writer(folder_, {"abc", "1.2", "b1", {0, 99}});
    for (int i = 0; i < 100; ++i) writer.add(std::string(100, ' '));
    writer.commit();
  } catch (const std::runtime_error& error) {
    fault = error.what();
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_TRUE(contains(fault, "File too large")) << fault;
  EXPECT_EQ(names(), std::vector<std::string>());
}

TEST_F(Shards, OnlyAnEndedProcessOfThisHostHasLeftItsFileBehind) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  TemporaryFile file("000000000-000000099");
  EXPECT_FALSE(file.is_left_behind());
  file.process = child;
  // It has ended, but keeps its number until its parent waits for it.
  siginfo_t ended{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOWAIT), 0);
  EXPECT_TRUE(file.is_left_behind());
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  const auto parsed = TemporaryFile::parse(file.file_name());
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->name, file.name);
  EXPECT_EQ(parsed->host, file.host);
  EXPECT_EQ(parsed->space, file.space);
  EXPECT_TRUE(parsed->is_left_behind());
  // Of a container of this host, which may have the host's name, the process is another one.
  TemporaryFile of_container = file;
  of_container.space += "1";
  const auto contained = TemporaryFile::parse(of_container.file_name());
  ASSERT_TRUE(contained);
  EXPECT_FALSE(contained->is_left_behind());
  file.host = "another.host.example";
  const auto remote = TemporaryFile::parse(file.file_name());
  ASSERT_TRUE(remote);
  EXPECT_EQ(remote->host, "another.host.example");
  EXPECT_FALSE(remote->is_left_behind());
  EXPECT_FALSE(TemporaryFile::parse("000000000-000000099.jsonl"));
  EXPECT_FALSE(TemporaryFile::parse(".tmp"));
  EXPECT_FALSE(TemporaryFile::parse(".a.b.c.tmp"));
  EXPECT_FALSE(TemporaryFile::parse(".a.b.1.tmp"));
}

// The metrics of [test] are whatever the test has written.
TEST_F(Shards, NoMetricOfATestIsTheResult) {
  const auto row = [](int exit_code, bool holds) {
    return RowResult(fmt::format(
        "{{\"case\":0,\"exit_code\":{},\"ended_by\":\"end_of_capture\",\"digest\":{{}},\"expect\":{{\"a\":{}}},"
        "\"error\":null,\"test\":{{\"metrics\":{{\"exit_code\":0,\"ended_by\":\"me\"}}}}}}",
        exit_code, holds));
  };
  EXPECT_EQ(row(3, false).exit_code, 3);
  EXPECT_TRUE(row(3, false).expectation_failed);
  EXPECT_EQ(row(0, true).exit_code, 0);
}

TEST_F(Shards, AFileIsWrittenOnce) {
  EXPECT_TRUE(write_once(folder_ / "campaign.json", "first"));
  EXPECT_FALSE(write_once(folder_ / "campaign.json", "second"));
  EXPECT_EQ(read_file(folder_ / "campaign.json"), "first");
  EXPECT_EQ(names(), std::vector<std::string>{"campaign.json"});
}

TEST_F(Shards, TheFolderOfAnotherCampaignIsRefused) {
  const CampaignDescription campaign{"/a/plan.toml", "abc", 100, 10, "1.2", "b1"};
  const ResultFolder made(folder_, campaign, "seeds = 1\nbatch = 2\n");
  EXPECT_EQ(made.campaign().shard_of(99), (CaseRange{90, 99}));
  EXPECT_EQ(ResultFolder(folder_).campaign().plan, "/a/plan.toml");
  CampaignDescription other = campaign;
  other.batch = 20;  // the folder's counts
  EXPECT_EQ(ResultFolder(folder_, other, "seeds = 1\nbatch = 2\n").campaign().batch, 10U);
  const auto refusal = [&](const CampaignDescription& another, const char* text) {
    try {
      const ResultFolder folder(folder_, another, text);
    } catch (const OpenError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  other = campaign;
  other.plan_sha256 = "abd";
  EXPECT_TRUE(contains(refusal(other, "seeds = 1\nbatch = 3\n"),
                       "line 2 of the plan is `batch = 2` there and `batch = 3` here"));
  other = campaign;
  other.version = "1.3";
  EXPECT_TRUE(contains(refusal(other, "seeds = 1\nbatch = 2\n"),
                       "imud is 1.2 there and 1.3 here; go on with that imud, or give another"));
  other = campaign;
  other.build = "b2";
  EXPECT_TRUE(contains(refusal(other, "seeds = 1\nbatch = 2\n"), "imud 1.2 is build b1 there and build b2 here"));
  other.build.clear();
  EXPECT_EQ(other.difference_of_imud("1.2", "b2"),
            "imud 1.2 is of a build that is not stored there and build b2 here");
}

TEST(Sha256Stream, IsTheSameByBothLibraries) {
  for (const bool may_use_openssl : {false, true}) {
    Sha256Stream abc(may_use_openssl), nothing(may_use_openssl);
    abc.add("abc");  // FIPS 180-4, example B.1
    EXPECT_EQ(abc.end(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(nothing.end(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  }
  std::mt19937 random(1);
  Sha256Stream a(false), b(true), whole(true);
  std::string all;
  for (int i = 0; i < 300; ++i) {
    std::string piece(random() % 9000, ' ');
    for (char& c : piece) c = static_cast<char>(random());
    a.add(piece);
    b.add(piece);
    all += piece;
  }
  whole.add(all);
  const std::string digest = a.end();
  EXPECT_EQ(b.end(), digest);
  EXPECT_EQ(whole.end(), digest);
}

}  // namespace
}  // namespace imud
