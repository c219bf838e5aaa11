// PcapngReader: the packets of a pcapng file, of all its interfaces.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "transports/capture/pcapng_writer.hpp"
#include "transports/file/file_input.hpp"

namespace imud {

// Reads the enhanced packet blocks of all sections, of either byte order and any resolution of time; skips all other
// blocks. Any content is harmless. The last block may be cut short, as kill -9 leaves it. Allocates only for a
// section header or an interface. One thread.
class PcapngReader {
 public:
  // Opens the file at the spec's address; - is standard input. Throws PortError if the file cannot be opened or
  // does not begin as pcapng.
  explicit PcapngReader(const PortSpec& spec);

  // Returns the next packet, valid until the next call; nullopt if none is there now, or at_end().
  std::optional<PcapngPacket> next() noexcept;
  // Returns true once next() will return no more packets.
  bool at_end() const noexcept { return at_end_; }
  // Describes how the file ended if it is damaged; otherwise empty.
  std::string_view end_warning() const noexcept { return {warning_.data(), warning_size_}; }

  // Returns the interfaces that the current section has declared before the last packet.
  std::span<const PcapngInterface> interfaces() const noexcept { return interfaces_; }
  // Returns the number of skipped packets: their section does not declare their interface, or they are longer than
  // longest_block.
  std::uint64_t skipped() const noexcept { return skipped_; }

  int descriptor() const noexcept { return file_.is_regular() ? -1 : file_.descriptor(); }
  std::optional<double> progress() const noexcept { return file_.progress(); }

  static constexpr std::size_t longest_block = 256 * 1024;  // bytes
  static constexpr std::size_t most_interfaces = 4096;

 private:
  // Unit and offset of an interface's time stamps, for their conversion to ns.
  struct Clock {
    std::uint8_t resolution = 6;  // if_tsresol
    std::int64_t offset_s = 0;    // if_tsoffset
  };
  using Bytes = std::span<const std::byte>;

  bool fill(std::size_t size) noexcept;
  std::optional<Bytes> next_block(std::uint32_t& type) noexcept;
  bool begin_section(Bytes start) noexcept;
  void add_interface(Bytes body) noexcept;
  std::optional<PcapngPacket> packet(Bytes body) noexcept;
  std::int64_t time_ns(std::uint64_t time, const Clock& clock) const noexcept;
  std::uint16_t u16(Bytes bytes, std::size_t at) const noexcept;
  std::uint32_t u32(Bytes bytes, std::size_t at) const noexcept;
  void end(std::string_view what) noexcept;

  FileInput file_;
  // The memory is not filled with zeros, so that a short file takes few pages of memory.
  static constexpr std::size_t buffer_size = 2 * longest_block;
  const std::unique_ptr<std::byte[]> memory_ = std::make_unique_for_overwrite<std::byte[]>(buffer_size);
  const std::span<std::byte> buffer_{memory_.get(), buffer_size};
  std::size_t begin_ = 0, end_ = 0;  // bytes that were read, but not parsed yet
  std::size_t skip_ = 0;             // bytes of a block too long for the buffer that are still to be skipped
  bool swapped_ = false;             // the section has the other byte order
  bool at_end_ = false;
  std::uint64_t blocks_ = 0, skipped_ = 0;
  std::vector<PcapngInterface> interfaces_;
  std::vector<Clock> clocks_;
  std::array<char, 160> warning_;
  std::size_t warning_size_ = 0;
};

}  // namespace imud
