#include "emulator/web/web_access.hpp"

#include <boost/archive/iterators/base64_from_binary.hpp>
#include <boost/archive/iterators/transform_width.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/beast/core/string.hpp>
#include <utility>  // Boost 1.74's Asio needs it first

namespace imud {
namespace {

namespace beast = boost::beast;

// Returns the name or address without the port, and without the brackets of an IPv6 address.
std::string_view without_port(std::string_view host) {
  if (host.starts_with('[')) return host.substr(1, host.find(']') - 1);
  return host.substr(0, host.find(':'));
}

bool equals(std::string_view a, std::string_view b) {
  return beast::iequals(beast::string_view(a.data(), a.size()), beast::string_view(b.data(), b.size()));
}

std::string base64(const std::string& text) {
  using namespace boost::archive::iterators;
  using Encoder = base64_from_binary<transform_width<std::string::const_iterator, 6, 8>>;
  std::string out(Encoder(text.begin()), Encoder(text.end()));
  while (out.size() % 4 != 0) out += '=';
  return out;
}

}  // namespace

bool is_own_host(std::string_view host, std::string_view machine) {
  const std::string_view name = without_port(host);
  if (equals(name, "localhost") || (!machine.empty() && equals(name, machine))) return true;
  boost::system::error_code error;
  boost::asio::ip::make_address(std::string(name), error);
  return !error;
}

bool is_own_origin(std::string_view origin, std::string_view host) {
  if (origin.empty()) return true;
  for (const std::string_view scheme : {"http://", "https://"})
    if (origin.starts_with(scheme)) return equals(origin.substr(scheme.size()), host);
  return false;
}

WebToken::WebToken(const std::string& secret)
    : bearer_("Bearer " + secret), basic_("Basic " + base64("imud:" + secret)) {}

bool WebToken::is_in(std::string_view authorization) const noexcept {
  const bool is_bearer = bearer_.matches(authorization), is_basic = basic_.matches(authorization);
  return is_bearer || is_basic;
}

}  // namespace imud
