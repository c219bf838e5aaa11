#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

static_assert(std::is_sorted(objects.begin(), objects.end(), [](const Object& a, const Object& b) {
  return a.index != b.index ? a.index < b.index : a.sub < b.sub;
}));

std::array<std::uint64_t, object_count> ObjectDictionary::listed() noexcept {
  std::array<std::uint64_t, object_count> values;
  for (std::size_t i = 0; i < object_count; ++i) values[i] = objects[i].initial;
  return values;
}

void ObjectDictionary::load(std::uint16_t first, std::uint16_t last, unsigned node_id) noexcept {
  node_id_ = node_id;
  for (std::size_t i = 0; i < object_count; ++i)
    if (objects[i].index >= first && objects[i].index <= last) values_[i] = is_stored_[i] ? stored_[i] : initial(i);
}

void ObjectDictionary::store(std::uint16_t first, std::uint16_t last) noexcept {
  for (std::size_t i = 0; i < object_count; ++i) {
    if (objects[i].source != Source::parameter || objects[i].index < first || objects[i].index > last) continue;
    stored_[i] = values_[i];
    is_stored_[i] = values_[i] != initial(i);
  }
}

void ObjectDictionary::forget(std::uint16_t first, std::uint16_t last) noexcept {
  for (std::size_t i = 0; i < object_count; ++i)
    if (objects[i].index >= first && objects[i].index <= last) is_stored_[i] = false;
}

}  // namespace imud::canopen
