// The SDO server (CiA 301, 7.2.4): uploads and downloads, expedited, segmented, and in blocks with a CRC. There is
// one transfer at a time. A new transfer replaces an unfinished one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "protocols/canopen/node.hpp"

namespace imud::canopen {

class SdoServer {
 public:
  using Request = std::span<const std::byte, 8>;

  explicit SdoServer(Node& node) noexcept : node_(node) {}

  // Ends a transfer without a message. `node_id`: requests to this node are answered from now on.
  void reset(unsigned node_id) noexcept;
  // Processes a request of 8 bytes.
  void receive(Request request, DeviceTime now, FrameBuffer& out) noexcept;
  // Aborts the transfer. Call this at Alarm::sdo_timeout.
  void time_out(FrameBuffer& out) noexcept;
  // Sends further segments of a block upload. Call this at Alarm::sdo_block.
  void continue_block(DeviceTime now, FrameBuffer& out) noexcept;

  // Returns the number of transfers that either side has aborted.
  std::uint64_t aborts() const noexcept { return aborts_; }

 private:
  enum class Transfer : std::uint8_t {
    none,
    upload,
    download,
    block_download,      // segments are awaited
    block_download_end,  // all segments were received
    block_upload_start,  // the client's start is awaited
    block_upload,        // segments are being sent, or their acknowledgement is awaited
    block_upload_end,    // all segments are acknowledged; the client's end is awaited
  };
  using Message = std::array<std::byte, 8>;

  void begin_upload(Request request, FrameBuffer& out) noexcept;
  void answer_upload(FrameBuffer& out) noexcept;
  void upload_segment(unsigned command, FrameBuffer& out) noexcept;
  void begin_download(Request request, DeviceTime now, FrameBuffer& out) noexcept;
  void download_segment(Request request, DeviceTime now, FrameBuffer& out) noexcept;
  void begin_block_download(Request request, FrameBuffer& out) noexcept;
  void block_segment(Request request, FrameBuffer& out) noexcept;
  void end_block_download(Request request, DeviceTime now, FrameBuffer& out) noexcept;
  void begin_block_upload(Request request, FrameBuffer& out) noexcept;
  void start_block(DeviceTime now, FrameBuffer& out) noexcept;
  void acknowledge_block(Request request, DeviceTime now, FrameBuffer& out) noexcept;
  bool is_block_sent() const noexcept;

  bool open(Request request, FrameBuffer& out) noexcept;
  void begin_receiving(bool has_size, Request request, FrameBuffer& out) noexcept;
  bool append(std::span<const std::byte> bytes) noexcept;
  void store(std::span<const std::byte> value, const Message& message, DeviceTime now, FrameBuffer& out) noexcept;
  void address(Request request) noexcept;
  Message header(unsigned command) const noexcept;
  void answer(const Message& message, FrameBuffer& out) const noexcept;
  void abort(Abort code, FrameBuffer& out) noexcept;
  void finish() noexcept;
  std::uint16_t crc() const noexcept;

  Node& node_;
  unsigned node_id_ = 0;
  std::uint64_t aborts_ = 0;

  Transfer transfer_ = Transfer::none;
  std::uint16_t index_ = 0;
  std::uint8_t sub_ = 0;
  std::array<std::byte, longest_text + 8> data_;  // a last segment may have up to 7 bytes too many
  std::size_t size_ = 0;                          // of the object; in a download: bytes received
  std::optional<std::size_t> announced_;          // size of a download, if the client gave it
  std::size_t done_ = 0;                          // bytes uploaded; in a block upload: bytes acknowledged
  bool toggle_ = false;
  bool has_crc_ = false;
  unsigned block_size_ = 0;  // segments
  unsigned sequence_ = 0;    // number of the last segment in the block that was sent, or received in order
};

}  // namespace imud::canopen
