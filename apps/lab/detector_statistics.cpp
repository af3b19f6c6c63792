// SPDX-License-Identifier: GPL-2.0-or-later
#include "detector_statistics.h"

#include "detection/level_profile.h"
#include "geometry/horizontal_view.h"
#include "geometry/median.h"
#include "input/asl_source.h"
#include "output/figure.h"
#include "pipeline/paper_policy.h"
#include "saliency/saliency.h"
#include "tracking/borders.h"

#include <algorithm>
#include <cmath>

namespace bole::apps
{
namespace
{
Trunk trunkOf(const TruthTrunk &truth)
{
  Trunk trunk;
  trunk.xy = truth.xy;
  trunk.log_radius = std::log(std::max(truth.radius, 1e-3));
  return trunk;
}

/// The strongest value within 2 px of \p q; nothing outside the profile.
void addNear(const LevelProfile &profile, double sign, double q, std::vector<double> &values)
{
  const int at = static_cast<int>(std::lround((q - profile.q_first) / profile.step));
  if (at < 4 || at + 5 > static_cast<int>(profile.mean.size()))
    return;
  double strongest = -1;
  for (int i = at - 4; i <= at + 4; ++i)
    strongest = std::max(strongest, sign * static_cast<double>(profile.mean[static_cast<std::size_t>(i)]));
  values.push_back(strongest);
}

void addAll(const LevelProfile &profile, double sign, std::vector<double> &values)
{
  for (const float mean : profile.mean)
    if (mean != 0) // in the image
      values.push_back(sign * static_cast<double>(mean));
}
/// The minima of Eq. 3 next to the true trunks, both of whose borders are in the picture.
void addMinima(const Gradient &gradient, const PinholeCamera &camera, const Pose &wMc,
               const std::vector<TruthTrunk> &trunks, double range, EnergyOptions options,
               DetectorStatistics &statistics)
{
  options.paper_alpha = 1;
  const TrunkEnergy energy(gradient, camera, kWholeLine, {}, {}, options);
  for (const TruthTrunk &truth : trunks) {
    const Trunk trunk = trunkOf(truth);
    const RelativeTrunk relative = relativeTrunk(wMc, Pose(), trunk);
    if (truth.radius <= 0 || horizontalView(wMc, trunk).range > range || relative.cRt(2, 0) <= 0 ||
        borderLine(camera, relative, Border::left, kWholeLine).rows() < camera.height / 2 ||
        borderLine(camera, relative, Border::right, kWholeLine).rows() < camera.height / 2)
      continue;
    if (const auto summary = minimised(energy, camera, relative)) {
      const Vector4d d = relative.minus(summary->optimum);
      statistics.squared_errors.push_back(d.dot(summary->F * d));
    }
    else {
      ++statistics.without_minimum;
    }
  }
}
} // namespace

std::vector<TrueView> trueViews(const std::vector<TruthTrunk> &trunks, const Pose &wMc, double range, double widest)
{
  const double heading = std::atan2(wMc.R(1, 2), wMc.R(0, 2));
  std::vector<TrueView> views;
  for (const TruthTrunk &truth : trunks) {
    const HorizontalView seen = horizontalView(wMc, trunkOf(truth));
    const double ahead = std::remainder(seen.bearing - heading, 2 * M_PI);
    if (truth.radius > 0 && std::abs(ahead) < widest && seen.range < range)
      views.push_back({ahead, seen.range, seen.half_angle});
  }
  return views;
}

LineQuartiles DetectorStatistics::quartiles() const
{
  return {quantileOf(gradient.of_all, 0.75), quantileOf(foreground.of_all, 0.75)};
}

double DetectorStatistics::calibratedAlpha() const
{
  constexpr double kChiSquareMedian = 3.357; // of four degrees of freedom
  return kChiSquareMedian / medianOf(squared_errors);
}

DetectorStatistics detectorStatistics(const std::string &sequence, double range)
{
  AslSource source(sequence);
  const PinholeCamera camera = source.camera();
  Options paper;
  paper.map.policy = MapPolicy::paper;
  const StageOptions options = stageOptions(paper, camera);
  const std::vector<TruthTrunk> trunks = readTruthTrunks(sequence);
  SaliencyEstimator estimator(camera, options.saliency);
  ProfileOptions lines;
  lines.range = kWholeLine;
  Trajectory flight;
  DetectorStatistics statistics;
  for (Frame frame; source.next(frame);) {
    if (frame.status != FrameStatus::ok || !frame.wMb_odometry)
      continue;
    Saliency saliency = estimator.update(frame.image, gyroTurn(frame, flight, source.bMc(), options.points.gyro));
    const bool is_first = flight.empty();
    flight.push_back({frame.stamp_ns, *frame.wMb_odometry});
    if (is_first)
      continue;
    for (unsigned i = 0; i < saliency.p_background.getSize(); ++i)
      saliency.p_background.bitmap[i] = 1 - saliency.p_background.bitmap[i];
    const Gradient gradient = computeGradient(frame.image, options.gradient);
    const Pose wMc = *frame.wMb_odometry * source.bMc();
    const auto profileOf = [&](const vpImage<float> &field) {
      return computeLevelProfile(field, camera, wMc.R, lines);
    };
    const LevelProfile falling = profileOf(gradient.negative), rising = profileOf(gradient.positive);
    const LevelProfile foreground = profileOf(saliency.p_background);
    addAll(falling, -1, statistics.gradient.of_all);
    addAll(rising, 1, statistics.gradient.of_all);
    addAll(foreground, 1, statistics.foreground.of_all);
    const std::optional<Pose> truth = interpolate(source.truth(), frame.stamp_ns);
    if (!truth)
      continue;
    addMinima(gradient, camera, *truth * source.bMc(), trunks, range, options.tracking.energy, statistics);
    const std::vector<TrueView> views = trueViews(trunks, *truth * source.bMc(), range, 1);
    for (const double side : {1.0, -1.0})
      for (const TrueView &view : views) {
        const double q = std::tan(view.ahead + side * view.half_angle);
        addNear(side > 0 ? falling : rising, -side, q, statistics.gradient.of_borders);
        addNear(foreground, 1, q, statistics.foreground.of_borders);
      }
  }
  return statistics;
}

std::string toTable(const DetectorStatistics &statistics)
{
  constexpr double kShares[] = {0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99};
  std::string text = fmt::format("{:<46}", "along a line, quantile");
  for (const double share : kShares)
    text += fmt::format("{:8.2f}", share);
  const auto row = [&](const char *name, const std::vector<double> &values) {
    text += fmt::format("\n{:<46}", name);
    for (const double share : kShares)
      text += figure(quantileOf(values, share), 8, 4);
  };
  row("mean gradient (Eq. 19), all lines", statistics.gradient.of_all);
  row("mean gradient, borders of near true trunks", statistics.gradient.of_borders);
  row("mean of 1 - p(background) (Eq. 20), all lines", statistics.foreground.of_all);
  row("mean of 1 - p(background), near true trunks", statistics.foreground.of_borders);
  return text +
         fmt::format("\n\nminima of Eq. 3 next to near true trunks: {}, none in {} views; they are off by what their "
                     "curvature says at alpha{}\n",
                     statistics.squared_errors.size(), statistics.without_minimum,
                     figure(statistics.calibratedAlpha(), 8, 3));
}
} // namespace bole::apps
