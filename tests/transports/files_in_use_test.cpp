#include "transports/file/files_in_use.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

class FilesInUseTest : public ::testing::Test {
 protected:
  FilesInUseTest() {
    std::ofstream(input_) << "content";
    files_.add_input("pcap:" + input_ + "?port=9810", "the input");
  }
  ScratchFolder folder_;
  const std::string input_ = folder_ / "input";
  FilesInUse files_;
};

TEST_F(FilesInUseTest, AnInputIsNoOutputByAnySpelling) {
  fs::create_symlink(input_, folder_ / "link");
  fs::create_hard_link(input_, folder_ / "name");
  for (const std::string& path : {input_, folder_ / "./input", folder_ / "link", folder_ / "name"})
    EXPECT_EQ(files_.claim(path, "--json"), path + ": is the input; give another file");
  EXPECT_EQ(files_.claim(folder_ / "output", "--json"), "");
}

TEST_F(FilesInUseTest, AnOutputIsWrittenOnce) {
  EXPECT_EQ(files_.claim(folder_ / "new", "the file of --json"), "");
  EXPECT_EQ(files_.claim(folder_ / "none/../new", "the file of --data"),
            folder_ / "none/../new" + ": is the file of --json; give another file");
  EXPECT_EQ(files_.claim("-", "the file of --json"), "");
  EXPECT_EQ(files_.claim("/dev/stdout", "x"), "/dev/stdout: is the file of --json; give another file");
}

TEST_F(FilesInUseTest, ADeviceTakesSeveralOutputsAndStandardInputIsNoFile) {
  for (int i = 0; i < 2; ++i) EXPECT_EQ(files_.claim("/dev/null", "x"), "");
  for (int i = 0; i < 2; ++i) EXPECT_EQ(files_.claim("", "x"), "");
  files_.add_input("file:-", "the input");
  EXPECT_EQ(files_.claim("-", "x"), "");
}

}  // namespace
}  // namespace imud
