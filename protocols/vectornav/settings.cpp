// The keys of [imu.device], and the product as delivered.
#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/units.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {
namespace {

constexpr std::array<std::string_view, 3> model_names = {models[0].keyword, models[1].keyword, models[2].keyword};

}  // namespace

constinit const Setting declared_settings[11] = {
    text_setting("model", "the device", models[0].keyword, model_names),
    text_setting("firmware",
                 "version; from 3.0.0.0 on with the registers 86, 98 to 102, 105, 115, 116, 144, 157, 206, and VNHVE",
                 "2.1.0.0"),
    integer_setting("uart", "number of the UART at port; the other one is at second_port", 1, 1, 2),
    integer_setting("baud", "register 5: speed of both UARTs, bit/s", 115200, 9600, 921600),
    integer_setting("async_type",
                    "register 6 of the UART at port: number, as in VectorNav's manual, of the text message that is "
                    "streamed; 14: VNYMR, attitude, magnetic field, acceleration and rate; 0: none",
                    14, 0, 34),
    integer_setting("async_hz", "register 7 of the UART at port: text messages per second, Hz; 0: none", 40, 0, 200),
    integer_setting("second_async_type", "async_type of the UART at second_port", 14, 0, 34),
    integer_setting("second_async_hz", "async_hz of the UART at second_port", 40, 0, 200),
    text_setting(
        "binary_1",
        "register 75: binary output 1: UART (1, 2, or 3 for both), divisor of the sensor's rate, groups and their "
        "fields in hexadecimal; \"1,16,01,0029\" is time, attitude and rate at 50 Hz (VN-300: 25 Hz)",
        ""),
    text_setting("binary_2", "register 76: binary output 2", ""),
    text_setting("binary_3", "register 77: binary output 3", ""),
};

Model model_of(const Settings& settings) {
  Model model = models[0];
  for (const Model& known : models)
    if (known.keyword == settings.text("model")) model = known;
  const std::string& version = settings.text("firmware");
  std::size_t numbers = 0;
  bool is_good = version.size() < model.firmware.size();
  for (std::string_view rest = version;; rest.remove_prefix(rest.find('.') + 1)) {
    is_good = is_good && number_in<std::uint16_t>(rest.substr(0, rest.find('.')));
    ++numbers;
    if (rest.find('.') == rest.npos) break;
  }
  const auto major = number_in<std::uint8_t>(version.substr(0, version.find('.')));
  if (!major || numbers != 4 || !is_good)
    throw std::invalid_argument("firmware: give four numbers, such as \"2.1.0.0\" or \"3.1.0.0\"");
  model.firmware = {};
  std::copy(version.begin(), version.end(), model.firmware.begin());
  model.major = *major;
  return model;
}

unsigned uart_of(const Settings& settings) { return static_cast<unsigned>(settings.integer("uart")) - 1; }

namespace {

Configuration::SerialPort serial_port(const Settings& settings, const Model& model, unsigned baud,
                                      const std::string& type_key, const std::string& hz_key) {
  const auto type = static_cast<unsigned>(settings.integer(type_key)),
             hz = static_cast<unsigned>(settings.integer(hz_key));
  if (type != 0 && name_of(type, model).empty())
    throw std::invalid_argument(type_key + ": this model has no such message; register 6 of its manual lists them");
  if (hz != 0 && static_cast<unsigned>(model.internal_hz) % hz != 0)
    throw std::invalid_argument(hz_key + ": give 1, 2, 4, 5, 10, 20, 25, 40, 50, 100 or 200, or 0 for none");
  return {baud, type, hz};
}

}  // namespace

Configuration configuration_of(const Settings& settings) {
  Configuration c;
  const Model model = model_of(settings);
  const auto baud = static_cast<unsigned>(settings.integer("baud"));
  if (std::find(bauds.begin(), bauds.end(), baud) == bauds.end())
    throw std::invalid_argument("baud: give 9600, 19200, 38400, 57600, 115200, 128000, 230400, 460800 or 921600");
  const unsigned uart = uart_of(settings);
  c.ports[uart] = serial_port(settings, model, baud, "async_type", "async_hz");
  c.ports[1 - uart] = serial_port(settings, model, baud, "second_async_type", "second_async_hz");
  constexpr std::array<const char*, 3> keys = {"binary_1", "binary_2", "binary_3"};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string& text = settings.text(keys[i]);
    if (text.empty()) continue;
    Error error{};
    const auto output = BinaryOutput::parse(text, error);
    if (!output || text.size() >= Configuration::register_size)
      throw std::invalid_argument(std::string(keys[i]) +
                                  ": give mode, divisor, groups and their masks, such as \"1,16,01,0029\"");
    c.binary[i] = *output;
    Configuration::store(c.binary_text[i], text);
  }
  return c;
}

// From the VN-100's data sheet: 0.0035 deg/s, 0.14 mg and 140 uG per sqrt(Hz); 2000 deg/s, 16 g, 2.5 G; the
// barometer's resolution of 0.042 mbar.
Product product_of(const Settings& settings) {
  configuration_of(settings);
  Product product;
  product.rate_hz = model_of(settings).internal_hz;
  product.gyro = TriadErrors::white(0.0035 * units::degree, product.rate_hz, 2000 * units::degree);
  product.accelerometer =
      TriadErrors::white(0.14e-3 * units::standard_gravity, product.rate_hz, 16 * units::standard_gravity);
  product.magnetometer = TriadErrors::white(140e-6 * units::gauss, product.rate_hz, 2.5 * units::gauss);
  product.barometer.noise = 4.2;
  return product;
}

}  // namespace imud::vectornav
