// PcapLibrary: the functions of libpcap that read captures.
#pragma once

#include <pcap/pcap.h>

namespace imud {

// libpcap is loaded when the first capture is opened. A program that is linked to libpcap would load it at every
// start, together with D-Bus, systemd and five further libraries, which libpcap needs only for live captures.
struct PcapLibrary {
  decltype(&::pcap_open_offline_with_tstamp_precision) open_offline;
  decltype(&::pcap_fopen_offline_with_tstamp_precision) fopen_offline;
  decltype(&::pcap_datalink) datalink;
  decltype(&::pcap_datalink_val_to_description_or_dlt) datalink_description;
  decltype(&::pcap_next_ex) next_ex;
  decltype(&::pcap_file) file;
  decltype(&::pcap_geterr) error;
  decltype(&::pcap_close) close;

  // Loads the library at the first call. Throws std::runtime_error if it is missing. Any thread may call it.
  static const PcapLibrary& get();
};

}  // namespace imud
