#include "transports/capture/pcap_library.hpp"

#include <dlfcn.h>

#include <stdexcept>

namespace imud {
namespace {

template <class Function>
void find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(::dlsym(library, name));
  if (function == nullptr) throw std::runtime_error(::dlerror());
}

PcapLibrary load() {
  void* library = nullptr;
  for (const char* name : {"libpcap.so.0.8", "libpcap.so.1"})  // in Debian, and elsewhere
    if (library == nullptr) library = ::dlopen(name, RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(::dlerror());
  PcapLibrary pcap{};
  find(library, "pcap_open_offline_with_tstamp_precision", pcap.open_offline);
  find(library, "pcap_fopen_offline_with_tstamp_precision", pcap.fopen_offline);
  find(library, "pcap_datalink", pcap.datalink);
  find(library, "pcap_datalink_val_to_description_or_dlt", pcap.datalink_description);
  find(library, "pcap_next_ex", pcap.next_ex);
  find(library, "pcap_file", pcap.file);
  find(library, "pcap_geterr", pcap.error);
  find(library, "pcap_close", pcap.close);
  return pcap;
}

}  // namespace

const PcapLibrary& PcapLibrary::get() {
  static const PcapLibrary library = load();
  return library;
}

}  // namespace imud
