#include "emulator/drive/stored_truths.hpp"

#include <utility>

namespace imud {

namespace {

class StoredPieces final : public TruthPieces {
 public:
  explicit StoredPieces(std::shared_ptr<const StoredTruths::Content> content) : content_(std::move(content)) {}
  const TruthPiece* next() noexcept override { return at_end() ? nullptr : &content_->pieces[next_++]; }
  bool at_end() const noexcept override { return next_ == content_->pieces.size(); }
  // The counters at the end of the capture.
  const PortCounters& counters() const noexcept override { return content_->counters; }
  std::optional<double> progress() const noexcept override {
    return static_cast<double>(next_) / static_cast<double>(content_->pieces.size());
  }
  std::string_view end_warning() const noexcept override { return content_->end_warning; }
  std::string_view other_content() const noexcept override { return content_->other_content; }

 private:
  const std::shared_ptr<const StoredTruths::Content> content_;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Port> StoredTruths::open() const {
  return port_of(std::make_unique<StoredPieces>(content_), keeps_datagrams_);
}

std::optional<StoredTruths> StoredTruths::read(const TruthConfig& config, std::size_t most) {
  StoredTruths stored;
  stored.content_ = std::make_shared<Content>();
  Content& content = *stored.content_;
  TruthPieceReader reader(config);
  stored.keeps_datagrams_ = reader.port().keeps_datagrams();
  std::size_t records = 0;
  std::optional<TruthTime> newest;
  for (TruthPiece piece; reader.read(piece); piece = {}) {
    if (piece.is_of_stream) return std::nullopt;  // the counters of the end would end its streams at once
    records += piece.records.size();
    if (records > most) return std::nullopt;
    for (const TruthRecord& record : piece.records) {
      if (record.result != TruthResult::ok) continue;
      stored.ascend_ = stored.ascend_ && (!newest || *newest < record.truth.time);
      newest = record.truth.time;
    }
    content.pieces.push_back(std::move(piece));
  }
  content.counters = reader.port().counters();
  content.end_warning = reader.port().end_warning();
  content.other_content = reader.port().other_content();
  stored.format_ = format_of_pieces(*config.format);
  return stored;
}

}  // namespace imud
