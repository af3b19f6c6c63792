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
  positive("summary_loss.width", summary_loss.width);
  positive("direction_loss.width", direction_loss.width);
  positive("prior_radius", prior_radius);
  positive("prior_log_radius_sigma", prior_log_radius_sigma);
  positive("prior_lean_sigma", prior_lean_sigma);
  positive("prior_position_sigma", prior_position_sigma);
  if (max_iterations < 1)
    throw vpException(vpException::badValue, "max_iterations = %d, must be at least 1", max_iterations);
  if (window < 2)
    throw vpException(vpException::badValue, "window = %d, must be at least 2", window);
  if (remembered < 0)
    throw vpException(vpException::badValue, "remembered = %d, must be at least 0", remembered);
  if (!bMc.isFinite())
    throw vpException(vpException::badValue, "bMc, must be finite");
}
} // namespace bole
