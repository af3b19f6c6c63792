// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/camera_gyro.h"

#include "geometry/constants.h"
#include "motion/calibration_fit.h"
#include "motion/epipolar.h"

#include <algorithm>
#include <fmt/format.h>

namespace bole::calibration
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
/// Errors in what relates camera and gyro, which turn the points' rotations against the gyro's by a share of the
/// rotation itself: beside the bias the attitude of the camera on the body, its two focal lengths, and the scale of the
/// gyro.
constexpr int kShares = 9;
constexpr double kFocal = 0.007;    ///< of the narrow part of the prior on the share of a focal length
constexpr double kGyroScale = 0.01; ///< ... of the gyro's rates
constexpr double kMostShare = 0.6;  ///< more is another fault
constexpr double kWideShare = 0.5;  ///< of the wide ones, and of the attitude [rad]
struct Relation
{
  int first, count; ///< of its unknowns
  double narrow;
};
constexpr Relation kAttitude{3, 3, kMount}, kFocalLengths{6, 2, kFocal}, kRates{8, 1, kGyroScale};

std::vector<RowOf<kShares>> rowsOfShares(const GyroTurns &gyro, const std::vector<Turn> &turns, const Matrix3d &bRc,
                                         double late_s, double overlap)
{
  std::vector<RowOf<kShares>> rows;
  for (const Turn &turn : turns) {
    const auto turned = gyro.between(turn.a_ns + nsOf(late_s), turn.b_ns + nsOf(late_s));
    if (!turned)
      continue;
    const Vector3d angle = logSo3(*turned), seen = bRc.transpose() * angle;
    Eigen::Matrix<double, 3, kShares> J;
    J << turn.duration() * Matrix3d::Identity(), -skew(angle), bRc.col(1) * seen.y(), bRc.col(0) * seen.x(), angle;
    rows.emplace_back(J, Vector3d(logSo3(orthonormalized(turned->transpose() * turn.aRb))), turn.information, overlap);
  }
  return rows;
}

/// Fits the bias and the relations in \p open, the others being as they are stated; the cost counts how far each is
/// from that.
FittedOf<kShares> fitShares(const std::vector<RowOf<kShares>> &rows, const std::vector<Relation> &open, double scatter)
{
  Eigen::Matrix<double, kShares, 1> prior;
  prior.head<3>().setConstant(kWideBias);
  for (const Relation &relation : {kAttitude, kFocalLengths, kRates})
    prior.segment(relation.first, relation.count).setConstant(relation.narrow);
  for (const Relation &relation : open)
    prior.segment(relation.first, relation.count).setConstant(kWideShare);
  FittedOf<kShares> fit = solve<kShares>(rows, prior.cwiseAbs2(), scatter);
  fit.cost += fit.value.cwiseQuotient(prior).squaredNorm();
  return fit;
}

/// What \p relation was found to be, with its sigma, for the user.
SensorVerdict verdictOf(const Relation &relation, const Eigen::VectorXd &x, double sigma)
{
  if (relation.first == kFocalLengths.first) {
    const Eigen::Array2d percent = 100 * (1 / (1 - x.array()) - 1);
    return {
        "images", "focal", 0,
        fmt::format("images: focal lengths of the camera file off by {:+.1f} % (fx) and {:+.1f} % (fy), +- {:.1f} %, "
                    "by the gyro",
                    percent[0], percent[1], 100 * sigma)};
  }
  if (relation.first == kAttitude.first)
    return {"images", "mount", 0,
            fmt::format("images: the camera stands {:.1f} +- {:.1f} degrees otherwise to the gyro than T_BS says (roll "
                        "{:.1f}, pitch {:.1f}, yaw {:.1f})",
                        x.norm() / kDegree, sigma / kDegree, x[0] / kDegree, x[1] / kDegree, x[2] / kDegree)};
  return {"gyro", "scale", 0,
          fmt::format("gyro: its rates are off by {:+.1f} +- {:.1f} %", 100 * x[0] / (1 - x[0]), 100 * sigma)};
}
} // namespace

Fitted fitBias(const GyroTurns &gyro, const std::vector<Turn> &turns, double late_s, double overlap, double scatter)
{
  std::vector<Row> rows;
  for (const Turn &turn : turns) {
    const auto turned = gyro.between(turn.a_ns + nsOf(late_s), turn.b_ns + nsOf(late_s));
    if (turned) // the rates less the bias: what is left of it turns the other way
      rows.emplace_back(Matrix3d(turn.duration() * Matrix3d::Identity()),
                        logSo3(orthonormalized(turned->transpose() * turn.aRb)), turn.information, overlap);
  }
  return solve(rows, kWideBias * kWideBias, scatter);
}

namespace
{
/// \p px of a lens with the radial distortion \p k1, as \p camera without it would show it.
Eigen::Vector2d undistorted(const Eigen::Vector2d &px, const PinholeCamera &camera, double k1)
{
  constexpr int kIterations = 8;
  const Eigen::Vector2d seen = camera.ray(px).head<2>();
  Eigen::Vector2d straight = seen;
  for (int i = 0; i < kIterations; ++i)
    straight = seen / (1 + k1 * straight.squaredNorm());
  return camera.project(straight.homogeneous());
}

/// Logarithms of the residuals of \p pairs [px], each under a motion of a camera with the distortion \p k1.
Eigen::VectorXd logResiduals(const std::vector<std::vector<PointMatch>> &pairs, const PinholeCamera &camera, double k1)
{
  constexpr double kLeast_px = 0.02, kNoMotion_px = 1; // least that points are worth; where they agree on none
  Eigen::VectorXd residuals(static_cast<Eigen::Index>(pairs.size()));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    std::vector<PointMatch> matches = pairs[i];
    for (PointMatch &match : matches) {
      match.a_px = undistorted(match.a_px, camera, k1);
      match.b_px = undistorted(match.b_px, camera, k1);
    }
    const double sigma_px = estimateRelativePose(matches, camera).sigma_px;
    residuals[static_cast<Eigen::Index>(i)] = std::log(sigma_px > 0 ? std::max(sigma_px, kLeast_px) : kNoMotion_px);
  }
  return residuals;
}
} // namespace

std::optional<double> findDistortion(const std::vector<std::vector<PointMatch>> &pairs, const PinholeCamera &camera,
                                     bool is_focal_known)
{
  constexpr std::size_t kLeastPairs = 8;
  constexpr int kSteps = 4;
  constexpr double kStep = 0.1;                   // of the share by which the corner of the image is moved
  constexpr double kCloser = 0.05, kSharp = 0.05; // of the logarithm of the residual; lenses as told: at most .02
  constexpr double kSure = 2.5;                   // standard deviations of the mean over the pairs
  if (pairs.size() < kLeastPairs)
    return std::nullopt;
  const double corner = camera.ray({0, 0}).head<2>().squaredNorm(), count = static_cast<double>(pairs.size());
  Eigen::VectorXd straight, best; // residuals of the lens as it is told, and under the distortion that fits best
  using Costs = Eigen::Matrix<double, 2 * kSteps + 1, 1>;
  Costs costs = Costs::Zero(); // by distortion, at the focal length that fits best
  for (const double factor : is_focal_known ? std::vector{1.0} : std::vector{0.6, 0.8, 1.0, 1.25, 1.6}) {
    const PinholeCamera other = motion::withFocal(camera, factor);
    Costs here;
    bool is_best = false;
    for (int i = -kSteps; i <= kSteps; ++i) {
      const Eigen::VectorXd residuals = logResiduals(pairs, other, kStep * i / corner * factor * factor);
      here[kSteps + i] = residuals.mean();
      if (i == 0 && (straight.size() == 0 || residuals.mean() < straight.mean()))
        straight = residuals;
      if (best.size() == 0 || residuals.mean() < best.mean()) {
        best = residuals;
        is_best = true;
      }
    }
    if (is_best)
      costs = here;
  }
  Eigen::Index at = 0;
  const double least = costs.minCoeff(&at);
  if (at == 0 || at == 2 * kSteps)
    return std::nullopt;
  const Eigen::VectorXd closer = straight - best;
  const double sigma = std::sqrt((closer.array() - closer.mean()).square().sum() / (count - 1) / count);
  if (closer.mean() < std::max(kCloser, kSure * sigma) || std::min(costs[at - 1], costs[at + 1]) - least < kSharp)
    return std::nullopt;
  return kStep * (static_cast<double>(at) - kSteps + peakOffset(-costs[at - 1], -least, -costs[at + 1])) / corner;
}

std::vector<SensorVerdict> judgeCamera(const GyroTurns &gyro, const std::vector<Turn> &turns, const Matrix3d &bRc,
                                       double overlap)
{
  constexpr double kAsGood = 9;   // the data do not tell one from the other: three standard deviations
  constexpr double kInHalves = 6; // two and a half: what begins later is no constant
  const std::vector<Relation> all = {kAttitude, kFocalLengths, kRates};
  const auto rowsAt = [&](double late_s) { return rowsOfShares(gyro, turns, bRc, late_s, overlap); };
  const Minimum late = minimiseLate([&](double late_s) { return fitShares(rowsAt(late_s), all, 1).cost; });
  if (!late.is_inside)
    return {};
  const std::vector<RowOf<kShares>> rows = rowsAt(late.late_s);
  const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(rows.size() / 2);
  const double scatter = fitShares(rows, all, 0).scatter;
  const auto gainOf = [&](const std::vector<RowOf<kShares>> &some, const Relation &relation) {
    return fitShares(some, {}, scatter).cost - fitShares(some, {relation}, scatter).cost;
  };
  std::vector<SensorVerdict> verdicts;
  double best = 0;
  for (const Relation &relation : all) {
    const FittedOf<kShares> fit = fitShares(rows, {relation}, scatter);
    const Eigen::VectorXd x = fit.value.segment(relation.first, relation.count);
    const double variance = fit.covariance.diagonal().segment(relation.first, relation.count).mean();
    const double gain = gainOf(rows, relation);
    if (gain < std::max(kBetter, best - kAsGood) || fit.failing >= kMostFailing || x.maxCoeff() > kMostShare ||
        gainOf({rows.begin(), middle}, relation) < kInHalves || gainOf({middle, rows.end()}, relation) < kInHalves)
      continue;
    if (gain > best + kAsGood)
      verdicts.clear();
    verdicts.push_back(verdictOf(relation, x, std::sqrt(variance)));
    best = std::max(best, gain);
  }
  return verdicts;
}
} // namespace bole::calibration
