// SPDX-License-Identifier: GPL-2.0-or-later
#include "map/trunk_map.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
/// Logistic regression of "within 0.4 m and half the radius of a true trunk" on what the map knows of every candidate,
/// over 20 simulated flights (seeds 31 to 50: sun and overcast, dark to bright bark, 0.04 to 0.09 trunks a m^2, four
/// paths, some through H.264). On 15 other flights, the rendered ones among them, the area under its ROC curve is .93.
/// kSeeThrough was added to it later, chosen between .6 and 1 on the flights of seeds 31 to 60. What the radius says
/// besides kLogRadius is a prior that is learnt from the trunks of the flight: TrunkMap::estimateRadii(). kLogRadius
/// was chosen between -.5 and -1.6 on the flights of seeds 400 to 423, 500 to 507 (thick) and 520 to 527 (thin).
constexpr double kBias = 3.35;
constexpr double kInnovation = -2.29; ///< a pixel of rms between prediction and what was found
constexpr double kMissed = -3.77;     ///< share of frames in which it should have been seen and was not
constexpr double kLogRadius = -0.5;   ///< wide ones are more often gaps between trunks
constexpr double kSeeThrough = -0.8;  ///< log of 1 + MapTrunk::seeThroughRatio
constexpr double kLogParallax = 0.69;
constexpr double kLogContrast = 0.49;
constexpr double kRedetections = 0.54; ///< log of 1 + times the detector came to the same hypothesis
constexpr double kLogPlaceSigma = -0.73;
} // namespace

void TrunkMap::estimateRadii()
{
  constexpr double kOfAWood = 0.5; // standard deviation of the log radius within a wood: 1 sigma is a factor of 1.6
  double precision = 1 / (kSigmaOfWoods * kSigmaOfWoods), sum = precision * std::log(m_options.usual_radius);
  for (const MapTrunk &trunk : m_trunks) {
    if (trunk.removed || trunk.status == TrunkStatus::candidate)
      continue;
    const double weight = 1 / (kOfAWood * kOfAWood + trunk.covariance(2, 2));
    precision += weight;
    sum += weight * trunk.trunk.log_radius;
  }
  m_radii = {sum / precision, kOfAWood * kOfAWood + 1 / precision};
}

double TrunkMap::evidence(const MapTrunk &trunk) const
{
  const double missed = trunk.misses / (trunk.hits + trunk.misses + 2.0);
  return kBias + kInnovation * std::sqrt(trunk.innovation2) / m_options.innovation_unit_px + kMissed * missed +
         kLogRadius * (trunk.trunk.log_radius - m_radii.log_mean) + m_radii.logOdds(trunk.trunk.log_radius) +
         kSeeThrough * std::log1p(trunk.seeThroughRatio()) + kLogParallax * std::log(trunk.parallax() + 0.01) +
         kLogContrast * std::log(trunk.contrast + 0.005) + kRedetections * std::log1p(trunk.redetections) +
         kLogPlaceSigma * std::log(trunk.placeSigma() + 1e-3);
}

double logOddsOfSurface(double continuity)
{
  constexpr double kContinues = 0.15, kByContinuity = 24; // correlation at which both are as likely; log-odds of a unit
  return std::log((1 + std::exp(kByContinuity * (continuity - kContinues))) / 2);
}

double TrunkMap::logOdds(const MapTrunk &trunk) const
{
  if (trunk.final_odds)
    return *trunk.final_odds;
  const double odds =
      trunk.consistency_views == 0 ? evidence(trunk) : std::min(evidence(trunk), trunk.consistency_odds);
  return trunk.continuity_views == 0 ? odds : odds - std::max(0.0, logOddsOfSurface(trunk.continuity));
}
} // namespace bole
