// Metrics: the figures of a run as a text that Prometheus and others read.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "emulator/report/summary.hpp"

namespace imud {

enum class MetricsFormat : std::uint8_t {
  text,          // Prometheus' text format 0.0.4, which every reader takes
  open_metrics,  // OpenMetrics 1.0, for a reader that asks for it
};
// Returns the format for the value of an Accept field.
MetricsFormat metrics_format(std::string_view accept) noexcept;
// Returns the format's media type.
std::string_view media_type(MetricsFormat format) noexcept;

// Returns every declared counter, level and histogram, with its words as help (OpenMetrics 1.0,
// https://prometheus.io/docs/specs/om/open_metrics_spec; the text format,
// https://prometheus.io/docs/instrumenting/exposition_formats). `imud_truth_received_total`,
// `imud_imu_samples_total{imu="imu1"}`, `imud_imu_lateness_seconds_bucket{imu="imu1",le="1e-05"}`: the key of the
// JSON is in the name, but units are SI. A counter that may fall is a gauge. The limits of buckets are exact
// within 0.8 %; sums are exact.
std::string metrics(const Summary& summary, MetricsFormat format);

}  // namespace imud
