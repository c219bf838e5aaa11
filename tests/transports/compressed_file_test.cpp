// Files compressed by gzip and zstd: whole, cut short, damaged; and the ports that read them.
#include "transports/file/compressed_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/stat.h>

#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "tests/support/compressed.hpp"
#include "tests/transports/capture_builder.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

// Bytes that are half compressible.
std::string content_of_size(std::size_t size) {
  std::mt19937_64 random(1);
  std::string bytes;
  while (bytes.size() < size) bytes += std::to_string(random()) + ",0.000000,";
  bytes.resize(size);
  return bytes;
}

struct Content {
  std::string bytes;
  std::string error;  // "" after a file that has ended whole
};

struct Compression {
  const char* suffix;
  std::string (*compress)(const std::string& bytes);
};

class CompressedFiles : public testing::TestWithParam<Compression> {
 protected:
  std::string compress(const std::string& bytes) const { return GetParam().compress(bytes); }

  std::unique_ptr<CompressedFile> open(const std::string& file) const {
    std::ofstream(path_, std::ios::binary) << file;
    return CompressedFile::open(FileDescriptor(::open(path_.c_str(), O_RDONLY | O_CLOEXEC)).get());
  }
  Content read(const std::string& file, std::size_t room = 5000) const {
    const auto opened = open(file);
    if (!opened) return {{}, "not compressed"};
    Content content;
    std::vector<std::byte> bytes(room);
    while (const ssize_t size = opened->read(bytes)) {
      if (size < 0) {
        EXPECT_FALSE(opened->error().empty());
        EXPECT_EQ(opened->read(bytes), -1) << "the error stays";
        content.error = opened->error();
        return content;
      }
      content.bytes.append(reinterpret_cast<const char*>(bytes.data()), static_cast<std::size_t>(size));
    }
    EXPECT_EQ(opened->error(), "");
    EXPECT_EQ(opened->read(bytes), 0) << "the end stays";
    return content;
  }

  const ScratchFolder folder_;
  const std::string path_ = folder_ / "file";
};

INSTANTIATE_TEST_SUITE_P(, CompressedFiles, testing::Values(Compression{".gz", gzip}, Compression{".zst", zstd}),
                         [](const auto& test) { return std::string(test.param.suffix + 1); });

TEST_P(CompressedFiles, AreReadWhole) {
  const std::string bytes = content_of_size(300'000);
  for (const std::size_t room : {1UL, 7UL, 4096UL, 4097UL, 1'000'000UL}) {
    const std::string part = room == 1 ? bytes.substr(0, 10'000) : bytes;
    EXPECT_TRUE(read(compress(part), room).bytes == part) << room;
  }
  const std::string members = compress(bytes) + compress("") + compress("in the middle") + compress(bytes);
  const Content all = read(members);
  EXPECT_EQ(all.error, "");
  EXPECT_TRUE(all.bytes == bytes + "in the middle" + bytes);
  EXPECT_EQ(read(compress("")).error, "");
}

TEST_P(CompressedFiles, CutShortIsAnErrorAfterTheBytesThatAreThere) {
  const std::string bytes = content_of_size(1000), file = compress(bytes) + compress(bytes);
  const std::size_t first = compress(bytes).size();
  ASSERT_GT(first, 300U);
  for (std::size_t size = 4; size < file.size(); ++size) {
    const Content content = read(file.substr(0, size));
    if (size == first) {
      EXPECT_EQ(content.error, "");
      continue;
    }
    EXPECT_EQ(content.error, "cut short") << size;
    EXPECT_TRUE((bytes + bytes).starts_with(content.bytes)) << size;
  }
  EXPECT_TRUE(read(file.substr(0, file.size() - 1)).bytes.starts_with(bytes));
}

// A flipped bit may be without effect (a header has the time of the compression). Otherwise it is found.
TEST_P(CompressedFiles, NoDamageIsOverlooked) {
  const std::string bytes = content_of_size(300), file = compress(bytes) + compress(bytes);
  std::size_t found = 0;
  for (std::size_t bit = 32; bit < 8 * file.size(); ++bit) {
    std::string damaged = file;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    const Content content = read(damaged);
    if (content.error.empty())
      EXPECT_TRUE(content.bytes == bytes + bytes) << bit;
    else
      ++found;
  }
  EXPECT_GT(found, 4 * file.size());
  EXPECT_FALSE(read(file + "junk").error.empty());
}

TEST_P(CompressedFiles, OtherFilesAreNot) {
  for (const std::string file : {"", "a", "time_ns,sigma_BN_1", "\x1F", "\xD4\xC3\xB2\xA1 capture"})
    EXPECT_EQ(open(file), nullptr);
  const std::string fifo = folder_ / "fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_EQ(CompressedFile::open(FileDescriptor(::open(fifo.c_str(), O_RDONLY | O_NONBLOCK)).get()), nullptr);
  EXPECT_EQ(CompressedFile::open(-1), nullptr);
}

TEST_P(CompressedFiles, NothingIsAllocatedAfterOpening) {
  const std::string bytes = content_of_size(300'000);
  const auto opened = open(compress(bytes));
  ASSERT_NE(opened, nullptr);
  std::vector<std::byte> room(10'000);
  const std::size_t used = ::mallinfo2().uordblks;  // the libraries are C
  while (opened->read(room) > 0) EXPECT_EQ(::mallinfo2().uordblks, used);
}

// Returns all bytes and the warning of a port.
Content read_port(const std::string& spec) {
  const auto port = open_port(spec, Role::listener);
  Content content;
  while (!port->at_end())
    if (const auto received = port->receive())
      content.bytes.append(reinterpret_cast<const char*>(received->frame.bytes.data()), received->frame.bytes.size());
  content.error = port->end_warning();
  return content;
}

TEST_P(CompressedFiles, ArePortsAsTheirContentIs) {
  const std::string suffix = GetParam().suffix, csv = content_of_size(500'000);  // several blocks of zstd
  capture::write_file(folder_ / "x.csv" + suffix, compress(csv));
  EXPECT_TRUE(read_port("file:" + folder_ / "x.csv" + suffix).bytes == csv);
  capture::write_file(folder_ / "x.csv" + suffix, compress(csv).substr(0, compress(csv).size() / 2));
  const Content cut = read_port("file:" + folder_ / "x.csv" + suffix);
  EXPECT_EQ(cut.error, "cut short");
  EXPECT_TRUE(csv.starts_with(cut.bytes) && !cut.bytes.empty());

  for (const bool pcapng : {false, true}) {
    const capture::Format format{pcapng, false, true};
    capture::Bytes bytes = capture::file_header(format, 1);
    std::string wanted;
    for (int i = 0; i < 10'000; ++i) {
      wanted += std::to_string(i);
      const capture::Bytes packet = capture::udp(std::to_string(i), 9810);
      bytes += capture::file_record(format, {i, capture::ethernet(0x0800, capture::ipv4(packet))});
    }
    const std::string path = folder_ / "x.pcap" + suffix;
    capture::write_file(path, compress(bytes));
    const Content whole = read_port("pcap:" + path + "?port=9810");
    EXPECT_TRUE(whole.bytes == wanted);
    EXPECT_EQ(whole.error, "");
    const std::string file = compress(bytes);
    capture::write_file(path, file.substr(0, file.size() / 2));
    const Content half = read_port("pcap:" + path);
    EXPECT_TRUE(half.error.starts_with("cut short after record ")) << half.error;
    EXPECT_TRUE(wanted.starts_with(half.bytes) && !half.bytes.empty());
    // All packets are there, but not the checksum.
    capture::write_file(path, file.substr(0, file.size() - 1));
    EXPECT_EQ(read_port("pcap:" + path).error, "cut short after record 10000");
    std::string damaged = file;
    damaged.back() = static_cast<char>(~damaged.back());
    capture::write_file(path, damaged);
    const std::string error = read_port("pcap:" + path).error;
    EXPECT_TRUE(error.starts_with("unreadable after record ")) << error;
  }
  capture::write_file(folder_ / "y.pcap", compress("no capture"));
  EXPECT_TRUE(mentions(error_of("pcap:" + folder_ / "y.pcap", Role::listener), "right would be a pcap"));
}

TEST_P(CompressedFiles, AreFoundByTheNameBeforeTheSuffix) {
  const std::string suffix = GetParam().suffix;
  EXPECT_EQ(capture_port("a.csv" + suffix), "file:a.csv" + suffix);
  EXPECT_EQ(capture_port("a.pcap" + suffix + "?port=9"), "pcap:a.pcap" + suffix + "?port=9");
  EXPECT_EQ(capture_port("a" + suffix), "pcap:a" + suffix);
}

}  // namespace
}  // namespace imud
