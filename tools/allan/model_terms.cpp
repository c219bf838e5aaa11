#include "tools/allan/model_terms.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tools/allan/allan_term_list.hpp"
#include "tools/child_program.hpp"

namespace imud {

ModelTerms model_terms(const std::string& model, double rate_hz) {
  // A rate at which every preset is possible; averaging a recording does not change the densities.
  const double least_rate_hz = 100, greatest_rate_hz = 10'000;
  const std::string config = fmt::format(
      "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"native\"\nport = \"pty:imu1\"\nrate_hz = {}\n"
      "model = {}\n",
      std::clamp(rate_hz, least_rate_hz, greatest_rate_hz),
      nlohmann::json(model).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  const std::string program = imud_program();
  const ChildResult result = run_child(program, {"check", "--json", "-"}, config);
  try {
    const auto json = nlohmann::json::parse(result.output);
    // The first fault is the model's; where imud does not know the range of the sensors either, others follow from
    // it.
    if (const auto& faults = json.at("faults"); !faults.empty()) {
      const std::string fault = faults.front();
      const std::size_t key = fault.find(".model: ");
      throw std::invalid_argument(key == std::string::npos ? fault : fault.substr(key + 8));
    }
    ModelTerms terms{model, {}};
    const auto& noise = json.at("imus").at(0).at("noise");
    for (std::size_t i = 0; i < terms.of.size(); ++i) {
      const char* sensor = i < channels_per_sensor ? "gyro" : "accelerometer";
      for (const AllanTerm& term : allan_term_list)
        terms.of[i].*term.value = noise.at(sensor).at(std::string(1, term.letter)).at(i % channels_per_sensor);
    }
    return terms;
  } catch (const nlohmann::json::exception&) {
    throw std::runtime_error(
        fmt::format("{} check --json (exit code {}) is not understood; right would be the imud of this version, "
                    "beside this program or in PATH",
                    program, result.exit_code));
  }
}

}  // namespace imud
