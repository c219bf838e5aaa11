#include "emulator/drive/read_ahead.hpp"

#include <utility>

namespace imud {

namespace {

class PiecesAhead final : public TruthPieces {
 public:
  PiecesAhead(ReadAhead::Ring& ring, const Port& port) : ring_(ring), port_(port) {}

  const TruthPiece* next() noexcept override {
    if (batch_ == nullptr || next_ == batch_->count) {
      if (at_end()) return nullptr;
      if (batch_ != nullptr) ring_.give_back();
      batch_ = &ring_.next_filled();
      next_ = 0;
      if (batch_->count == 0) return nullptr;  // the end
    }
    item_ = &batch_->items[next_++];
    return &item_->piece;
  }
  bool at_end() const noexcept override { return batch_ != nullptr && batch_->is_last && next_ == batch_->count; }
  const PortCounters& counters() const noexcept override { return item_ != nullptr ? item_->counters : none_; }
  std::optional<double> progress() const noexcept override {
    return item_ != nullptr && item_->progress >= 0 ? std::optional(item_->progress) : std::nullopt;
  }
  // The thread that reads has ended when the last batch has come.
  std::string_view end_warning() const noexcept override { return port_.end_warning(); }
  std::string_view other_content() const noexcept override {
    return at_end() ? port_.other_content() : std::string_view();
  }

 private:
  ReadAhead::Ring& ring_;
  const Port& port_;
  const ReadAhead::Batch* batch_ = nullptr;
  const ReadAhead::Item* item_ = nullptr;
  std::size_t next_ = 0;
  const PortCounters none_;
};

}  // namespace

ReadAhead::ReadAhead(const TruthConfig& config)
    : reader_(config), format_(format_of_pieces(*config.format)), thread_([this] { run(); }) {}

ReadAhead::~ReadAhead() {
  stop_ = true;
  ring_.give_back();  // in case the thread waits
  thread_.join();
}

std::unique_ptr<Port> ReadAhead::open() {
  return port_of(std::make_unique<PiecesAhead>(ring_, reader_.port()), reader_.port().keeps_datagrams());
}

void ReadAhead::run() noexcept {
  for (bool is_last = false; !is_last && !stop_;) {
    Batch& batch = ring_.next_free();
    if (stop_) return;
    fill(batch);
    is_last = batch.is_last;
    ring_.publish();
  }
}

void ReadAhead::fill(Batch& batch) {
  constexpr std::size_t most_pieces = 128, most_records = 128;
  batch.count = 0;
  for (std::size_t records = 0; batch.count < most_pieces && records < most_records && !batch.is_last;) {
    if (batch.count == batch.items.size()) batch.items.emplace_back();
    Item& item = batch.items[batch.count];
    batch.is_last = !reader_.read(item.piece);
    if (batch.is_last) return;
    ++batch.count;
    records += item.piece.records.size();
    item.counters = reader_.port().counters();
    item.progress = reader_.port().progress().value_or(-1);
  }
}

}  // namespace imud
