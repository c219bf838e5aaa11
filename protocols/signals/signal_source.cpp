#include "protocols/signals/signal_source.hpp"

#include "core/numbers/number_text.hpp"

namespace imud {

std::optional<SignalSource> parse_signal_source(std::string_view text) noexcept {
  using enum SignalSource::Form;
  SignalSource source;
  if (const auto constant_number = finite_number_in(text)) {
    source.form = constant;
    source.constant = *constant_number;
    return source;
  }
  constexpr std::string_view abs = "abs(", sign_of = "sign(";
  if (const std::size_t percent = text.find('%'); percent != std::string_view::npos) {
    const auto modulus = finite_number_in(text.substr(percent + 1));
    if (!modulus || *modulus <= 0) return std::nullopt;
    source.form = remainder;
    source.modulus = *modulus;
    text = text.substr(0, percent);
  } else if (text.ends_with(')') && (text.starts_with(abs) || text.starts_with(sign_of))) {
    source.form = text.starts_with(abs) ? magnitude : sign;
    text.remove_prefix(text.find('(') + 1);
    text.remove_suffix(1);
  }
  const auto found = find_measured(text);
  if (!found || (source.form != plain && found->quantity->kind != MeasuredQuantity::Kind::number))
    return std::nullopt;
  source.in = *found;
  return source;
}

}  // namespace imud
