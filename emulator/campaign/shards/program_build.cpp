#include "emulator/campaign/shards/program_build.hpp"

#include <elf.h>
#include <fmt/format.h>
#include <link.h>
#include <sha256.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

constexpr std::string_view name_of_gnu("GNU", 4);  // with its NUL

// For dl_iterate_phdr(3), which begins with the program itself: stops there.
int take_build_id(dl_phdr_info* program, std::size_t, void* id) {
  for (int i = 0; i < program->dlpi_phnum; ++i) {
    const auto& segment = program->dlpi_phdr[i];
    if (segment.p_type != PT_NOTE) continue;
    const auto* begin = reinterpret_cast<const std::byte*>(program->dlpi_addr + segment.p_vaddr);
    auto& text = *static_cast<std::string*>(id);
    text = build_id_in({begin, segment.p_memsz}, segment.p_align);
    if (!text.empty()) break;
  }
  return 1;
}

std::string find_build() {
  std::string id;
  ::dl_iterate_phdr(take_build_id, &id);
  if (!id.empty()) return id;
  constexpr const char* self = "/proc/self/exe";
  std::array<char, SHA256_DIGEST_STRING_LENGTH> text;
  if (::SHA256File(self, text.data()) == nullptr) throw OpenError(fmt::format("{}: {}", self, std::strerror(errno)));
  return text.data();
}

}  // namespace

std::string build_id_in(std::span<const std::byte> notes, std::size_t alignment) {
  constexpr std::size_t of_words = 4, of_wide = 8;  // 0 and 1 mean words, too
  const std::size_t step = alignment == of_wide ? of_wide : of_words;
  const auto aligned = [step](std::size_t size) { return (size + step - 1) / step * step; };
  struct Head {
    std::uint32_t name_size, size, type;
  } head{};
  while (notes.size() >= sizeof head) {
    std::memcpy(&head, notes.data(), sizeof head);
    const std::size_t begin = aligned(sizeof head + head.name_size), end = begin + head.size;
    if (end > notes.size()) break;
    const std::string_view name(reinterpret_cast<const char*>(notes.data()) + sizeof head, head.name_size);
    if (head.type == NT_GNU_BUILD_ID && name == name_of_gnu) {
      std::string id;
      for (const std::byte one : notes.subspan(begin, head.size))
        id += fmt::format("{:02x}", std::to_integer<unsigned>(one));
      return id;
    }
    notes = notes.subspan(std::min(aligned(end), notes.size()));
  }
  return {};
}

const std::string& program_build() {
  static const std::string build = find_build();
  return build;
}

}  // namespace imud
