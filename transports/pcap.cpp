// The UDP datagrams and TCP streams of a capture file, read by libpcap.
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "transports/capture/pcap_library.hpp"
#include "transports/capture/tcp_stream.hpp"
#include "transports/capture/udp_packet.hpp"
#include "transports/file/compressed_file.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr PortOption port_option = {
    .key = "port",
    .help = "UDP port of the datagrams' destination, or TCP port at either end; without it all datagrams",
    .min = 1,
    .max = 65'535};

const PcapLibrary& library(const PortSpec& spec) {
  try {
    return PcapLibrary::get();
  } catch (const std::runtime_error& error) {
    throw spec.error(fmt::format("libpcap is missing ({}); right would be to install it", error.what()));
  }
}

class PcapPort final : public Port {
 public:
  PcapPort(const PortSpec& spec, const PortSettings& settings)
      : pcap_(library(spec)),
        port_(static_cast<std::uint16_t>(spec.integer(port_option).value_or(0))),
        admitted_(settings.from) {
    if (spec.address == "-") begin_standard_input(spec);
    // libpcap would wait for a pipe.
    std::error_code unknown;
    if (spec.address != "-" && std::filesystem::exists(spec.address, unknown) &&
        !std::filesystem::is_regular_file(spec.address, unknown))
      throw spec.error("is not a regular file; right would be a complete capture");
    std::array<char, PCAP_ERRBUF_SIZE> error{};
    if (spec.address != "-")
      compressed_ = CompressedFile::open(FileDescriptor(::open(spec.address.c_str(), O_RDONLY | O_CLOEXEC)).get());
    capture_.reset(compressed_ ? open_compressed(error.data())
                               : pcap_.open_offline(spec.address.c_str(), PCAP_TSTAMP_PRECISION_NANO, error.data()));
    if (!capture_)
      throw spec.error(
          fmt::format("{}; right would be a pcap or pcapng file, as tcpdump -w and Wireshark write",
                      compressed_ && !compressed_->error().empty() ? compressed_->error() : error.data()));
    if (const auto size = std::filesystem::file_size(spec.address, unknown); !unknown)
      size_ = static_cast<double>(size);
    link_type_ = pcap_.datalink(capture_.get());
    if (!supports_link_type(link_type_)) {
      const char* name = pcap_.datalink_description(link_type_);
      throw spec.error(
          fmt::format("captured on link type {} ({}); right would be Ethernet, Linux cooked, raw IP or "
                      "loopback",
                      link_type_, name));
    }
  }

  void send(std::span<const Frame> frames) noexcept override { counters_.dropped += frames.size(); }

  std::optional<Received> receive() noexcept override {
    constexpr int most = 1024;  // packets that are skipped in one call, so that the caller can do other work
    for (int i = 0; i < most && !at_end_; ++i) {
      if (const auto piece = next_piece()) return piece;
      if (records_end_) {
        end(*records_end_);
        break;
      }
      if (is_pipe_ && !is_readable(0)) break;
      pcap_pkthdr* record = nullptr;
      const unsigned char* bytes = nullptr;
      const int result = pcap_.next_ex(capture_.get(), &record, &bytes);
      if (result != 1) {
        records_end_ = result;
        stream_.finish();
        continue;
      }
      ++records_;
      stamp_ = stamp(*record);
      const IpPacket ip = ip_packet(link_type_, std::as_bytes(std::span(bytes, record->caplen)));
      if (ip.outcome == IpPacket::Outcome::found && ip.protocol == IpPacket::tcp)
        add_segment(tcp_segment(ip, port_));
      else if (const auto datagram = received_datagram(udp_packet(ip, port_)))
        return datagram;
    }
    return std::nullopt;
  }

  bool at_end() const noexcept override { return at_end_; }
  std::optional<double> progress() const noexcept override {
    const long position = compressed_ ? compressed_->offset() : std::ftell(pcap_.file(capture_.get()));
    if (position < 0 || size_ <= 0) return std::nullopt;
    return std::min(1.0, static_cast<double>(position) / size_);
  }
  std::string_view end_warning() const noexcept override { return {warning_.data(), warning_size_}; }
  std::string_view other_content() const noexcept override { return {content_.data(), content_size_}; }
  int descriptor() const noexcept override { return is_pipe_ ? STDIN_FILENO : -1; }

 private:
  std::optional<Received> received_datagram(const UdpPacket& packet) noexcept {
    switch (packet.outcome) {
      case UdpPacket::Outcome::truncated:
        ++counters_.truncated;
        break;
      case UdpPacket::Outcome::not_ours:
        ++counters_.not_ours;
        count_other(packet.port, false);
        break;
      case UdpPacket::Outcome::whole:
        if (admitted_ && !admitted_->admits(packet.from)) {
          ++counters_.foreign;
          counters_.foreign_from = packet.from;
          break;
        }
        ++counters_.received;
        return Received{{packet.payload}, stamp_, packet.from};
    }
    return std::nullopt;
  }

  void add_segment(const TcpSegment& segment) noexcept {
    if (segment.outcome == TcpSegment::Outcome::truncated) {
      ++counters_.truncated;
      return;
    }
    const bool is_ours =
        segment.outcome == TcpSegment::Outcome::whole && (!admitted_ || admitted_->admits(segment.from));
    if (is_ours && stream_.push(segment)) return;
    ++counters_.not_ours;
    if (!is_ours && !segment.payload.empty()) count_other(segment.to.port, true);
  }

  std::optional<Received> next_piece() noexcept {
    const std::uint64_t holes = stream_.holes();
    const auto piece = stream_.next();
    counters_.truncated += stream_.holes() - holes;
    if (!piece) return std::nullopt;
    if (piece->begins && std::exchange(had_stream_, true)) ++counters_.lost_count;
    ++counters_.received;
    return Received{{piece->bytes}, stamp_, stream_.from(), true};
  }

  // Waits for the first byte, because libpcap would not return at a signal. Without a buffer, poll() finds every
  // record that libpcap can read.
  void begin_standard_input(const PortSpec& spec) {
    struct stat status {};
    is_pipe_ = ::fstat(STDIN_FILENO, &status) != 0 || !S_ISREG(status.st_mode);
    if (!is_pipe_) return;
    std::setvbuf(stdin, nullptr, _IONBF, 0);
    if (!is_readable(-1)) throw spec.error("interrupted before its first byte");
  }
  static bool is_readable(int timeout_ms) noexcept {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    return ::poll(&input, 1, timeout_ms) > 0;
  }

  // With nanosecond precision tv_usec holds ns. An invalid stamp wraps around instead of overflowing.
  static HostTime stamp(const pcap_pkthdr& record) noexcept {
    const auto s = static_cast<std::uint64_t>(record.ts.tv_sec);
    const auto ns = static_cast<std::uint64_t>(record.ts.tv_usec);
    return {static_cast<std::int64_t>(s * 1'000'000'000U + ns)};
  }

  // Returns nullptr, and writes why to `error`, if the capture cannot be read.
  pcap_t* open_compressed(char* error) const {
    const cookie_io_functions_t functions{.read = [](void* file, char* bytes, std::size_t size) -> ssize_t {
                                            if (size == 0) return 0;
                                            const ssize_t read = static_cast<CompressedFile*>(file)->read(
                                                std::as_writable_bytes(std::span(bytes, size)));
                                            if (read < 0) errno = EIO;
                                            return read;
                                          },
                                          .write = nullptr,
                                          .seek = nullptr,
                                          .close = nullptr};
    FILE* file = ::fopencookie(compressed_.get(), "r", functions);
    if (file == nullptr) throw std::bad_alloc();
    pcap_t* capture = pcap_.fopen_offline(file, PCAP_TSTAMP_PRECISION_NANO, error);
    if (capture == nullptr) std::fclose(file);
    return capture;
  }

  // `port`: the destination of a datagram, or of a segment with data; 0: the packet was neither.
  void count_other(std::uint16_t port, bool is_tcp) noexcept {
    for (OtherPort& other : others_) {
      if (other.packets != 0 && (other.port != port || other.is_tcp != is_tcp)) continue;
      if (port == 0) return;
      other.port = port;
      other.is_tcp = is_tcp;
      ++other.packets;
      return;
    }
  }

  void describe_content() noexcept {
    // Without a port, all datagrams and no streams are received.
    if ((port_ == 0 && others_[0].packets == 0) || counters_.received + counters_.foreign + counters_.truncated != 0)
      return;
    const auto append = [this](auto format, const auto&... values) {
      const std::size_t left = content_.size() - content_size_;
      content_size_ +=
          std::min(left, fmt::format_to_n(content_.data() + content_size_, left, format, values...).size);
    };
    if (others_[0].packets == 0) return append(FMT_STRING("no UDP datagram and no TCP data in {} packets"), records_);
    for (const OtherPort& other : others_)
      if (other.packets != 0)
        append(FMT_STRING("{}{} {}{} to port {}"), content_size_ == 0 ? "" : ", ", other.packets,
               other.is_tcp ? "TCP segment" : "datagram", other.packets == 1 ? "" : "s", other.port);
    if (port_ != 0)
      append(FMT_STRING(" and none to {}"), port_);
    else
      append(FMT_STRING("; give the port of a TCP connection, at either end"));
  }

  void end(int result) noexcept {
    at_end_ = true;
    describe_content();
    if (result == PCAP_ERROR_BREAK) return;
    const std::string_view what =
        compressed_ && !compressed_->error().empty() ? compressed_->error() : pcap_.error(capture_.get());
    const bool cut_short = what == "cut short" || what.find("truncated") != what.npos;
    const auto written =
        cut_short
            ? fmt::format_to_n(warning_.data(), warning_.size(), "cut short after record {}", records_)
            : fmt::format_to_n(warning_.data(), warning_.size(), "unreadable after record {}: {}", records_, what);
    warning_size_ = std::min(written.size, warning_.size());
  }

  struct Close {
    void operator()(pcap_t* capture) const noexcept { PcapLibrary::get().close(capture); }
  };
  // The destination of datagrams or segments that are not for this port.
  struct OtherPort {
    std::uint16_t port = 0;
    bool is_tcp = false;
    std::uint64_t packets = 0;
  };

  const PcapLibrary& pcap_;
  const std::uint16_t port_;  // 0: any
  const std::optional<Endpoint> admitted_;
  std::array<OtherPort, 6> others_;             // the first ports that were found
  std::unique_ptr<CompressedFile> compressed_;  // nullptr: libpcap opens the file by itself
  std::unique_ptr<pcap_t, Close> capture_;      // closed before the file that it reads
  int link_type_ = 0;
  TcpStream stream_;
  bool had_stream_ = false;         // the capture has had a stream, so that the next one is a new stream
  HostTime stamp_;                  // of the last record
  std::optional<int> records_end_;  // the result of libpcap after the last record
  double size_ = 0;                 // bytes of the file
  bool is_pipe_ = false;            // standard input, and no regular file
  bool at_end_ = false;
  std::uint64_t records_ = 0;
  std::array<char, 400> warning_, content_;
  std::size_t warning_size_ = 0, content_size_ = 0;
};

std::optional<std::uint16_t> udp_port(const PortSpec& spec) {
  const auto port = spec.integer(port_option);
  return port ? std::optional(static_cast<std::uint16_t>(*port)) : std::nullopt;
}

}  // namespace

extern constexpr Transport pcap_transport = {
    .name = "pcap",
    .summary =
        "the UDP datagrams of a capture (pcap, pcapng, also .gz, .zst) to one port or all, or a TCP port's stream",
    .syntax = "pcap:PATH?port=N",
    .example = "pcap:flight.pcap?port=9810",
    .document = "libpcap 1.10",
    .options = {&port_option, 1},
    .keeps_datagrams = true,
    .ends = true,
    .brings_truth = true,
    .serves_device = false,
    .has_path = true,
    .reads_standard_input = true,
    .suffixes = ".pcap .pcapng *",
    .open = open_as<PcapPort>,
    .udp_port = udp_port,
};

}  // namespace imud
