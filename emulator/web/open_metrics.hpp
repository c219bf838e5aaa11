// OpenMetrics: the figures of a run as a text that Prometheus reads.
#pragma once

#include <string>

#include "emulator/summary.hpp"

namespace imud {

// The media type of open_metrics().
inline constexpr const char* open_metrics_type = "application/openmetrics-text; version=1.0.0; charset=utf-8";

// Returns every declared counter, level and histogram, with its words as help (OpenMetrics 1.0,
// https://prometheus.io/docs/specs/om/open_metrics_spec). `imud_truth_received_total`,
// `imud_imu_samples_total{imu="imu1"}`, `imud_imu_lateness_seconds_bucket{imu="imu1",le="1e-05"}`: the key of the
// JSON is in the name, but units are SI. A counter that may fall is a gauge. The limits of buckets are exact
// within 1.2 %, as are sums.
std::string open_metrics(const Summary& summary);

}  // namespace imud
