#include "transports/capture/pcapng_merge.hpp"

#include <cerrno>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "transports/capture/pcapng_reader.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

constexpr std::size_t batch_size = 256 * 1024;

// A file, its next packet, and the interfaces that were written for it.
class Source {
 public:
  Source(MergedCapture& capture, std::vector<std::byte>& out, std::uint32_t& interfaces)
      : capture_(capture), reader_(PortSpec{"record", capture.path, {}}), out_(out), count_(interfaces) {
    advance();
    for (std::size_t i = 0; i < reader_.interfaces().size(); ++i) static_cast<void>(number_of(i));
  }

  const std::optional<PcapngPacket>& next() const noexcept { return next_; }

  // Appends the next packet, and reads the one after it.
  void pass_on() {
    PcapngPacket packet = *next_;
    packet.interface = number_of(packet.interface);
    append_packet(out_, packet);
    ++capture_.packets;
    advance();
  }

 private:
  struct Written {
    PcapngInterface interface;
    std::uint32_t number = 0;
  };

  void advance() {
    next_.reset();
    while (!next_ && !reader_.at_end()) next_ = reader_.next();
    if (!next_) capture_.end_warning = reader_.end_warning();
  }

  // Returns the number of an interface of the present section in the merged file. A further section, which a further
  // file of a record begins, usually has the interfaces of the one before.
  std::uint32_t number_of(std::size_t index) {
    const PcapngInterface& interface = reader_.interfaces()[index];
    const auto is_same = [&](const Written& one) {
      return one.interface.name == interface.name && one.interface.link_type == interface.link_type;
    };
    if (index < written_.size() && is_same(written_[index])) return written_[index].number;
    for (const Written& one : written_)
      if (is_same(one)) return one.number;
    append_interface(out_, {interface.link_type, capture_.prefix + interface.name});
    written_.push_back({interface, count_});
    return count_++;
  }

  MergedCapture& capture_;
  PcapngReader reader_;
  std::vector<std::byte>& out_;
  std::uint32_t& count_;
  std::optional<PcapngPacket> next_;
  std::vector<Written> written_;
};

}  // namespace

bool is_pcapng(const std::string& path) {
  try {
    PcapngReader(PortSpec{"record", path, {}});
    return true;
  } catch (const PortError&) {
    return false;
  }
}

int merge_pcapng(std::span<MergedCapture> captures, int file, std::string_view application,
                 const std::atomic<bool>& stop) {
  std::vector<std::byte> out;
  append_section(out, application);
  std::uint32_t interfaces = 0;
  std::deque<Source> sources;
  for (MergedCapture& one : captures) sources.emplace_back(one, out, interfaces);
  while (true) {
    Source* earliest = nullptr;
    for (Source& one : sources)
      if (one.next() && (earliest == nullptr || one.next()->time_ns < earliest->next()->time_ns)) earliest = &one;
    if (earliest != nullptr) earliest->pass_on();
    if (earliest != nullptr && out.size() < batch_size) continue;
    if (const int error = write_whole(file, out); error != 0) return error;
    out.clear();
    if (earliest == nullptr) return 0;
    if (stop) return ECANCELED;
  }
}

}  // namespace imud
