// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/saliency_options.h"

#include <fmt/format.h>
#include <string>
#include <utility>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
void require(bool holds, const char *name, double value, const std::string &rule)
{
  if (!holds) // also for NaN
    throw vpException(vpException::badValue, fmt::format("saliency.{} = {}, must be {}", name, value, rule).c_str());
}

void requireWithin(const char *name, double value, double low, double high)
{
  require(value >= low && value <= high, name, value, fmt::format("within [{}, {}]", low, high));
}

void requireInside(const char *name, double value, double low, double high)
{
  require(value > low && value < high, name, value, fmt::format("within ({}, {})", low, high));
}
} // namespace

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

void SaliencyOptions::validate() const
{
  requireInside("sigma_intensity", sigma_intensity, 0, 1);
  requireInside("sigma_background_px", sigma_background_px, 0, 20);
  require(sigma_foreground_px > sigma_background_px && sigma_foreground_px <= 200, "sigma_foreground_px",
          sigma_foreground_px, fmt::format("within (sigma_background_px = {}, 200]", sigma_background_px));
  requireInside("background_prior", background_prior, 0, 1);
  requireWithin("iterations", iterations, 1, 50);
  requireWithin("levels", levels, 1, 8);
  requireWithin("finest_level", finest_level, 0, levels - 1);
  requireWithin("sigma_rotation_pull", sigma_rotation_pull, 0, 1);
  requireWithin("sample_correlation", sample_correlation, 1, 1e4);
  requireInside("sigma_residual", sigma_residual, 0, 1);
  requireWithin("translation_noise_scale", translation_noise_scale, 0, 10);
  requireWithin("near_range", near_range, 0.1, 1000);
  requireInside("min_range", min_range, 0.05, near_range);
  requireWithin("inverse_depths", inverse_depths, 4, 64);
  for (const auto &[name, value] :
       {std::pair("label_window_px", label_window_px), std::pair("window_width_px", window_width_px),
        std::pair("window_height_px", window_height_px)})
    require(value >= 1 && value <= 31 && value % 2 == 1, name, value, "odd and within [1, 31]");
  requireWithin("min_parallax_px", min_parallax_px, 0.1, 50);
  requireWithin("max_frames_apart", max_frames_apart, 1, 20);
  requireWithin("evidence_decay", evidence_decay, 0, 1);
  requireInside("near_prior", near_prior, 0, 1);
  requireInside("evidence_scale", evidence_scale, 0, 100);
  requireWithin("unknown_below", unknown_below, 0, 20);
}
} // namespace bole
