// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/smoother.h>

#include "geometry/names.h"

#include <visp3/core/vpException.h>

namespace bole
{
const char *toString(UpdateStatus status) { return nameOf(status, {"ok", "iteration limit", "degenerate"}); }

Pose SmootherOptions::forwardCamera()
{
  Pose bMc;
  bMc.R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return bMc;
}

void SmootherOptions::validate() const
{
  const auto positive = [](const char *name, double value) {
    if (!(value > 0) || !std::isfinite(value))
      throw vpException(vpException::badValue, "%s = %g, must be above 0", name, value);
  };
  positive("relinearise_position", relinearise_position);
  positive("relinearise_rotation", relinearise_rotation);
  positive("relinearise_log_radius", relinearise_log_radius);
  positive("relinearise_lean", relinearise_lean);
  positive("linearisation_tolerance", linearisation_tolerance);
  positive("summary_loss.width", summary_loss.width);
  positive("direction_loss.width", direction_loss.width);
  positive("prior_radius", prior_radius);
  positive("prior_log_radius_sigma", prior_log_radius_sigma);
  positive("prior_lean_sigma", prior_lean_sigma);
  positive("prior_position_sigma", prior_position_sigma);
  if (!(propagation_threshold >= 0))
    throw vpException(vpException::badValue, "propagation_threshold = %g, must be at least 0", propagation_threshold);
  if (max_iterations < 1)
    throw vpException(vpException::badValue, "max_iterations = %d, must be at least 1", max_iterations);
  if (fixed_lag != 0 && fixed_lag < 2)
    throw vpException(vpException::badValue, "fixed_lag = %d, must be 0 (off) or at least 2", fixed_lag);
  if (!bMc.isFinite())
    throw vpException(vpException::badValue, "bMc, must be finite");
}
} // namespace bole
