#include "protocols/stim300/service_text.hpp"

namespace imud::stim300 {
namespace {

constexpr std::array<std::string_view, 4> gyro_unit_texts = {"[\xB0/s] - ANGULAR RATE", "[\xB0] - INCREMENTAL ANGLE",
                                                             "[\xB0/s] - AVERAGE ANGULAR RATE",
                                                             "[\xB0] - INTEGRATED ANGLE"};
constexpr std::array<std::string_view, 5> force_unit_texts = {
    "[g] - ACCELERATION", "[m/s] - INCREMENTAL VELOCITY", "[g] - AVERAGE ACCELERATION", "[gs] - INTEGRATED VELOCITY",
    "[m/s] - INTEGRATED VELOCITY"};
constexpr std::array<std::string_view, 4> pps_units = {"[ ] - FILTERED PPS", "[ ] - FILTERED PPS - DELAYED",
                                                       "[us] - TIME SINCE DETECTION OF 0",
                                                       "[us] - TIME SINCE DETECTION OF 1"};
constexpr std::array<std::string_view, 3> sources = {"OFF", "ACC", "INC"}, parity_texts = {"NONE", "EVEN", "ODD"};

std::string_view on_off(bool on) noexcept { return on ? "ON" : "OFF"; }

void print_status(ServiceText& text, std::string_view what, unsigned status) noexcept {
  text.add(what, " STATUS = ");
  for (unsigned bit = 8; bit-- > 0;) text.add((status >> bit & 1U) != 0 ? '1' : '0');
  text.line(status == 0 ? " = OK" : " = NOT OK");
  constexpr std::array<std::string_view, 8> bits = {
      "ERROR IN X-CHANNEL", "ERROR IN Y-CHANNEL",           "ERROR IN Z-CHANNEL", "ERROR IN MEASUREMENT CHANNEL",
      "OVERLOAD",           "OUTSIDE OPERATING CONDITIONS", "START-UP",           "SYSTEM INTEGRITY ERROR"};
  for (unsigned bit = 8; bit-- > 0;)
    if ((status >> bit & 1U) != 0) text.line(" BIT ", bit, ": ", bits[bit]);
}

// Bits of Table 5-19 that decide the lines "NAME = OK" of the diagnostic. `never`: the emulated unit never fails the
// check.
constexpr unsigned never = 128, start_up = 16, uart = 68, first_overload = 101, pps_overflow = 112;

// Calls heading(words...) and check(axis, name, bit) for each line of figure 9-8.
template <class Heading, class Check>
void for_all_checks(Heading&& heading, Check&& check) noexcept {
  heading("SYSTEM STATUS:");
  for (const std::string_view name :
       {"RAM CHECK", "FLASH CHECK", "STACK STATUS MONITOR", "STACK COMMAND HANDLER", "STACK SAMPLE", "STACK FLASH",
        "STACK TRANSMIT", "MICRO CONTROLLER TEMPERATURE"})
    check("", name, never);
  check("", "START-UP PHASE", start_up);
  check("", "SELF-TEST RUNNING", never);
  check("", "UART", uart);
  heading("VOLTAGES AND REFERENCES:");
  for (const std::string_view name :
       {"REFERENCE VOLTAGE_1", "REFERENCE VOLTAGE_2", "REFERENCE VOLTAGE_3", "REFERENCE VOLTAGE_4",
        "REGULATED VOLTAGE_1", "REGULATED VOLTAGE_2", "REGULATED VOLTAGE_3", "SUPPLY VOLTAGE 5.0V", "INTERNAL DAC"})
    check("", name, never);
  constexpr std::array<std::string_view, 3> gyros = {"GYRO X-AXIS", "GYRO Y-AXIS", "GYRO Z-AXIS"};
  constexpr std::array<std::string_view, 6> others = {"ACCELEROMETER X-AXIS", "ACCELEROMETER Y-AXIS",
                                                      "ACCELEROMETER Z-AXIS", "INCLINOMETER X-AXIS",
                                                      "INCLINOMETER Y-AXIS",  "INCLINOMETER Z-AXIS"};
  unsigned overload = first_overload;
  for (const std::string_view axis : gyros) {
    heading(axis, ":");
    for (const std::string_view name :
         {" DATA RECEIVED", " EXCITATION FREQUENCY", " ASIC TEMPERATURE", " TEMPERATURE", " NO CLIPPING DETECTED"})
      check(axis, name, never);
    check(axis, " NO OVERLOAD DETECTED", overload++);
    for (const std::string_view name : {" INTERNAL COMMUNICATION", " NO ASIC OVERFLOW DETECTED",
                                        " EXCITATION AMPLITUDE", " CONFIGURATION", " DETECTION DC", " EXCITATION DC"})
      check(axis, name, never);
  }
  for (const std::string_view axis : others) {
    heading(axis, ":");
    check(axis, " NO CLIPPING DETECTED", never);
    check(axis, " NO OVERLOAD DETECTED", overload++);
    check(axis, " TEMPERATURE", never);
    check(axis, " ADC", never);
  }
  heading("PPS:");
  check("", "PPS TIME OVERFLOW", pps_overflow);
}

std::string_view result(const Memory& memory, unsigned bit) noexcept {
  if (bit == start_up) return memory.has_error(bit) ? "ACTIVE" : "NOT ACTIVE";
  return bit != never && memory.has_error(bit) ? "FAIL" : "OK";
}

void print_part_number(ServiceText& text, const Configuration& c) noexcept {
  text.line("PART NUMBER = ", range_of(c).part_number, " REV ", part_revision);
}

void print_axes(ServiceText& text, const Configuration& c) noexcept {
  for (const std::string_view cluster : cluster_names) text.line(cluster, " CONFIG = XYZ");
  for (const Cluster cluster : clusters) {
    text.line(cluster_names[cluster], " RANGE:");
    for (const char axis : axis_names) {
      text.add(' ', axis, "-AXIS: \xB1 ");
      if (cluster == gyro) text.line("400\xB0/s");
      if (cluster == accelerometer) text.line(range_of(c).g, 'g');
      if (cluster == inclinometer) text.line("1.7g");
    }
  }
}

bool print_failures(ServiceText& text, const Memory& memory) noexcept {
  bool some = false;
  for_all_checks([](auto...) {},
                 [&](std::string_view axis, std::string_view name, unsigned bit) {
                   if (bit == never || !memory.has_error(bit)) return;
                   some = true;
                   text.line(axis, name, " = ", result(memory, bit));
                 });
  return some;
}

}  // namespace

void print_unit(ServiceText& text, const Configuration& c, Cluster cluster) noexcept {
  const unsigned unit = c.units[cluster];
  text.line(cluster_names[cluster],
            " OUTPUT UNIT = ", cluster == gyro ? gyro_unit_texts[unit % delayed] : force_unit_texts[unit],
            unit >= delayed ? " DELAYED" : "");
}

void print_pps_unit(ServiceText& text, const Configuration& c) noexcept {
  text.line("PPS OUTPUT UNIT = ", pps_units[c.pps_unit]);
}

void print_sample_rate(ServiceText& text, const Configuration& c) noexcept {
  if (c.sample_rate == external_trigger)
    text.line("SAMPLE RATE = EXTERNAL TRIGGER");
  else
    text.line("SAMPLE RATE [samples/s] = ", sample_rates[c.sample_rate]);
}

void print_filters(ServiceText& text, const Configuration& c, Cluster cluster, unsigned only) noexcept {
  for (unsigned i = 0; i < 3; ++i)
    if (only == 3 || only == i)
      text.line(cluster_names[cluster], " LP FILTER -3dB FREQUENCY, ", axis_names[i],
                "-AXIS [Hz] = ", filters_hz[c.filters[cluster][i]]);
}

void print_pps_filter(ServiceText& text, const Configuration& c) noexcept {
  text.line("PPS LP FILTER -3dB FREQUENCY [Hz] = ", filters_hz[c.pps_filter]);
}

void print_g_compensation(ServiceText& text, const Configuration& c, std::string_view warning) noexcept {
  text.line("GYRO G-COMPENSATION:", warning);
  for (unsigned i = 0; i < 3; ++i) {
    const GCompensation& g = c.g_compensation[i];
    const auto print = [&](std::string_view what, unsigned source, bool filter) {
      text.line(' ', what, " SOURCE, ", axis_names[i], "-AXIS = ", sources[source]);
      text.line(' ', what, " G-COMP LP-FILTER, ", axis_names[i], "-AXIS = ", source == 0 ? "NA" : on_off(filter));
    };
    print("BIAS", g.bias_source, g.bias_filter);
    print("SCALE", g.scale_source, g.scale_filter);
  }
  text.line(" G-COMP LP-FILTER CUTOFF = ", ServiceText::Fixed{c.g_filter_hz, 3}, " HZ");
}

void print_trims(ServiceText& text, const Memory& memory, Cluster cluster, unsigned only) noexcept {
  for (unsigned i = 0; i < 3; ++i)
    if (only == 3 || only == i)
      text.line(' ', cluster_names[cluster], ' ', axis_names[i], "-AXIS [", cluster == gyro ? "\xB0/s" : "g",
                "] = ", ServiceText::Fixed{memory.trim[cluster][i], 5 + static_cast<int>(cluster)});
}

void print_datagram(ServiceText& text, const Configuration& c) noexcept {
  text.add("DATAGRAM = RATE");
  if (c.has(accelerometer)) text.add(", ACCELERATION");
  if (c.has(inclinometer)) text.add(", INCLINATION");
  if (c.has_temperature()) text.add(", TEMPERATURE");
  if (c.has_pps()) text.add(c.has_aux ? ", AUX" : ", PPS");
  text.line("\rDATAGRAM TERMINATION = ", c.cr_lf ? "<CR><LF>" : "NONE");
}

void print_transmission(ServiceText& text, const UartSettings& line) noexcept {
  text.line("BIT-RATE [bits/s] = ", line.baud);
  text.line("DATA LENGTH = 8");
  text.line("STOP BITS = ", line.stop_bits);
  text.line("PARITY = ", parity_texts[static_cast<std::size_t>(line.parity)]);
}

void print_line_termination(ServiceText& text, const Configuration& c) noexcept {
  text.line("LINE TERMINATION = ", on_off(c.line_termination));
}

void print_system(ServiceText& text, const Configuration& c, char which) noexcept {
  if (which == 'v') text.line("VOLTAGE-LEVEL OF DIGITAL OUTPUT SIGNALS: ", c.tov_3v3 ? "3.3V" : "5V");
  if (which == 't') text.line("TOV ACTIVE FOR SPECIAL DATAGRAMS AFTER POWER-ON/RESET: ", on_off(c.tov_toggles));
  if (which == 'b') text.line("BTO-DATAGRAM TRANSMISSION AFTER POWER-ON/RESET: ", on_off(c.bias_trim_at_start));
}

void print_reference(ServiceText& text, const Memory& memory) noexcept {
  text.line(" REFERENCE INFO = ", unsigned{memory.trim_reference});
}

void print_information(ServiceText& text, const Memory& memory) noexcept {
  Memory shown = memory;
  for (const char part : std::string_view("snxpumafgbdtrh")) print_part(text, shown, part);
}

bool print_part(ServiceText& text, Memory& memory, char part) noexcept {
  const Configuration& c = memory.active;
  switch (part) {
    case 'a':
      print_axes(text, c);
      break;
    case 'b':
      text.line("BIAS TRIM OFFSET:");
      for (const Cluster cluster : clusters) print_trims(text, memory, cluster);
      print_reference(text, memory);
      break;
    case 'd':
      print_datagram(text, c);
      break;
    case 'e':
      text.line(print_failures(text, memory) ? "LAST ERROR HISTORY IS NOW CLEARED" : "NO ERRORS DETECTED");
      memory.errors = {};
      break;
    case 'f':
      for (const Cluster cluster : clusters) print_filters(text, c, cluster);
      print_pps_filter(text, c);
      break;
    case 'g':
      print_g_compensation(text, c);
      break;
    case 'h':
      text.line("SYSTEM CONFIGURATIONS:");
      for (const char which : std::string_view("vtb")) {
        text.add(' ');
        print_system(text, c, which);
      }
      break;
    case 'm':
      print_sample_rate(text, c);
      break;
    case 'n':
      text.line("PRODUCT = ", product_name);
      break;
    case 'p':
      text.line("FW CONFIG = ", firmware);
      break;
    case 'r':
      print_line_termination(text, c);
      break;
    case 's':
      text.line("SERIAL NUMBER = ", serial_number);
      break;
    case 't':
      print_transmission(text, c.line());
      break;
    case 'u':
      for (const Cluster cluster : clusters) print_unit(text, c, cluster);
      print_pps_unit(text, c);
      break;
    case 'x':
      print_part_number(text, memory.active);
      break;
    default:
      return false;
  }
  return true;
}

void print_measurement(ServiceText& text, const std::array<Axes, 3>& measured, const Reading& reading) noexcept {
  for (const Cluster cluster : clusters) {
    for (unsigned i = 0; i < 3; ++i)
      text.line(cluster_names[cluster], ' ', axis_names[i],
                "-AXIS = ", ServiceText::Fixed{measured[cluster].now[i], 5 + static_cast<int>(cluster)},
                cluster == gyro ? " \xB0/s" : " g");
    print_status(text, cluster_names[cluster], measured[cluster].status_now);
  }
  for (const std::string_view cluster : {"GYRO", "ACC", "INC"}) {
    for (const char axis : axis_names)
      text.line("TEMPERATURE ", cluster, ' ', axis, "-AXIS = ", ServiceText::Fixed{reading.temperature_c, 3},
                " \xB0"
                "C");
    print_status(text, "TEMPERATURE", reading.status);
  }
  text.line("PPS = ", unsigned{reading.pps}, " us");
  print_status(text, "PPS", reading.pps_status);
  text.line("COUNTER = ", reading.counter);
  text.line("LATENCY = ", reading.latency_us, " us");
}

void print_diagnostic(ServiceText& text, const Memory& memory) noexcept {
  text.line("SERIAL NUMBER = ", serial_number);
  text.line("PRODUCT = ", product_name);
  print_part_number(text, memory.active);
  text.line("HW CONFIG = ", hardware);
  text.line("FW CONFIG = ", firmware);
  for_all_checks([&](auto... heading) { text.line(heading...); },
                 [&](std::string_view axis, std::string_view name, unsigned bit) {
                   text.line(' ', axis, name, " = ", result(memory, bit));
                 });
}

}  // namespace imud::stim300
