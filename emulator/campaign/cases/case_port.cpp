#include "emulator/campaign/cases/case_port.hpp"

#include <array>
#include <utility>

#include "emulator/record/measurement_rows.hpp"
#include "transports/can/can_log.hpp"

namespace imud {

CasePort::CasePort(const ImuConfig& imu, std::function<void(std::string sha256)> end,
                   std::function<void(const Measurement&, DeviceTime)> receive)
    : is_can_(imu.protocol->link == Link::can),
      end_(std::move(end)),
      decoder_(receive ? decoding_port(
                             imu,
                             [receive = std::move(receive)](const Measurement& measurement, std::int64_t ns) {
                               receive(measurement, DeviceTime{ns});
                             },
                             [this] { return time_.ns; })
                       : nullptr) {}

void CasePort::send(std::span<const Frame> frames) noexcept {
  if (!is_can_) {
    for (const Frame& frame : frames) digest_.add(frame.bytes);
    NoPort::send(frames);
  } else {
    std::array<char, max_can_log_line> line;
    for (const Frame& frame : frames) {
      const std::size_t size = write_can_log(CanLogFormat::candump, frame, Nanoseconds{time_.ns}, "can0", line);
      digest_.add(std::string_view(line.data(), size));
      size > 0 ? counters_.count_sent(is_reply_) : void(++counters_.dropped);
    }
  }
  if (decoder_) decoder_->send(frames);
}

void CasePort::commit() {
  if (decoder_) decoder_->commit();
  end_(digest_.end());
}

}  // namespace imud
