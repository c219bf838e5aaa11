#include "emulator/drive/stored_truths.hpp"

#include <poll.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>

namespace imud {

namespace {

// Returns the pieces, as the bytes of pointers to them.
class StoredPort final : public Port {
 public:
  explicit StoredPort(std::shared_ptr<const StoredTruths::Content> content) : content_(std::move(content)) {
    counters_ = content_->counters;
  }
  void send(std::span<const Frame>) noexcept override {}
  std::optional<Received> receive() noexcept override {
    if (at_end()) return std::nullopt;
    piece_ = &content_->pieces[next_++];
    return Received{{std::as_bytes(std::span(&piece_, 1))}, piece_->time, piece_->from};
  }
  bool at_end() const noexcept override { return next_ == content_->pieces.size(); }
  std::string_view end_warning() const noexcept override {
    return at_end() ? std::string_view(content_->end_warning) : std::string_view();
  }
  std::string_view other_content() const noexcept override { return content_->other_content; }
  std::optional<double> progress() const noexcept override {
    return static_cast<double>(next_) / static_cast<double>(content_->pieces.size());
  }

 private:
  std::shared_ptr<const StoredTruths::Content> content_;
  const StoredTruths::Piece* piece_ = nullptr;
  std::size_t next_ = 0;
};

// Decodes the bytes of a StoredPort.
class StoredDecoder final : public TruthDecoder {
 public:
  void feed(std::span<const std::byte> bytes, TruthInput, HostTime) noexcept override {
    std::memcpy(&piece_, bytes.data(), sizeof piece_);
    losses_ = piece_->losses;
    next_ = 0;
  }
  std::optional<TruthResult> next(Truth& truth) noexcept override {
    if (piece_ == nullptr || next_ == piece_->records.size()) return std::nullopt;
    const StoredTruths::Record& record = piece_->records[next_++];
    if (record.result == TruthResult::ok) truth = record.truth;
    return record.result;
  }
  std::size_t describe(TruthResult, std::span<char> room) const noexcept override {
    if (piece_ == nullptr || next_ == 0) return 0;
    const std::string& remark = piece_->records[next_ - 1].remark;
    return remark.copy(room.data(), room.size());
  }

 private:
  const StoredTruths::Piece* piece_ = nullptr;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Port> StoredTruths::open() const { return std::make_unique<StoredPort>(content_); }

std::optional<StoredTruths> StoredTruths::read(const TruthConfig& config, std::size_t most) {
  StoredTruths stored;
  stored.content_ = std::make_shared<Content>();
  Content& content = *stored.content_;
  const auto port = open_port(config.port, config.port_settings);
  const auto decoder = config.format->make(config.settings);
  const bool keeps_datagrams = port->keeps_datagrams().value_or(transport_of(config.port)->keeps_datagrams);
  const TruthInput input = keeps_datagrams ? TruthInput::datagram : TruthInput::stream;
  std::array<char, 1024> remark;
  const auto add = [&](Piece& piece, TruthResult result, const Truth& truth) {
    Record& record = piece.records.emplace_back(Record{result, truth, {}});
    if (result != TruthResult::ok) record.remark.assign(remark.data(), decoder->describe(result, remark));
  };
  // A remark on the settings belongs to the first record without state.
  std::string of_settings(remark.data(), decoder->describe(TruthResult::no_state, remark));
  std::size_t records = 0;
  std::optional<TruthTime> newest;
  const auto take_all = [&](Piece& piece) {
    Truth truth;
    while (const auto result = decoder->next(truth)) {
      add(piece, *result, truth);
      if (*result != TruthResult::ok) continue;
      stored.ascend_ = stored.ascend_ && (!newest || *newest < truth.time);
      newest = truth.time;
    }
  };
  while (true) {
    if (const auto received = port->receive()) {
      if (received->is_piece) return std::nullopt;  // of a connection, whose ends the port counts
      Piece& piece = content.pieces.emplace_back();
      piece.time = received->time;
      piece.from = received->from;
      decoder->feed(received->frame.bytes, input, received->time);
      take_all(piece);
      piece.losses = decoder->losses();
      records += piece.records.size();
      if (records > most) return std::nullopt;
    } else if (port->at_end()) {
      break;
    } else if (pollfd ready{port->descriptor(), POLLIN, 0}; ready.fd >= 0) {
      ::poll(&ready, 1, 100);
    }
  }
  Piece& end = content.pieces.emplace_back();
  if (!keeps_datagrams) decoder->end_of_file();
  take_all(end);
  decoder->finish();
  if (content.pieces.size() > 1) {
    end.time = content.pieces[content.pieces.size() - 2].time;
    end.from = content.pieces[content.pieces.size() - 2].from;
  }
  end.losses = decoder->losses();
  content.counters = port->counters();
  content.end_warning = port->end_warning();
  content.other_content = port->other_content();
  if (!of_settings.empty())
    for (Piece& piece : content.pieces)
      for (Record& record : piece.records)
        if (record.result == TruthResult::no_state && record.remark.empty())
          record.remark = std::exchange(of_settings, {});
  stored.format_ = std::make_unique<TruthFormat>(*config.format);
  stored.format_->make = [](const Settings&) -> std::unique_ptr<TruthDecoder> {
    return std::make_unique<StoredDecoder>();
  };
  return stored;
}

}  // namespace imud
