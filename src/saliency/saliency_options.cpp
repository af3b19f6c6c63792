// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/saliency_options.h"

namespace bole
{
SaliencyOptions SaliencyOptions::paper()
{
  SaliencyOptions options;
  options.sigma_intensity = 0.02;
  options.label_window_px = 1;
  options.sigma_background_px = 0.15;
  options.sigma_foreground_px = 3;
  options.background_prior = 0.5;
  options.foreground_mean_zero = true;
  options.linear_flow = true;
  options.iterations = 8;
  options.levels = 1;
  options.finest_level = 0;
  options.use_rotation_prior = false;
  options.sigma_rotation_pull = 0;
  options.sample_correlation = 1;
  options.use_translation = false;
  return options;
}
} // namespace bole
