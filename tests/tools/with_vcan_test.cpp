// tools/with-vcan when its guest does not boot: linux.uml is a script here, and so is c++.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>

#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

class WithVcanTest : public ::testing::Test {
 protected:
  ~WithVcanTest() override {
    if (!log_.empty()) fs::remove(log_);
  }

  // A program in the PATH of with-vcan.
  void make_script(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << "#!/bin/bash\n" << text << '\n';
    fs::permissions(folder_ / name, fs::perms::owner_all);
  }

  // Runs `true` in the guest, which must fail with one line. Returns that line without the name of the log.
  std::string failure(const std::vector<std::string>& environment = {}) {
    std::vector<std::string> arguments{"-u", "WITH_VCAN_PRELOAD", "WITH_VCAN=uml", "TMPDIR=" + folder_ / "",
                                       "PATH=" + folder_ / "" + ":/usr/sbin:/usr/bin:/sbin:/bin"};
    arguments.insert(arguments.end(), environment.begin(), environment.end());
    arguments.insert(arguments.end(), {IMUD_SOURCE_DIR "/tools/with-vcan", "true"});
    const ProgramResult result = run_program("/usr/bin/env", arguments);
    EXPECT_EQ(result.exit_code, 125);
    EXPECT_EQ(result.output, "");
    EXPECT_EQ(lines_of(result.errors).size(), 1u) << result.errors;
    std::smatch match;
    if (!std::regex_match(result.errors, match, std::regex("with-vcan: (.*) \\(log: (.*)\\)\n")))
      return result.errors;
    log_ = match[2];
    return match[1];
  }
  // Returns the content of the log that failure() names.
  std::string log() const { return read_file(log_); }

  ScratchFolder folder_;
  std::string log_;
};

constexpr const char* fp_panic =
    "echo 'userspace - ptrace set fp regs failed, errno = 14'\n"
    "echo 'Kernel panic - not syncing: Attempted to kill init! exitcode=0x0000000b'\n"
    "for i in {1..50}; do echo \" [<606944ba>] ? _printk+0x0/0x94\"; done";

TEST_F(WithVcanTest, APanicIsOneLineAndTheLogStays) {
  make_script("linux.uml",
              "echo 'Linux version 6.1'\necho 'Kernel panic - not syncing: VFS: no root'\necho '<4>Stack:'");
  EXPECT_EQ(failure(),
            "the guest did not boot: Kernel panic - not syncing: VFS: no root; use a host that has vcan (as root: "
            "modprobe vcan), or see the log");
  EXPECT_EQ(log(), "Linux version 6.1\nKernel panic - not syncing: VFS: no root\n<4>Stack:\n");
}

TEST_F(WithVcanTest, WithoutAPanicTheLastLineIsTheCause) {
  make_script("linux.uml", "echo early\nprintf '<3>ip: not supported\\r\\nreboot: System halted\\n\\n'");
  EXPECT_TRUE(failure().starts_with("the guest did not boot: ip: not supported; use a host")) << log();
}

TEST_F(WithVcanTest, AGuestWithoutAMessageFailsWithOne) {
  make_script("linux.uml", "exit 3");
  EXPECT_TRUE(failure().starts_with("the guest did not boot: linux.uml left no message; ")) << log();
  ASSERT_FALSE(log_.empty());
  EXPECT_TRUE(fs::exists(log_));
}

TEST_F(WithVcanTest, AGuestMayDieLater) {
  make_script("linux.uml", "echo >&8\necho 'Kernel panic - not syncing: later'");
  EXPECT_TRUE(failure().starts_with("the guest died: Kernel panic - not syncing: later; ")) << log();
}

TEST_F(WithVcanTest, AStateTooLargeHasThreeRemedies) {
  make_script("linux.uml", fp_panic);
  make_script("c++", "echo 'no such compiler'\nexit 1");
  EXPECT_EQ(failure(),
            "the guest did not boot: it needs " IMUD_SOURCE_DIR
            "/tools/vcan/xstate_preload.cpp on this processor, which c++ could not compile: run " IMUD_SOURCE_DIR
            "/tools/setup");
  EXPECT_TRUE(log().starts_with("no such compiler\nuserspace - ptrace set fp regs")) << log();
  EXPECT_EQ(lines_of(log()).size(), 53u);
  fs::remove(log_);

  EXPECT_EQ(failure({"WITH_VCAN_PRELOAD=" IMUD_BIN_DIR "/libxstate_preload.so"}),
            "the guest did not boot: it cannot set the extended state of this processor: use a host that has vcan "
            "(as root: modprobe vcan)");
  fs::remove(log_);

  std::ofstream(folder_ / "no_library");
  EXPECT_TRUE(failure({"WITH_VCAN_PRELOAD=" + folder_ / "no_library"})
                  .starts_with("the guest did not boot: ld.so refused the library"))
      << log();
}

TEST_F(WithVcanTest, OtherCausesHaveTheirRemedies) {
  const std::pair<const char*, const char*> causes[] = {
      {"/tmp must be not mounted noexec", "set TMPDIR"},
      {"Bus error - the host /dev/shm or /tmp mount likely just ran out of space", "set WITH_VCAN_MEM to less"},
      {"setup_physmem - mapping 521117696 bytes of memory at 0x0 failed - errno = -12", "to less than 300M"},
      {"Kernel panic - not syncing: System is deadlocked on memory", "300M of memory are not enough"},
      {"Checking that ptrace can change system call numbers...ptrace: Operation not permitted",
       "--cap-add=SYS_PTRACE"},
  };
  for (const auto& [logged, remedy] : causes) {
    make_script("linux.uml", std::string("echo '") + logged + "'");
    EXPECT_NE(failure({"WITH_VCAN_MEM=300M"}).find(remedy), std::string::npos) << logged;
    EXPECT_EQ(log(), std::string(logged) + '\n');
    fs::remove(log_);
  }
}

TEST_F(WithVcanTest, TheGuestsKernelGetsTheLibrary) {
  make_script("linux.uml", "readlink \"$LD_PRELOAD\" || cat \"$LD_PRELOAD\"");
  std::ofstream(folder_ / "library");
  EXPECT_TRUE(failure({"WITH_VCAN_PRELOAD=" + folder_ / "library"}).starts_with("the guest did not boot: ")) << log();
  EXPECT_NE(log().find(fs::canonical(folder_ / "library").string() + "\n"), std::string::npos) << log();
  fs::remove(log_);

  make_script("c++", "while [[ $1 != -o ]]; do shift; done; echo 'compiled for the run' >\"$2\"");
  failure();
  EXPECT_NE(log().find("compiled for the run\n"), std::string::npos) << log();
}

TEST_F(WithVcanTest, ALibraryThatIsNotThereIsNamed) {
  make_script("linux.uml", "");
  EXPECT_EQ(failure({"WITH_VCAN_PRELOAD=/nowhere/library"}),
            "with-vcan: WITH_VCAN_PRELOAD=/nowhere/library: cannot be read\n");
}

}  // namespace
}  // namespace imud
