#include "transports/capture/pcap_library.hpp"

#include "transports/loaded_library.hpp"

namespace imud {
namespace {

PcapLibrary load() {
  const LoadedLibrary library({"libpcap.so.0.8", "libpcap.so.1"}, "libpcap0.8");  // in Debian, and elsewhere
  PcapLibrary pcap{};
  library.find("pcap_open_offline_with_tstamp_precision", pcap.open_offline);
  library.find("pcap_fopen_offline_with_tstamp_precision", pcap.fopen_offline);
  library.find("pcap_datalink", pcap.datalink);
  library.find("pcap_datalink_val_to_description_or_dlt", pcap.datalink_description);
  library.find("pcap_next_ex", pcap.next_ex);
  library.find("pcap_file", pcap.file);
  library.find("pcap_geterr", pcap.error);
  library.find("pcap_close", pcap.close);
  return pcap;
}

}  // namespace

const PcapLibrary& PcapLibrary::get() {
  static const PcapLibrary library = load();
  return library;
}

}  // namespace imud
