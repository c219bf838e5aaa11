#include "protocols/canopen/sdo_server.hpp"

#include <boost/crc.hpp>
#include <chrono>

namespace imud::canopen {
namespace {

constexpr Nanoseconds timeout = std::chrono::seconds(1), between_bursts = std::chrono::milliseconds(1);
constexpr unsigned burst = 16;  // segments of a block that are sent at once
constexpr unsigned largest_block = 127;
constexpr std::size_t segment_size = 7;
constexpr unsigned toggle_bit = 0x10, last_bit = 0x80;

// The command of a request, and in which state of a transfer it is valid.
enum SdoCommand : unsigned {
  download_segment,
  download,
  upload,
  upload_segment,
  aborted,
  block_upload,
  block_download
};

unsigned byte(std::span<const std::byte> request, std::size_t at) noexcept {
  return std::to_integer<unsigned>(request[at]);
}

}  // namespace

void SdoServer::reset(unsigned node_id) noexcept {
  finish();
  node_id_ = node_id;
}

void SdoServer::receive(Request request, DeviceTime now, FrameBuffer& out) noexcept {
  const unsigned first = byte(request, 0), command = first >> 5;
  if (command == aborted && (first & 0x1FU) == 0) {
    if (transfer_ != Transfer::none) ++aborts_;
    finish();
    return;
  }
  if (transfer_ == Transfer::block_download) {
    block_segment(request, out);
  } else {
    switch (command) {
      case download:
        begin_download(request, now, out);
        break;
      case SdoCommand::download_segment:
        download_segment(request, now, out);
        break;
      case upload:
        begin_upload(request, out);
        break;
      case SdoCommand::upload_segment:
        upload_segment(first, out);
        break;
      case block_download:
        if ((first & 1U) != 0)
          end_block_download(request, now, out);
        else
          begin_block_download(request, out);
        break;
      case block_upload:
        if ((first & 3U) == 0)
          begin_block_upload(request, out);
        else if ((first & 3U) == 3 && transfer_ == Transfer::block_upload_start)
          start_block(now, out);
        else if ((first & 3U) == 2 && transfer_ == Transfer::block_upload)
          acknowledge_block(request, now, out);
        else if ((first & 3U) == 1 && transfer_ == Transfer::block_upload_end)
          finish();
        else
          abort(Abort::command, out);
        break;
      default:
        if (transfer_ == Transfer::none) address(request);
        abort(Abort::command, out);
        break;
    }
  }
  if (transfer_ != Transfer::none) node_.alarms.set(Alarm::sdo_timeout, now + timeout);
}

void SdoServer::time_out(FrameBuffer& out) noexcept { abort(Abort::timeout, out); }

// Reads the object that the request addresses. Returns false, after an abort, if the object cannot be read.
bool SdoServer::open(Request request, FrameBuffer& out) noexcept {
  address(request);
  size_ = done_ = 0;
  const Abort refused = node_.read(index_, sub_, std::span(data_).first(longest_text), size_);
  if (refused != Abort::none) abort(refused, out);
  return refused == Abort::none;
}

void SdoServer::begin_upload(Request request, FrameBuffer& out) noexcept {
  if (open(request, out)) answer_upload(out);
}

void SdoServer::answer_upload(FrameBuffer& out) noexcept {
  constexpr std::size_t expedited = 4;
  if (size_ > 0 && size_ <= expedited) {
    Message message = header(0x43U | static_cast<unsigned>(expedited - size_) << 2);
    std::copy_n(data_.begin(), size_, message.begin() + 4);
    answer(message, out);
    return;
  }
  Message message = header(0x41);
  write_little(size_, std::span(message).last<4>());
  answer(message, out);
  transfer_ = Transfer::upload;
  toggle_ = false;
}

void SdoServer::upload_segment(unsigned command, FrameBuffer& out) noexcept {
  if (transfer_ != Transfer::upload) return abort(Abort::command, out);
  if (((command & toggle_bit) != 0) != toggle_) return abort(Abort::toggle, out);
  const std::size_t size = std::min(segment_size, size_ - done_);
  const bool is_last = done_ + size == size_;
  Message message = {static_cast<std::byte>((toggle_ ? toggle_bit : 0U) |
                                            static_cast<unsigned>(segment_size - size) << 1 | (is_last ? 1U : 0U))};
  std::copy_n(data_.begin() + static_cast<std::ptrdiff_t>(done_), size, message.begin() + 1);
  done_ += size;
  toggle_ = !toggle_;
  answer(message, out);
  if (is_last) finish();
}

void SdoServer::begin_download(Request request, DeviceTime now, FrameBuffer& out) noexcept {
  address(request);
  const unsigned first = byte(request, 0);
  const bool is_expedited = (first & 2U) != 0, has_size = (first & 1U) != 0;
  if (is_expedited) {
    std::size_t size = 4 - (first >> 2 & 3U);
    if (!has_size) {
      const std::size_t position = find_object(index_, sub_);
      const std::size_t of_type = position < object_count ? size_of(objects[position].type) : 0;
      size = of_type != 0 ? std::min<std::size_t>(4, of_type) : 4;  // a text has all bytes of the request
    }
    store(request.subspan(4, size), header(0x60), now, out);
    return;
  }
  begin_receiving(has_size, request, out);
  if (transfer_ == Transfer::none) return;
  transfer_ = Transfer::download;
  toggle_ = false;
  answer(header(0x60), out);
}

// Prepares to receive several segments, or aborts if the object cannot be written.
void SdoServer::begin_receiving(bool has_size, Request request, FrameBuffer& out) noexcept {
  address(request);
  announced_.reset();
  if (has_size) announced_ = static_cast<std::size_t>(read_little(request.last<4>()));
  size_ = 0;
  const Abort refused = node_.check_write(index_, sub_, announced_);
  if (refused != Abort::none) return abort(refused, out);
  transfer_ = Transfer::download;
}

void SdoServer::download_segment(Request request, DeviceTime now, FrameBuffer& out) noexcept {
  if (transfer_ != Transfer::download) return abort(Abort::command, out);
  const unsigned first = byte(request, 0);
  if (((first & toggle_bit) != 0) != toggle_) return abort(Abort::toggle, out);
  if (!append(request.subspan(1, segment_size - (first >> 1 & 7U)))) return abort(Abort::too_long, out);
  const Message message = {static_cast<std::byte>(0x20U | (toggle_ ? toggle_bit : 0U))};
  toggle_ = !toggle_;
  if ((first & 1U) == 0) return answer(message, out);
  store(std::span(data_).first(size_), message, now, out);
}

bool SdoServer::append(std::span<const std::byte> bytes) noexcept {
  if (size_ + bytes.size() > data_.size()) return false;
  std::copy(bytes.begin(), bytes.end(), data_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += bytes.size();
  return true;
}

// Writes the object, and answers with `message`, or with the cause of the refusal.
void SdoServer::store(std::span<const std::byte> value, const Message& message, DeviceTime now,
                      FrameBuffer& out) noexcept {
  Abort refused = node_.check_write(index_, sub_, value.size());
  if (refused == Abort::none && announced_ && *announced_ != value.size()) refused = Abort::length;
  if (refused == Abort::none) refused = node_.write(index_, sub_, value, now);
  if (refused != Abort::none) return abort(refused, out);
  answer(message, out);
  finish();
}

void SdoServer::begin_block_download(Request request, FrameBuffer& out) noexcept {
  const unsigned first = byte(request, 0);
  has_crc_ = (first & 4U) != 0;
  begin_receiving((first & 2U) != 0, request, out);
  if (transfer_ == Transfer::none) return;
  transfer_ = Transfer::block_download;
  sequence_ = 0;
  Message message = header(0xA4);
  message[4] = static_cast<std::byte>(largest_block);
  answer(message, out);
}

// A segment out of order is not appended. The acknowledgement of the block asks for this segment again.
void SdoServer::block_segment(Request request, FrameBuffer& out) noexcept {
  const unsigned first = byte(request, 0), sequence = first & ~last_bit;
  if (sequence == 0) return abort(Abort::sequence, out);
  const bool is_last = (first & last_bit) != 0, is_next = sequence == sequence_ + 1;
  if (is_next) {
    if (!append(request.last<segment_size>())) return abort(Abort::too_long, out);
    sequence_ = sequence;
  }
  if (!is_last && sequence != largest_block) return;
  const Message message = {std::byte{0xA2}, static_cast<std::byte>(sequence_), static_cast<std::byte>(largest_block)};
  answer(message, out);
  sequence_ = 0;
  if (is_last && is_next) transfer_ = Transfer::block_download_end;
}

void SdoServer::end_block_download(Request request, DeviceTime now, FrameBuffer& out) noexcept {
  if (transfer_ != Transfer::block_download_end) return abort(Abort::command, out);
  size_ -= std::min<std::size_t>(size_, byte(request, 0) >> 2 & 7U);
  if (has_crc_ && read_little(request.subspan<1, 2>()) != crc()) return abort(Abort::crc, out);
  const Message message = {std::byte{0xA1}};
  store(std::span(data_).first(size_), message, now, out);
}

void SdoServer::begin_block_upload(Request request, FrameBuffer& out) noexcept {
  const unsigned switch_threshold = byte(request, 5);
  if (!open(request, out)) return;
  if (switch_threshold != 0 && size_ <= switch_threshold) {
    transfer_ = Transfer::none;
    return answer_upload(out);
  }
  block_size_ = byte(request, 4);
  if (block_size_ == 0 || block_size_ > largest_block) return abort(Abort::block_size, out);
  has_crc_ = (byte(request, 0) & 4U) != 0;
  Message message = header(0xC6);
  write_little(size_, std::span(message).last<4>());
  answer(message, out);
  transfer_ = Transfer::block_upload_start;
}

void SdoServer::start_block(DeviceTime now, FrameBuffer& out) noexcept {
  transfer_ = Transfer::block_upload;
  sequence_ = 0;
  continue_block(now, out);
}

void SdoServer::continue_block(DeviceTime now, FrameBuffer& out) noexcept {
  node_.alarms.clear(Alarm::sdo_block);
  if (transfer_ != Transfer::block_upload) return;
  for (unsigned i = 0; i < burst; ++i) {
    if (is_block_sent()) return;
    const std::size_t begin = done_ + sequence_ * segment_size, size = std::min(segment_size, size_ - begin);
    ++sequence_;
    Message message = {static_cast<std::byte>(sequence_ | (begin + size == size_ ? last_bit : 0U))};
    std::copy_n(data_.begin() + static_cast<std::ptrdiff_t>(begin), size, message.begin() + 1);
    answer(message, out);
  }
  if (!is_block_sent()) node_.alarms.set(Alarm::sdo_block, now + between_bursts);
}

bool SdoServer::is_block_sent() const noexcept {
  return sequence_ == block_size_ || (sequence_ > 0 && done_ + sequence_ * segment_size >= size_);
}

void SdoServer::acknowledge_block(Request request, DeviceTime now, FrameBuffer& out) noexcept {
  const unsigned acknowledged = byte(request, 1), next_size = byte(request, 2);
  if (acknowledged > sequence_ || !is_block_sent()) return abort(Abort::sequence, out);
  if (next_size == 0 || next_size > largest_block) return abort(Abort::block_size, out);
  const bool is_complete = acknowledged > 0 && done_ + acknowledged * segment_size >= size_;
  if (!is_complete) {
    done_ += acknowledged * segment_size;
    block_size_ = next_size;
    return start_block(now, out);
  }
  const std::size_t in_last = size_ - std::min(size_, done_ + (acknowledged - 1) * segment_size);
  Message message = {static_cast<std::byte>(0xC1U | static_cast<unsigned>(segment_size - in_last) << 2)};
  if (has_crc_) write_little(crc(), std::span(message).subspan<1, 2>());
  answer(message, out);
  transfer_ = Transfer::block_upload_end;
}

void SdoServer::address(Request request) noexcept {
  finish();
  index_ = static_cast<std::uint16_t>(read_little(request.subspan<1, 2>()));
  sub_ = std::to_integer<std::uint8_t>(request[3]);
}

SdoServer::Message SdoServer::header(unsigned command) const noexcept {
  Message message = {static_cast<std::byte>(command)};
  write_little(index_, std::span(message).subspan<1, 2>());
  message[3] = static_cast<std::byte>(sub_);
  return message;
}

void SdoServer::answer(const Message& message, FrameBuffer& out) const noexcept {
  send(sdo_answer_id + node_id_, message, out);
}

void SdoServer::abort(Abort code, FrameBuffer& out) noexcept {
  ++aborts_;
  Message message = header(0x80);
  write_little(static_cast<std::uint32_t>(code), std::span(message).last<4>());
  answer(message, out);
  finish();
}

void SdoServer::finish() noexcept {
  transfer_ = Transfer::none;
  announced_.reset();
  node_.alarms.clear(Alarm::sdo_timeout);
  node_.alarms.clear(Alarm::sdo_block);
}

// CRC-16 with polynomial 0x1021 from 0 (CiA 301, 7.2.4.3.16).
std::uint16_t SdoServer::crc() const noexcept {
  boost::crc_optimal<16, 0x1021, 0, 0, false, false> sum;
  sum.process_bytes(data_.data(), size_);
  return sum.checksum();
}

}  // namespace imud::canopen
