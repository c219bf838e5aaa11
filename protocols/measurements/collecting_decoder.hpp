// CollectingDecoder: a decoder whose measurements may be complete only when the next one begins.
#pragma once

namespace imud {

// A Decoder that combines the messages of a sample, of which some may be missing, implements this, too.
class CollectingDecoder {
 public:
  virtual ~CollectingDecoder() = default;

  // Returns true if a measurement has begun with a frame that was fed, and a later frame may still belong to it.
  virtual bool holds_measurement() const noexcept = 0;
};

}  // namespace imud
