#include "emulator/record/record_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "emulator/ground/text_file.hpp"
#include "emulator/record/record_pieces.hpp"
#include "transports/file/file_lock.hpp"

namespace imud {

namespace {

constexpr std::size_t large_batch = 256 * 1024;

[[noreturn]] void fail(const std::string& path, int error) {
  throw OpenError(error == EWOULDBLOCK ? fmt::format("{}: is written by another process; give another file", path)
                                       : fmt::format("{}: {}", path, std::strerror(error)));
}

// Empties a regular file.
void empty(int file) noexcept {
  struct stat status {};
  if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode) && ::ftruncate(file, 0) != 0) errno = 0;
}

FileDescriptor create(const std::string& path) {
  if (path == "-") return FileDescriptor(::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0));
  return FileDescriptor(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOCTTY, 0666));
}

}  // namespace

RecordFile::RecordFile(const RecordOptions& options, RecordCounters& counters)
    : options_(options), counters_(counters) {
  batch_.reserve(2 * large_batch);
  packet_.reserve(large_batch);
  for (const std::string& piece : pieces_of(options_)) {
    const FileDescriptor file(::open(piece.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
    if (!lock_file(file.get())) fail(piece, EWOULDBLOCK);
  }
  if (!open_next()) fail(path_, errno);
}

std::string RecordFile::numbered(std::uint64_t number) const {
  if (options_.max_bytes == 0) return options_.file;
  return piece_of(options_, number);
}

// Opens the next file, and removes the file that exceeds RecordOptions::max_files.
bool RecordFile::open_next() {
  path_ = numbered(number_ + 1);
  FileDescriptor next = create(path_);
  if (!next) return false;
  if (path_ != "-" && !lock_file(next.get())) {
    errno = EWOULDBLOCK;
    return false;
  }
  if (number_ > 0) empty(next.get());
  file_ = std::move(next);
  ++number_;
  size_ = 0;
  has_head_ = false;
  counters_.files.count();
  if (options_.max_files > 0 && number_ > options_.max_files)
    ::unlink(numbered(number_ - options_.max_files).c_str());
  return true;
}

void RecordFile::begin(Head head, HostTime now) {
  if (path_ != "-") empty(file_.get());
  for (const std::string& piece : pieces_of(options_))
    if (piece != path_) ::unlink(piece.c_str());
  head_ = std::move(head);
  time_ns_ = now.ns + head_.offset_ns;
  append_head();
  flush();
}

void RecordFile::append_event(const RecordEvent& event) {
  append_packet(batch_, {.interface = 0, .time_ns = time_ns_, .bytes = encode_record_event(event)});
}

void RecordFile::append_head() {
  append_section(batch_, "imud " IMUD_VERSION);
  for (const PcapngInterface& interface : head_.interfaces) append_interface(batch_, interface);
  append_event({RecordEvent::Type::begin, head_.flags, 0, head_.offset_ns, static_cast<std::int64_t>(number_),
                RecordEvent::version});
  constexpr std::size_t piece = 64 * 1024;
  for (std::span<const char> rest = head_.config; !rest.empty(); rest = rest.subspan(std::min(piece, rest.size())))
    append_packet(
        batch_,
        {.interface = 1, .time_ns = time_ns_, .bytes = std::as_bytes(rest.first(std::min(piece, rest.size())))});
}

void RecordFile::add(const PacketRing::Head& head, std::span<const std::byte> bytes) {
  time_ns_ = head.time.ns + head_.offset_ns;
  if (batch_.empty() && !has_head_) append_head();
  if (batch_.empty() && missing_ > 0)
    append_event({.type = RecordEvent::Type::lost, .a = static_cast<std::int64_t>(missing_)});
  const std::uint16_t link = head_.interfaces[head.interface].link_type;
  packet_.clear();
  if (link == link_type::can_socketcan)
    append_can_packet(packet_, {bytes, head.can});
  else if (link == link_type::raw_ip && head.direction == PacketDirection::outbound)
    append_udp_packet(packet_, bytes, head_.truth, head.peer);
  else if (link == link_type::raw_ip)
    append_udp_packet(packet_, bytes, head.peer, head_.truth);
  const bool is_wrapped = link == link_type::can_socketcan || link == link_type::raw_ip;
  append_packet(batch_, {head.interface, time_ns_, head.direction, is_wrapped ? packet_ : bytes});
  ++packets_;
  if (batch_.size() >= large_batch || (options_.max_bytes > 0 && size_ + batch_.size() >= options_.max_bytes))
    flush();
}

void RecordFile::flush() {
  if (batch_.empty()) return;
  if (write_batch()) {
    size_ += batch_.size();
    counters_.bytes.count(batch_.size());
    counters_.packets.count(packets_);
    has_head_ = true;
    missing_ = 0;
  } else {
    counters_.lost.count(packets_);
    missing_ += packets_;
  }
  batch_.clear();
  packets_ = 0;
  if (options_.max_bytes > 0 && size_ >= options_.max_bytes && !open_next()) counters_.error = errno;
}

// Returns false if the file did not take the whole batch. A regular file then keeps nothing of the batch.
bool RecordFile::write_batch() noexcept {
  for (std::size_t written = 0; written < batch_.size();) {
    const ssize_t size = ::write(file_.get(), batch_.data() + written, batch_.size() - written);
    if (size < 0 && errno == EINTR) continue;
    if (size > 0) {
      written += static_cast<std::size_t>(size);
      continue;
    }
    counters_.error = size < 0 ? errno : ENOSPC;
    if (::ftruncate(file_.get(), static_cast<off_t>(size_)) == 0)
      ::lseek(file_.get(), static_cast<off_t>(size_), SEEK_SET);
    return false;
  }
  return true;
}

}  // namespace imud
