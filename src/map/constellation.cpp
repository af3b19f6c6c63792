// SPDX-License-Identifier: GPL-2.0-or-later
#include "map/constellation.h"

#include <Eigen/Dense>

namespace bole
{
namespace
{
constexpr double kInMap = 0.7;          ///< that a trunk seen is in the map: recall of a map by one flight
constexpr double kOnMap = 0.5;          ///< before anything is seen: that the flight is on the map
constexpr double kPlaceFloor = 0.05;    ///< bow and lean between two flights' views of one trunk [m]
constexpr double kLogRadiusFloor = 0.1; ///< the same of its width
constexpr double kRelativeScale = 0.02; ///< scale of one map against the other: two pose filters
constexpr std::size_t kProposers = 10;  ///< trunks seen that propose poses: the best known ones
constexpr double kReach = 10;           ///< what surrounds a map and still counts as on it [m]

double normal(double x, double sigma)
{
  return std::exp(-0.5 * x * x / (sigma * sigma)) / (sigma * std::sqrt(2 * M_PI));
}

/// Place and log radius of a trunk that is compared.
struct Landmark
{
  int id;
  Eigen::Vector2d xy;
  Eigen::Matrix2d covariance;
  double log_radius, log_radius_sigma;
};

std::vector<Landmark> landmarksOf(const std::vector<TrunkRecord> &trunks)
{
  std::vector<Landmark> landmarks;
  for (const TrunkRecord &trunk : trunks) {
    if (trunk.radius > 0)
      landmarks.push_back({trunk.id, trunk.xy,
                           trunk.covarianceXy() + kPlaceFloor * kPlaceFloor * Eigen::Matrix2d::Identity(),
                           std::log(trunk.radius), std::hypot(trunk.radiusSigma() / trunk.radius, kLogRadiusFloor)});
  }
  return landmarks;
}

/// Density and radii of the trunks of a map: what chance would match.
struct MapStatistics
{
  double area = 0, density = 0, log_radius_mean = 0, log_radius_sigma = 0.2;

  explicit MapStatistics(const std::vector<Landmark> &map)
  {
    Eigen::Vector2d low = map.front().xy, high = low;
    double sum = 0, squares = 0;
    for (const Landmark &landmark : map) {
      low = low.cwiseMin(landmark.xy);
      high = high.cwiseMax(landmark.xy);
      sum += landmark.log_radius;
      squares += landmark.log_radius * landmark.log_radius;
    }
    const auto n = static_cast<double>(map.size());
    area = (high.x() - low.x() + 2 * kReach) * (high.y() - low.y() + 2 * kReach);
    density = n / ((high.x() - low.x() + 2) * (high.y() - low.y() + 2));
    log_radius_mean = sum / n;
    log_radius_sigma = std::max(0.2, std::sqrt(std::max(0.0, squares / n - log_radius_mean * log_radius_mean)));
  }
};

/// Likelihood ratio that a trunk seen at \p at is that one of the map and not any trunk.
double likelihoodRatio(const Landmark &seen, const Eigen::Vector2d &at, const Eigen::Matrix2d &R,
                       const Landmark &landmark, const MapStatistics &statistics)
{
  const Eigen::Matrix2d S = R * seen.covariance * R.transpose() + landmark.covariance;
  const Eigen::Vector2d d = at - landmark.xy;
  const double place = std::exp(-0.5 * d.dot(S.inverse() * d)) / (2 * M_PI * std::sqrt(S.determinant()));
  const double width =
      normal(seen.log_radius - landmark.log_radius, std::hypot(seen.log_radius_sigma, landmark.log_radius_sigma));
  const double any =
      statistics.density * normal(seen.log_radius - statistics.log_radius_mean, statistics.log_radius_sigma);
  return place * width / std::max(any, 1e-12);
}

struct Mode
{
  Placement placement;
  double log_mass = 0; ///< likelihood ratio times the volume of the mode
};

/// Refines a pose to the nearest mode of the likelihood and computes the mass of the mode.
std::optional<Mode> refineMode(Placement pose, const std::vector<Landmark> &seen, const std::vector<Landmark> &map,
                               const MapStatistics &statistics)
{
  Mode mode;
  for (int iteration = 0; iteration < 4; ++iteration) {
    const Eigen::Matrix2d R = Eigen::Rotation2Dd(pose.yaw).toRotationMatrix();
    const Eigen::Matrix2d turned = Eigen::Rotation2Dd(pose.yaw + M_PI_2).toRotationMatrix();
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    pose.matches.clear();
    mode.log_mass = 0;
    for (const Landmark &a : seen) {
      const Eigen::Vector2d at = R * a.xy + pose.t;
      const Landmark *best = nullptr;
      double odds = 0;
      for (const Landmark &b : map) {
        if ((at - b.xy).squaredNorm() > 4) // [m^2], beyond any covariance that is of use
          continue;
        const double o = likelihoodRatio(a, at, R, b, statistics);
        if (o > odds)
          odds = o, best = &b;
      }
      mode.log_mass += std::log(1 - kInMap + kInMap * odds);
      if (!best || odds < 1)
        continue;
      pose.matches.emplace_back(a.id, best->id);
      Eigen::Matrix<double, 2, 3> J;
      J << turned * a.xy, Eigen::Matrix2d::Identity();
      const Eigen::Matrix2d weight = (R * a.covariance * R.transpose() + best->covariance).inverse();
      information += J.transpose() * weight * J;
      right += J.transpose() * weight * (best->xy - at);
    }
    if (pose.matches.size() < 3)
      return std::nullopt;
    pose.covariance = information.inverse();
    if (iteration == 3)
      break;
    const Eigen::Vector3d step = pose.covariance * right;
    pose.yaw += step.x();
    pose.t += step.tail<2>();
  }
  mode.log_mass += 0.5 * std::log(std::pow(2 * M_PI, 3) * pose.covariance.determinant());
  mode.placement = pose;
  return mode;
}

bool isSame(const Placement &a, const Placement &b, const Eigen::Vector2d &centre)
{
  return (a * centre - b * centre).norm() < 0.5 && std::abs(std::remainder(a.yaw - b.yaw, 2 * M_PI)) < 0.1;
}
} // namespace

std::optional<Placement> placeOnMap(const std::vector<TrunkRecord> &seen_trunks,
                                    const std::vector<TrunkRecord> &map_trunks, double certain)
{
  std::vector<Landmark> seen = landmarksOf(seen_trunks);
  const std::vector<Landmark> map = landmarksOf(map_trunks);
  if (seen.size() < 3 || map.size() < 3)
    return std::nullopt;
  std::sort(seen.begin(), seen.end(),
            [](const Landmark &a, const Landmark &b) { return a.covariance.trace() < b.covariance.trace(); });
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Landmark &a : seen)
    centre += a.xy / static_cast<double>(seen.size());
  const MapStatistics statistics(map);
  std::vector<Mode> modes;
  const std::size_t proposers = std::min(seen.size(), kProposers);
  for (std::size_t i = 0; i < proposers; ++i) {
    for (std::size_t j = i + 1; j < proposers; ++j) {
      const Eigen::Vector2d ab = seen[j].xy - seen[i].xy;
      if (ab.norm() < 1)
        continue;
      for (const Landmark &k : map) {
        if (std::abs(k.log_radius - seen[i].log_radius) > 3 * std::hypot(k.log_radius_sigma, seen[i].log_radius_sigma))
          continue;
        for (const Landmark &l : map) {
          const Eigen::Vector2d kl = l.xy - k.xy;
          const double variance = (seen[i].covariance + seen[j].covariance + k.covariance + l.covariance).trace() / 2 +
                                  std::pow(kRelativeScale * ab.norm(), 2);
          if (&k == &l || std::pow(kl.norm() - ab.norm(), 2) > 9 * variance ||
              std::abs(l.log_radius - seen[j].log_radius) >
                  3 * std::hypot(l.log_radius_sigma, seen[j].log_radius_sigma))
            continue;
          Placement pose;
          pose.yaw = std::atan2(kl.y(), kl.x()) - std::atan2(ab.y(), ab.x());
          pose.t = 0.5 * (k.xy + l.xy) - Eigen::Rotation2Dd(pose.yaw) * (0.5 * (seen[i].xy + seen[j].xy));
          const std::optional<Mode> mode = refineMode(pose, seen, map, statistics);
          if (!mode)
            continue;
          const auto known = std::find_if(modes.begin(), modes.end(), [&](const Mode &other) {
            return isSame(other.placement, mode->placement, centre);
          });
          if (known == modes.end())
            modes.push_back(*mode);
          else if (mode->log_mass > known->log_mass)
            *known = *mode;
        }
      }
    }
  }
  if (modes.empty())
    return std::nullopt;
  auto best = std::max_element(modes.begin(), modes.end(),
                               [](const Mode &a, const Mode &b) { return a.log_mass < b.log_mass; });
  // masses relative to the best, and that of a flight that is anywhere else
  double sum = std::exp(std::log(statistics.area * 2 * M_PI * (1 - kOnMap) / kOnMap) - best->log_mass);
  for (const Mode &mode : modes)
    sum += std::exp(mode.log_mass - best->log_mass);
  best->placement.probability = 1 / sum;
  best->placement.yaw = std::remainder(best->placement.yaw, 2 * M_PI);
  if (best->placement.probability < certain)
    return std::nullopt;
  return best->placement;
}
} // namespace bole
