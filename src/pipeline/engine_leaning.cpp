// SPDX-License-Identifier: GPL-2.0-or-later
// Trunks that lean are too smeared in upright columns for the detector: it looks along lines that lean, too. In
// servoing, where one trunk that is missed is what the task is about, in flight; else when the flight is over.
#include "pipeline/engine.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr std::size_t kLeaningEvery = 3; ///< frames of a window in which one looks for trunks: it holds many more

/// Options of the detector for lines that lean to the left (side 0) or to the right (1).
StageOptions alongLeaning(StageOptions options, int side)
{
  constexpr double kLean = 0.05; // tan: a trunk that leans by half of it is 3 px aslant to a line at f = 200 px
  options.detection.profile.lean = side == 0 ? -kLean : kLean;
  // a border kLean aslant is smeared as wide as a thinner trunk
  const double thinnest = 0.5 * kLean * (options.flow.trunk_high - options.flow.trunk_low);
  options.detection.radius_min = std::max(options.detection.radius_min, thinnest);
  return options;
}

/// Sorts by quality and contrast: a line that is summed along another lean than its own is smeared, so the detection
/// with the right lean comes first.
void sortBySharpness(std::vector<Detection> &found)
{
  const auto sharpness = [](const Detection &one) {
    return one.quality * std::min(std::abs(one.left_contrast), std::abs(one.right_contrast));
  };
  std::sort(found.begin(), found.end(),
            [&](const Detection &a, const Detection &b) { return sharpness(a) > sharpness(b); });
}
} // namespace

/// Looks for trunks that lean to the left and to the right in alternate frames.
void Engine::addLeaningCandidates(const std::shared_ptr<const Gradient> &gradient, const Viewpoint &view,
                                  const vpImage<float> *p_background)
{
  const int side = static_cast<int>(newest() % 2);
  const StageOptions options = alongLeaning(m_units, side);
  m_leaning[side].push(gradient, newest(), view, m_smoother, options);
  if (newest() / 2 % kLeaningEvery != 0 || !m_motion->isTranslationMeasured())
    return;
  std::vector<Detection> found = detectInWindow(m_leaning[side], m_smoother, m_map, view, p_background, options);
  sortBySharpness(found);
  addBestCandidates(std::move(found), m_leaning[side], view);
}

/// Detects leaning trunks between the \p likely ones in all keyframes and adds them as candidates.
void Engine::detectLeaning(const TrunkMap &likely, KeyframeGradients &gradients)
{
  const StageOptions options[2] = {alongLeaning(m_units, 0), alongLeaning(m_units, 1)};
  DetectionWindow windows[2];
  for (std::size_t i = 0; i < m_keyframes.frames().size(); ++i) {
    const Keyframe &frame = m_keyframes.frames()[i];
    const Viewpoint at = viewpointOf(frame.pose, frame.time_s);
    for (const int side : {0, 1})
      windows[side].push(gradients[i], frame.pose, at, m_smoother, options[side]);
    if (i % kLeaningEvery != 0)
      continue;
    std::vector<Detection> found;
    for (const int side : {0, 1}) {
      const auto leaning = detectInWindow(windows[side], m_smoother, likely, at, nullptr, options[side]);
      found.insert(found.end(), leaning.begin(), leaning.end());
    }
    sortBySharpness(found);
    addBestCandidates(std::move(found), windows[0], at);
  }
}
} // namespace bole
