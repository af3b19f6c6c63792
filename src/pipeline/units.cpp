// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/units.h"

#include <cmath>

namespace bole
{
StageOptions inUnits(StageOptions options, double metres)
{
  if (metres == 1)
    return options;
  FlowOptions &flow = options.flow;
  DetectorOptions &detection = options.detection;
  MapOptions &map = options.map;
  for (double *length :
       {&flow.view_spacing, &flow.view_correlation, &flow.trunk_low, &flow.trunk_high, &flow.track_range,
        &detection.range_min, &detection.range_max, &detection.radius_min, &detection.radius_max, &map.most_place_sigma,
        &map.through_range, &map.usual_radius, &map.merge_distance, &map.radius_min, &map.radius_max,
        &options.smoothing.prior_radius, &options.smoothing.prior_position_sigma, &options.saliency.near_range,
        &options.saliency.min_range})
    *length /= metres;
  return options;
}

Pose inMetres(const Pose &wMb, const Pose &bMc, double metres)
{
  if (metres == 1)
    return wMb;
  Pose wMc = wMb * bMc;
  wMc.t *= metres;
  return wMc * bMc.inverse();
}

Trunk inMetres(const Trunk &trunk, double metres)
{
  Trunk scaled = trunk;
  scaled.xy *= metres;
  scaled.log_radius += std::log(metres);
  return scaled;
}

TrunkRecord inMetres(TrunkRecord record, double metres)
{
  record.xy *= metres;
  record.radius *= metres;
  record.ground_z *= metres;
  record.covariance.topRows<3>() *= metres;
  record.covariance.leftCols<3>() *= metres;
  return record;
}

void toMetres(FrameReport &report, const Pose &bMc, double metres)
{
  if (metres == 1)
    return;
  report.wMb = inMetres(report.wMb, bMc, metres);
  report.wMc.t *= metres;
  report.pose_covariance.topRows<3>() *= metres;
  report.pose_covariance.leftCols<3>() *= metres;
  for (TrunkInView &trunk : report.trunks)
    trunk.distance *= metres;
  for (KnownTrunk &trunk : report.map)
    trunk.trunk = inMetres(trunk.trunk, metres);
  for (TriangulatedRay &point : report.points) {
    point.inverse_distance /= metres;
    point.sigma /= metres;
  }
}
} // namespace bole
