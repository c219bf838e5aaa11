// WebApi: the control protocol behind the web server. The server knows neither methods nor their meaning.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "emulator/control/subscriptions.hpp"

namespace imud {

// Executes the requests of a text (ControlApi::call()). `answer` is called once, now or later, with the text of the
// answer, which is empty if none is wanted. `client` gets notifications; nullptr: nobody does.
using WebApi = std::function<void(std::string_view request, std::function<void(std::string)> answer,
                                  const std::shared_ptr<Subscriber>& client)>;

}  // namespace imud
