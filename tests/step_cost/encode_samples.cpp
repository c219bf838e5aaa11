// encode_samples PRODUCT device|described|motion SAMPLES: makes so many samples, and their frames by the product's
// C++ or by the description of the same stream; `motion` makes no frames.
#include <cstdio>
#include <cstdlib>

#include "tests/protocols/frames/frame_like_devices.hpp"

int main(int argc, char** argv) {
  using namespace imud;
  if (argc != 4) return 2;
  const std::string_view product = argv[1], by = argv[2];
  for (const FrameLikeDevice& like : frame_like_devices()) {
    if (like.product != product) continue;
    const Protocol& protocol = protocol_named(product);
    Line line =
        by == "described" ? frame_line(like.description) : Line(protocol, settings_of(protocol, like.settings));
    FrameMotion motion(like.rate_hz);
    std::size_t bytes = 0;
    for (long k = std::atol(argv[3]); k > 0; --k) {
      const Sample sample = motion.next();
      asm volatile("" : : "m"(sample));  // made even if nothing is sent
      if (by == "motion") continue;
      for (const Frame& frame : line.encode(sample)) bytes += frame.bytes.size();
    }
    std::printf("%zu\n", bytes);
    return 0;
  }
  return 2;
}
