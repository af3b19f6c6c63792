// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/pose_estimator.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace
{
constexpr double kStartSigma = 0.01;   ///< of a pose that the caller vouches for, m and rad
constexpr double kScanMin_px = 4;      ///< least half-width of the first scan
constexpr double kRefine_px = 5;       ///< greatest half-width of the second
constexpr double kReach_px = 4;        ///< between the place of a piece and that of its border
constexpr double kKnownVelocity = 0.3; ///< how much a known velocity changes, as a share of an unknown one
constexpr double kClimb = 0.25;        ///< a step along the trunks, as a share of a step across them
// Without a prior: limits below which right poses of rendered flights rarely fall.
constexpr double kRightAgreement = 0.79; ///< mean of right poses; wrong ones have 0.57
constexpr double kMinAgreement = 0.68;
constexpr double kTrustAgain = 0.06;     ///< beyond kMinAgreement, after a doubt
constexpr double kAgreementSigma = 0.07; ///< of right poses from one frame to the next, as a share of what it was
constexpr double kMaxSurprise = 9;       ///< chi-square of a motion and a loss of agreement that no flight has
constexpr double kAgreementRate = 0.25, kSurprisedRate = 0.05; ///< how fast the remembered agreement follows

/// What a border may show at each offset: how well it continues what it showed before, 0 .. 1, widened by a pixel.
std::vector<float> responseOf(const ModelBorder &border)
{
  const std::vector<float> &g = border.contrast;
  const bool is_known = border.hasKnownSign();
  float reference = float(border.known_contrast.value_or(0));
  if (!is_known)
    for (const float v : g)
      reference = std::max(std::abs(reference), std::abs(v));
  std::vector<float> sharp(g.size(), 0.f), wide(g.size(), 0.f);
  for (std::size_t k = 0; k < g.size() && reference != 0; ++k) {
    const float share = g[k] / reference;
    sharp[k] = std::min(is_known ? std::max(share, 0.f) : std::abs(share), 1.f);
    if (sharp[k] > 0 && !border.known_profile.empty()) {
      const float alike = std::max(0.f, float(border.likeness(int(k) - int(g.size()) / 2)));
      sharp[k] = std::min(1.5f * sharp[k], 1.f) * alike * alike;
    }
  }
  for (std::size_t k = 1; k + 1 < g.size(); ++k)
    wide[k] = std::max({sharp[k], 0.9f * sharp[k - 1], 0.9f * sharp[k + 1]});
  return wide;
}

/// The peak that best continues the border, next to \p expected_px; -1: none within three standard deviations.
int bestPeak(const ModelBorder &border, double expected_px, double sigma_px)
{
  double reference = border.known_contrast.value_or(0);
  if (!border.hasKnownSign())
    for (const BorderPeak &peak : border.peaks)
      if (std::abs(peak.contrast) > std::abs(reference))
        reference = peak.contrast;
  int best = -1;
  double least = 4.5; // half of three standard deviations squared
  for (int p = 0; p < int(border.peaks.size()); ++p) {
    const BorderPeak &peak = border.peaks[std::size_t(p)];
    const double away = (peak.offset_px - expected_px) / sigma_px;
    double strength = std::log(std::abs(peak.contrast / reference)) / 0.6;
    if (!border.hasKnownSign())
      strength = std::min(strength, 0.0);
    double cost = 0.5 * away * away + 0.5 * strength * strength;
    if (border.hasKnownSign() && peak.contrast * reference < 0)
      cost += 3;
    if (!border.known_profile.empty())
      cost += 2 * (1 - std::max(0.0, border.likeness(int(std::lround(peak.offset_px)))));
    if (cost < least)
      least = cost, best = p;
  }
  return best;
}

double greatestSigma(const Matrix3d &covariance)
{
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance).eigenvalues()(2));
}

double focalOf(const PinholeCamera &camera) { return 0.5 * (camera.fx + camera.fy); }

/// Mean direction of the trunks in the object frame: nothing is seen of a move along it.
Vector3d alongTrunks(const std::vector<ModelTrunk> &trunks)
{
  Vector3d sum = Vector3d::Zero();
  for (const ModelTrunk &trunk : trunks) {
    const Vector3d axis = trunk.object().axis();
    sum += sum.dot(axis) < 0 ? Vector3d(-axis) : axis;
  }
  return sum.normalized();
}
} // namespace

void PoseEstimator::setPose(const Pose &cMo)
{
  m_pose = cMo;
  m_velocity.reset();
  m_frames_since_good = 0;
  m_unobserved.resize(6, 0);
}

void PoseEstimator::forget()
{
  m_in_view.clear();
  trunks.clear();
  prior.reset();
  setPose(Pose());
  m_covariance.setZero();
}

void PoseEstimator::start(const vpImage<unsigned char> &I, const PinholeCamera &camera, const Pose &cMo)
{
  setPose(cMo);
  prior.reset();
  m_agreement = kRightAgreement;
  m_is_doubtful = false;
  m_covariance = kStartSigma * kStartSigma * Matrix6d::Identity();
  for (ModelTrunk &trunk : trunks)
    trunk.forget();
  predictTrunks(camera);
  for (const std::size_t k : m_in_view) {
    ModelTrunk &trunk = trunks[k];
    trunk.scan(I, int(kScanMin_px), options.min_contrast);
    for (ModelBorder &border : trunk.borders()) {
      int best = -1;
      double strongest = 0;
      for (int p = 0; p < int(border.peaks.size()); ++p) {
        const BorderPeak &peak = border.peaks[std::size_t(p)];
        const double strength = std::abs(peak.contrast) * (1 - 0.15 * std::abs(peak.offset_px));
        if (strength > strongest)
          strongest = strength, best = p;
      }
      trunk.choose(border, best, kReach_px, camera, options.min_contrast);
    }
    trunk.remember();
    trunk.remember(); // the pose is vouched for: signs are believed from two frames on
  }
  m_in_view.clear();
}

ExpectedPose PoseEstimator::predict() const
{
  ExpectedPose expected;
  if (prior) {
    expected.cMo = movedBy(m_pose, freePart(twistBetween(m_pose, prior->cMo)));
    expected.covariance = prior->covariance;
    return expected;
  }
  const Vector3d up = m_pose.R * alongTrunks(trunks);
  expected.cMo = movedBy(m_pose, freePart(m_velocity.value_or(Vector6d::Zero())));
  const double share = m_velocity ? kKnownVelocity : 1;
  const double across = share * options.step_sigma_m, along = kClimb * options.step_sigma_m;
  Matrix6d Q = Matrix6d::Zero();
  Q.topLeftCorner<3, 3>() =
      across * across * Matrix3d::Identity() + (along * along - across * across) * up * up.transpose();
  Q.diagonal().tail<3>().setConstant(options.turn_sigma_rad * options.turn_sigma_rad); // a drone turns at will
  expected.covariance = m_covariance + Q;
  return expected;
}

void PoseEstimator::predictTrunks(const PinholeCamera &camera)
{
  m_in_view.clear();
  for (std::size_t k = 0; k < trunks.size(); ++k) {
    trunks[k].predict(m_pose, camera, options);
    if (trunks[k].isVisible() && far_m > 0 && trunks[k].distance() > far_m)
      trunks[k].makeInvisible();
    if (trunks[k].isVisible())
      m_in_view.push_back(k);
  }
  std::sort(m_in_view.begin(), m_in_view.end(),
            [&](std::size_t a, std::size_t b) { return trunks[a].distance() < trunks[b].distance(); });
  for (std::size_t i = 0; i < m_in_view.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      trunks[m_in_view[i]].hideBehind(trunks[m_in_view[j]], camera, options);
  const auto isGone = [&](std::size_t k) { return !trunks[k].isVisible(); };
  m_in_view.erase(std::remove_if(m_in_view.begin(), m_in_view.end(), isGone), m_in_view.end());
}

void PoseEstimator::scanTrunks(const vpImage<unsigned char> &I, const Matrix6d &covariance, double max_half_px)
{
  for (const std::size_t k : m_in_view) {
    double variance = 0;
    for (const ModelBorder &border : trunks[k].borders())
      if (border.visible)
        variance =
            std::max(variance, (border.sideways_by_twist * covariance * border.sideways_by_twist.transpose())(0));
    const double sigma = std::sqrt(variance + options.border_sigma_px * options.border_sigma_px);
    const double half = std::min(std::max(3 * sigma, kScanMin_px), max_half_px);
    trunks[k].scan(I, int(std::ceil(half)), options.min_contrast);
  }
}

Vote PoseEstimator::agree(const Matrix6d &covariance) const
{
  std::vector<BallotBorder> borders;
  for (const std::size_t k : m_in_view)
    for (const ModelBorder &border : trunks[k].borders())
      if (border.visible)
        borders.push_back({border.sideways_by_twist, responseOf(border)});
  return vote(borders, covariance);
}

void PoseEstimator::choosePeaks(const Vector6d &twist, double reach_px, const PinholeCamera &camera)
{
  for (const std::size_t k : m_in_view)
    for (ModelBorder &border : trunks[k].borders())
      if (border.visible)
        trunks[k].choose(border, bestPeak(border, border.sideways_by_twist * twist, options.border_sigma_px), reach_px,
                         camera, options.min_contrast);
}

PoseEstimator::Status PoseEstimator::search(const vpImage<unsigned char> &I, const PinholeCamera &camera,
                                            const ExpectedPose &expected)
{
  m_pose = expected.cMo;
  predictTrunks(camera);
  if (m_in_view.empty()) {
    m_message = "no trunk of the model is in view";
    return Status::no_trunk;
  }
  scanTrunks(I, expected.covariance, options.scan_max_px);
  const Vote voted = agree(expected.covariance);
  const Vector6d twist = freePart(voted.twist);
  choosePeaks(twist, kReach_px, camera);
  m_pose = movedBy(m_pose, twist);
  servo(expected, focalOf(camera));

  predictTrunks(camera); // again, narrowly, where the first pass says
  const Matrix6d information = expected.covariance.llt().solve(Matrix6d::Identity()) + m_information;
  scanTrunks(I, information.llt().solve(Matrix6d::Identity()), kRefine_px);
  choosePeaks(Vector6d::Zero(), kReach_px - 1, camera);
  servo(expected, focalOf(camera));

  const double supporting = support(), agreement = 0.5 * (voted.score + supporting);
  const bool is_surprise = !prior && surprise(expected, agreement) > kMaxSurprise;
  m_agreement += (is_surprise ? kSurprisedRate : kAgreementRate) * (agreement - m_agreement);
  m_is_doubtful = m_agreement < kMinAgreement + (m_is_doubtful ? kTrustAgain : 0);
  if (!is_surprise && supporting >= options.min_support)
    return Status::tracked;
  m_message = is_surprise ? "the camera jumped: the borders found are not those of the frames before"
                          : "the borders of the trunks are not where they can be";
  return Status::lost;
}

/// How unlikely the pose just found is after the frames before: the squared Mahalanobis distance from the motion
/// expected, and that of the loss of \p agreement. After a jump beyond the scan some other pose within the motion
/// expected fits part of the borders by chance; a right one keeps nearly all that it had.
double PoseEstimator::surprise(const ExpectedPose &expected, double agreement) const
{
  const Vector6d jump = twistBetween(expected.cMo, m_pose);
  const double loss = std::max(0.0, 1 - agreement / m_agreement) / kAgreementSigma;
  return jump.dot(expected.covariance.llt().solve(jump)) + loss * loss;
}

/// Covariance and unobserved directions of the pose just found.
void PoseEstimator::keep(const ExpectedPose &expected)
{
  m_covariance =
      (expected.covariance.llt().solve(Matrix6d::Identity()) + m_information).llt().solve(Matrix6d::Identity());
  m_covariance = (0.5 * (m_covariance + m_covariance.transpose())).eval();
  Matrix6d S = Matrix6d::Identity();
  S.diagonal().tail<3>().setConstant(1 / options.lever_m);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(S * m_information * S);
  int n = 0;
  while (n < 6 && eigen.eigenvalues()(n) * options.unobserved_m * options.unobserved_m < 1)
    ++n;
  m_unobserved = eigen.eigenvectors().leftCols(n);
}

/// Whether the pose just found can be trusted.
PoseEstimator::Status PoseEstimator::judge()
{
  const double metres = greatestSigma(m_covariance.topLeftCorner<3, 3>());
  const double radians = greatestSigma(m_covariance.bottomRightCorner<3, 3>());
  if (metres > options.max_sigma_m)
    m_message = fmt::format("the position is known to {:.2g} m only", metres);
  else if (radians > options.max_sigma_rad)
    m_message = fmt::format("the attitude is known to {:.2g} rad only", radians);
  else if (!prior && m_is_doubtful)
    m_message = fmt::format("the borders agree to {:.2f} only: the trunks found may be others", m_agreement);
  else {
    m_message = fmt::format("{} directions are not observed", m_unobserved.cols());
    return m_unobserved.cols() == 0 ? Status::tracked : Status::partly_on_prior;
  }
  return Status::uncertain;
}

PoseEstimator::Status PoseEstimator::track(const vpImage<unsigned char> &I, const PinholeCamera &camera)
{
  const Pose before = m_pose;
  const ExpectedPose expected = predict();
  Status status = search(I, camera, expected);
  if (status != Status::tracked) {
    m_pose = expected.cMo;
    m_covariance = expected.covariance;
    ++m_frames_since_good;
    prior.reset();
    return status;
  }
  keep(expected);
  status = judge();
  // The velocity is not learned over a gap, and not along the trunks: what is not seen must not be integrated.
  m_velocity.reset();
  if (m_frames_since_good == 0) {
    m_velocity = twistBetween(before, m_pose);
    const Vector3d up = m_pose.R * alongTrunks(trunks);
    m_velocity->head<3>() -= up.dot(m_velocity->head<3>()) * up;
  }
  m_frames_since_good = 0;
  for (const std::size_t k : m_in_view)
    trunks[k].remember();
  prior.reset();
  return status;
}

void PoseEstimator::skip()
{
  const ExpectedPose expected = predict();
  m_pose = expected.cMo;
  m_covariance = expected.covariance;
  m_in_view.clear();
  ++m_frames_since_good;
  prior.reset();
}
} // namespace bole
