// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/final_pass.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr std::size_t kMostPixels = 100'000'000; ///< of all frames kept: 1300 of 320x240

Viewpoint at(const KeptFrame &frame, const Smoother &smoother, const Viewpoint &view)
{
  Viewpoint there = view;
  there.wMc = smoother.pose(frame.pose) * smoother.options().bMc;
  there.time_s = frame.time_s;
  return there;
}

double distanceBetween(const Trunk &a, const Trunk &b)
{
  return (a.axisAt(kBreastHeight) - b.axisAt(kBreastHeight)).head<2>().norm();
}

bool isSameReading(const Trunk &a, const Trunk &b)
{
  constexpr double kPlace = 0.1, kLogRadius = 0.15; // [m], [1]
  return distanceBetween(a, b) < kPlace && std::abs(a.log_radius - b.log_radius) < kLogRadius;
}

DepthSweep sweepOf(double metres)
{
  DepthSweep sweep;
  sweep.inverse_step *= metres;
  return sweep;
}
} // namespace

void KeptFrames::push(const vpImage<unsigned char> &image, std::size_t pose, double time_s,
                      const Eigen::Vector3d &camera, double spacing)
{
  if (!m_frames.empty() && (camera - m_last).norm() < spacing)
    return;
  m_last = camera;
  m_frames.push_back({image, pose, time_s});
  while (m_frames.size() * image.getSize() > kMostPixels)
    m_frames.pop_front();
}

std::vector<EvidenceView> lookBack(const KeptFrames &frames, const Smoother &smoother, const Viewpoint &view,
                                   const StageOptions &options, double metres)
{
  const double baseline = 0.3 * options.detection.range_min; // 3.5 degrees of parallax at 8 m, 17 at the nearest
  LevelGrid grid;
  grid.column_step = 1 / view.camera.fx;
  std::vector<LevelImage> images;
  for (const KeptFrame &frame : frames.frames())
    images.emplace_back(frame.image, view.camera, at(frame, smoother, view).wMc, grid);
  return evidenceViews(images, baseline, sweepOf(metres));
}

std::vector<Trunk> detectAgain(const KeptFrames &frames, const Smoother &smoother, const Viewpoint &view,
                               const StageOptions &options)
{
  constexpr std::size_t kEvery = 5; // frames between two windows: a trunk passes through several
  std::vector<LevelProfile> profiles;
  std::vector<Pose> poses;
  for (const KeptFrame &frame : frames.frames()) {
    poses.push_back(at(frame, smoother, view).wMc);
    profiles.push_back(computeLevelProfile(computeGradient(frame.image, options.gradient).signed_x, view.camera,
                                           poses.back().R, options.detection.profile));
  }
  const auto window = static_cast<std::size_t>(options.detection.window);
  std::vector<Trunk> found;
  for (std::size_t end = kEvery; end <= profiles.size(); end += kEvery) {
    std::vector<DetectorView> views;
    for (std::size_t i = end > window ? end - window : 0; i < end; ++i)
      views.push_back({&profiles[i], poses[i]});
    for (const Detection &detection : detectTrunks(views, view.camera, {}, nullptr, options.detection)) {
      const Trunk &trunk = detection.trunk;
      if (std::none_of(found.begin(), found.end(), [&](const Trunk &one) { return isSameReading(one, trunk); }))
        found.push_back(trunk);
    }
  }
  return found;
}

void judge(std::vector<Hypothesis> &hypotheses, const std::vector<EvidenceView> &views, const Viewpoint &view,
           const StageOptions &options, double metres)
{
  constexpr double kEyeHeight = 1.2; // where nothing tells the ground: that of the first camera over it [m]
  const EvidencePart part{options.flow.trunk_low, options.flow.trunk_high, view.ground_z.value_or(-kEyeHeight / metres),
                          options.flow.track_range};
  for (Hypothesis &hypothesis : hypotheses) {
    hypothesis.evidence = evidenceOf(hypothesis.trunk, views, sweepOf(metres), part);
    hypothesis.log_odds = logOdds(hypothesis.evidence);
  }
}

std::vector<Hypothesis> choose(std::vector<Hypothesis> hypotheses, double least, const StageOptions &options)
{
  std::sort(hypotheses.begin(), hypotheses.end(),
            [](const Hypothesis &a, const Hypothesis &b) { return a.log_odds > b.log_odds; });
  std::vector<Hypothesis> chosen;
  for (const Hypothesis &one : hypotheses) {
    if (one.log_odds < least)
      break;
    const bool is_free = std::none_of(chosen.begin(), chosen.end(), [&](const Hypothesis &better) {
      return distanceBetween(one.trunk, better.trunk) <
             one.trunk.radius() + better.trunk.radius() + options.map.merge_distance;
    });
    if (is_free)
      chosen.push_back(one);
  }
  return chosen;
}

std::vector<Adoption> measure(const std::vector<Hypothesis> &chosen, const KeptFrames &frames, const Smoother &smoother,
                              const Viewpoint &view, const StageOptions &options)
{
  constexpr double kBorder_px = 1;
  std::vector<Follower> followers;
  std::vector<MapTrunk> standing;
  for (const Hypothesis &one : chosen) {
    followers.emplace_back(one.trunk, kBorder_px);
    MapTrunk trunk;
    trunk.id = static_cast<int>(standing.size());
    trunk.status = TrunkStatus::confirmed;
    trunk.trunk = one.trunk;
    standing.push_back(trunk);
  }
  const TrunkMap map(options.map, standing); // what hides what
  for (const KeptFrame &frame : frames.frames()) {
    const Gradient gradient = computeGradient(frame.image, options.gradient);
    const Viewpoint there = at(frame, smoother, view);
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const Trunk &trunk = chosen[i].trunk;
      if ((trunk.axisAt(there.wMc.t.z()) - there.wMc.t).norm() > options.flow.track_range)
        continue;
      followers[i].look(gradient, frame.pose, smoother.pose(frame.pose), there,
                        hiddenBorders(trunk, static_cast<int>(i), map, there), options);
    }
  }
  std::vector<Adoption> measured;
  for (const Follower &follower : followers)
    measured.push_back(follower.result(view.time_s, view.camera, options));
  return measured;
}
} // namespace bole
