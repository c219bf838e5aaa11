#include "emulator/drive/truth_pieces.hpp"

#include <poll.h>

#include <array>
#include <cstring>
#include <utility>

namespace imud {

namespace {

bool keeps_datagrams(const TruthConfig& config, const Port& port) {
  return port.keeps_datagrams().value_or(transport_of(config.port)->keeps_datagrams);
}

// Returns the bytes of pointers to the pieces.
class PiecePort final : public Port {
 public:
  PiecePort(std::unique_ptr<TruthPieces> pieces, std::optional<bool> keeps_datagrams)
      : pieces_(std::move(pieces)), keeps_datagrams_(keeps_datagrams) {
    counters_ = pieces_->counters();
  }
  void send(std::span<const Frame>) noexcept override {}
  std::optional<Received> receive() noexcept override {
    piece_ = pieces_->next();
    if (piece_ == nullptr) return std::nullopt;
    counters_ = pieces_->counters();
    return Received{{std::as_bytes(std::span(&piece_, 1))}, piece_->time, piece_->from, piece_->is_of_stream};
  }
  bool at_end() const noexcept override { return pieces_->at_end(); }
  std::string_view end_warning() const noexcept override {
    return at_end() ? pieces_->end_warning() : std::string_view();
  }
  std::string_view other_content() const noexcept override { return pieces_->other_content(); }
  std::optional<bool> keeps_datagrams() const noexcept override { return keeps_datagrams_; }
  std::optional<double> progress() const noexcept override { return pieces_->progress(); }

 private:
  const std::unique_ptr<TruthPieces> pieces_;
  const std::optional<bool> keeps_datagrams_;
  const TruthPiece* piece_ = nullptr;
};

// Decodes the bytes of a PiecePort.
class PieceDecoder final : public TruthDecoder {
 public:
  void feed(std::span<const std::byte> bytes, TruthInput, HostTime) noexcept override {
    std::memcpy(&piece_, bytes.data(), sizeof piece_);
    losses_ = piece_->losses;
    next_ = 0;
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    if (piece_ == nullptr || next_ == piece_->records.size()) return std::nullopt;
    const TruthRecord& record = piece_->records[next_++];
    if (record.result == TruthResult::ok) truth = record.truth;
    return record.result;
  }
  std::size_t describe(TruthResult, std::span<char> room) const noexcept override {
    if (piece_ == nullptr || next_ == 0) return 0;
    return piece_->records[next_ - 1].remark.copy(room.data(), room.size());
  }

 private:
  const TruthPiece* piece_ = nullptr;
  std::size_t next_ = 0;
};

}  // namespace

TruthPieceReader::TruthPieceReader(const TruthConfig& config)
    : port_(open_port(config.port, config.port_settings)),
      decoder_(config.format->make(config.settings)),
      input_(keeps_datagrams(config, *port_) ? TruthInput::datagram : TruthInput::stream) {
  std::array<char, 1024> remark;
  of_settings_.assign(remark.data(), decoder_->describe(TruthResult::no_state, remark));
}

void TruthPieceReader::take_all(TruthPiece& piece) {
  std::array<char, 1024> remark;
  Truth truth;
  while (const auto result = decoder_->next(truth)) {
    TruthRecord& record = piece.records.emplace_back(TruthRecord{*result, truth, {}});
    if (*result == TruthResult::ok) continue;
    record.remark.assign(remark.data(), decoder_->describe(*result, remark));
    if (*result == TruthResult::no_state && record.remark.empty()) record.remark = std::exchange(of_settings_, {});
  }
}

bool TruthPieceReader::read(TruthPiece& piece) {
  if (has_ended_) return false;
  piece.records.clear();
  piece.is_of_stream = false;
  while (true) {
    const auto received = port_->receive();
    if (port_->counters().lost_count != times_lost_) {
      times_lost_ = port_->counters().lost_count;
      decoder_->finish();
    }
    if (received) {
      time_ = received->time;
      from_ = received->from;
      piece.is_of_stream = received->is_piece;
      decoder_->feed(received->frame.bytes, received->is_piece ? TruthInput::stream : input_, time_);
      break;
    }
    if (port_->at_end()) {
      has_ended_ = true;
      if (input_ == TruthInput::stream) decoder_->end_of_file();
      break;
    }
    pollfd ready{port_->descriptor(), POLLIN, 0};
    if (ready.fd < 0) break;
    ::poll(&ready, 1, 100);
  }
  take_all(piece);
  if (has_ended_) decoder_->finish();
  piece.time = time_;
  piece.from = from_;
  piece.losses = decoder_->losses();
  return true;
}

std::unique_ptr<Port> port_of(std::unique_ptr<TruthPieces> pieces, std::optional<bool> keeps_datagrams) {
  return std::make_unique<PiecePort>(std::move(pieces), keeps_datagrams);
}

std::unique_ptr<TruthFormat> format_of_pieces(const TruthFormat& format) {
  auto own = std::make_unique<TruthFormat>(format);
  own->make = [](const Settings&) -> std::unique_ptr<TruthDecoder> { return std::make_unique<PieceDecoder>(); };
  return own;
}

}  // namespace imud
