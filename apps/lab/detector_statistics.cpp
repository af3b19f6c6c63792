// SPDX-License-Identifier: GPL-2.0-or-later
#include "detector_statistics.h"

#include "paper/paper_mapper.h"
#include "support/text.h"
#include "support/units.h"
#include <bole/open_source.h>

#include <algorithm>
#include <cmath>
#include <utility>

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

void addAll(const paper::LevelProfile &profile, double sign, std::vector<double> &values)
{
  for (const double mean : profile.mean)
    if (mean != 0) // in the image
      values.push_back(sign * mean);
}

double distanceTo(const Trunk &trunk, const Pose &wMc) { return (trunk.axisAt(wMc.t.z()) - wMc.t).head<2>().norm(); }

/// The minima of Eq. 3 next to the true trunks, both of whose borders are in the picture.
void addMinima(const paper::SplitGradient &gradient, const PinholeCamera &camera, const Pose &wMc,
               const std::vector<TruthTrunk> &trunks, double range, DetectorStatistics &statistics)
{
  const paper::TreeEnergy energy(gradient, camera, 1);
  const auto rowsOf = [&](const RelativeTrunk &tree, Border border) {
    const paper::BorderInImage line = paper::borderInImage(camera, tree, border);
    return line.end - line.begin;
  };
  for (const TruthTrunk &truth : trunks) {
    const Trunk trunk = trunkOf(truth);
    const RelativeTrunk relative = relativeTrunk(wMc, Pose(), trunk);
    if (truth.radius <= 0 || distanceTo(trunk, wMc) > range || relative.cRt(2, 0) <= 0 ||
        rowsOf(relative, Border::left) < camera.height / 2 || rowsOf(relative, Border::right) < camera.height / 2)
      continue;
    if (const auto summary = paper::minimised(energy, relative)) {
      const Vector4d d = relative.minus(summary->optimum);
      statistics.squared_errors.push_back(d.dot(summary->F * d));
    }
    else {
      ++statistics.without_minimum;
    }
  }
}
} // namespace

paper::LineQuartiles DetectorStatistics::quartiles() const
{
  return {quantileOf(gradient, 0.75), quantileOf(foreground, 0.75)};
}

double DetectorStatistics::calibratedAlpha() const
{
  constexpr double kChiSquareMedian = 3.357; // of four degrees of freedom
  return kChiSquareMedian / medianOf(squared_errors);
}

DetectorStatistics detectorStatistics(const std::string &sequence, double range)
{
  const auto source = openSource(sequence);
  const PinholeCamera camera = source->camera();
  const std::vector<TruthTrunk> trunks = readTruthTrunks(sequence);
  paper::Saliency saliency(camera);
  std::optional<std::int64_t> last_ns;
  DetectorStatistics statistics;
  for (Frame frame; source->next(frame);) {
    if (frame.status != FrameStatus::ok || !frame.wMb_odometry)
      continue;
    std::optional<paper::Turn> turn;
    if (last_ns)
      turn = paper::gyroTurn(frame.gyro, *last_ns, frame.stamp_ns, source->bMc());
    vpImage<float> near = saliency.update(frame.image, turn);
    if (!std::exchange(last_ns, frame.stamp_ns))
      continue;
    for (unsigned i = 0; i < near.getSize(); ++i)
      near.bitmap[i] = 1 - near.bitmap[i];
    const paper::SplitGradient gradient = paper::splitGradient(frame.image);
    const Pose wMc = *frame.wMb_odometry * source->bMc();
    const paper::LevelProfile falling(gradient.negative, camera, wMc.R), rising(gradient.positive, camera, wMc.R),
        foreground(near, camera, wMc.R);
    addAll(falling, -1, statistics.gradient);
    addAll(rising, 1, statistics.gradient);
    addAll(foreground, 1, statistics.foreground);
    if (frame.wMb_truth)
      addMinima(gradient, camera, *frame.wMb_truth * source->bMc(), trunks, range, statistics);
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
  row("mean gradient (Eq. 19), all lines", statistics.gradient);
  row("mean of 1 - p(background) (Eq. 20), all lines", statistics.foreground);
  return text +
         fmt::format("\n\nminima of Eq. 3 next to near true trunks: {}, none in {} views; they are off by what their "
                     "curvature says at alpha{}\n",
                     statistics.squared_errors.size(), statistics.without_minimum,
                     figure(statistics.calibratedAlpha(), 8, 3));
}
} // namespace bole::apps
