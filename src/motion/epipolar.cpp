// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/epipolar.h"

#include "geometry/median.h"
#include "geometry/so3.h"
#include "geometry/solve_definite.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <random>

namespace bole::motion
{
Rays::Rays(const std::vector<PointMatch> &matches, const PinholeCamera &camera)
{
  for (auto *column : {&ax, &ay, &bx, &by})
    column->reserve(matches.size());
  for (const PointMatch &match : matches)
    add(camera.ray(match.a_px), camera.ray(match.b_px));
}

void Rays::clear()
{
  for (auto *column : {&ax, &ay, &bx, &by})
    column->clear();
}

void Rays::add(const Eigen::Vector3d &in_a, const Eigen::Vector3d &in_b)
{
  ax.push_back(in_a.x());
  ay.push_back(in_a.y());
  bx.push_back(in_b.x());
  by.push_back(in_b.y());
}

EpipolarTerms termsOf(const Motion &motion, double sigma)
{
  EpipolarTerms terms;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor>::Map(terms.E) = skew(motion.direction) * motion.aRb;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor>::Map(terms.R) = motion.aRb;
  Matrix32d::Map(terms.B) = directionBasis(motion.direction);
  terms.sigma = sigma;
  return terms;
}

MotionPrior::MotionPrior(const RelativePosePrior &prior)
{
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  if (prior.aRb) {
    aRb = *prior.aRb;
    has_rotation = true;
    rotation_information = (prior.rotation_covariance + 1e-14 * I).ldlt().solve(I);
  }
  if (prior.translation && prior.translation->norm() > 1e-9) {
    const double length = prior.translation->norm();
    direction = *prior.translation / length;
    const Matrix32d B = directionBasis(direction);
    // The larger of the two tangent variances; beyond 0.6 rad a Gaussian on the sphere says
    // nothing.
    const Eigen::Matrix2d tangent = B.transpose() * prior.translation_covariance * B / (length * length);
    const double variance = 0.5 * tangent.trace() + 1e-10;
    has_direction = true;
    direction_information = variance < 0.36 ? 1 / variance : 0;
  }
}

double bulkSigma(std::vector<double> residuals)
{
  if (residuals.empty())
    return 0;
  for (double &r : residuals)
    r = std::abs(r);
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  double sigma = 1.4826 * *middle;
  for (int round = 0; round < 3; ++round) {
    double sum = 0;
    int n = 0;
    for (double r : residuals) {
      if (r <= 2.5 * sigma) {
        sum += r * r;
        ++n;
      }
    }
    if (n > 0)
      sigma = std::sqrt(sum / n) / 0.9546; // a normal distribution cut at 2.5 sigma
  }
  return sigma;
}

RotationFit fitRotation(const Rays &rays, const MotionPrior &prior, double min_sigma)
{
  constexpr int kIterations = 15;
  RotationFit fit;
  fit.aRb = prior.aRb;
  std::vector<double> residuals(2 * rays.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    transferResiduals(rays, fit.aRb.data(), residuals.data());
    fit.sigma = std::max(min_sigma, bulkSigma(residuals) / std::sqrt(2.0));
    const double variance = 2 * fit.sigma * fit.sigma;
    const TransferSums sums = sumsOfTransfers(rays, fit.aRb.data(), residuals.data(), variance);
    Eigen::Matrix3d H;
    H << sums.H[0], sums.H[1], sums.H[2], sums.H[1], sums.H[3], sums.H[4], sums.H[2], sums.H[4], sums.H[5];
    H /= variance * kInflation;
    Eigen::Vector3d g = Eigen::Vector3d::Map(sums.g) / (variance * kInflation);
    fit.information = H + prior.rotation_information;
    g += prior.rotation_information * logSo3(prior.aRb.transpose() * fit.aRb);
    const Eigen::Vector3d step = -solveDefinite<3>(fit.information + 1e-9 * Eigen::Matrix3d::Identity(), g);
    fit.aRb = orthonormalized(fit.aRb * expSo3(step));
    if (step.norm() < 1e-7)
      break;
  }
  return fit;
}

namespace
{
Motion moved(const Motion &motion, const Vector5d &xi)
{
  return {orthonormalized(motion.aRb * expSo3(xi.head<3>())), directionPlus(motion.direction, xi.tail<2>())};
}

double priorCost(const Motion &motion, const MotionPrior &prior)
{
  double cost = 0;
  if (prior.has_rotation) {
    const Eigen::Vector3d phi = logSo3(prior.aRb.transpose() * motion.aRb);
    cost += 0.5 * phi.dot(prior.rotation_information * phi);
  }
  if (prior.direction_information > 0)
    cost += 0.5 * prior.direction_information * directionMinus(prior.direction, motion.direction).squaredNorm();
  return cost;
}

} // namespace

double costOf(const Rays &rays, const Motion &motion, const MotionPrior &prior, double sigma)
{
  const double cost = costOfMatches(rays, termsOf(motion, sigma));
  return cost / kInflation + priorCost(motion, prior);
}

namespace
{
/// Information and gradient of the matches at \p motion, inflation not applied.
void linearize(const Rays &rays, const Motion &motion, double sigma, Matrix5d &H, Vector5d &g)
{
  const EpipolarSums sums = sumsOfMatches(rays, termsOf(motion, sigma));
  const double *entry = sums.H;
  for (int i = 0; i < 5; ++i)
    for (int j = i; j < 5; ++j)
      H(i, j) = H(j, i) = *entry++;
  g = Vector5d::Map(sums.g);
}

/// Levenberg-Marquardt with a fixed sigma.
void descend(const Rays &rays, JointFit &fit, const MotionPrior &prior, int iterations)
{
  double damping = 1e-4;
  fit.cost = costOf(rays, fit.motion, prior, fit.sigma);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Vector5d g;
    linearize(rays, fit.motion, fit.sigma, fit.information, g);
    Matrix5d H = fit.information / kInflation;
    g /= kInflation;
    if (prior.has_rotation) {
      H.topLeftCorner<3, 3>() += prior.rotation_information;
      g.head<3>() += prior.rotation_information * logSo3(prior.aRb.transpose() * fit.motion.aRb);
    }
    if (prior.direction_information > 0) {
      H.diagonal().tail<2>().array() += prior.direction_information;
      g.tail<2>() -= prior.direction_information * directionMinus(prior.direction, fit.motion.direction);
    }
    bool better = false;
    Vector5d step = Vector5d::Zero();
    for (int attempt = 0; attempt < 4 && !better; ++attempt) {
      Matrix5d damped = H;
      damped.diagonal() += damping * H.diagonal() + Vector5d::Constant(1e-9);
      step = -solveDefinite(damped, g);
      if (step.tail<2>().norm() > 0.5)
        step *= 0.5 / step.tail<2>().norm();
      const Motion tried = moved(fit.motion, step);
      const double cost = costOf(rays, tried, prior, fit.sigma);
      better = cost <= fit.cost;
      damping = better ? std::max(1e-7, damping * 0.2) : std::max(1e-3, damping * 10);
      if (better) {
        fit.motion = tried;
        fit.cost = cost;
      }
    }
    // What a further step could still gain, in units of the cost.
    if (!better || -g.dot(step) < 1e-3)
      break;
  }
}
} // namespace

JointFit fitMotion(const Rays &rays, const Motion &start, const MotionPrior &prior, double sigma, double min_sigma)
{
  constexpr int kIterations = 12;
  JointFit fit;
  fit.motion = start;
  fit.sigma = sigma;
  std::vector<double> residuals(rays.size());
  for (int round = 0; round < 3; ++round) {
    descend(rays, fit, prior, kIterations);
    residualsOfMatches(rays, termsOf(fit.motion, fit.sigma), residuals.data());
    const double before = fit.sigma;
    fit.sigma = std::max(min_sigma, bulkSigma(residuals));
    if (std::abs(fit.sigma - before) < 0.02 * before)
      break;
  }
  fit.cost = costOf(rays, fit.motion, prior, fit.sigma);
  Vector5d g;
  linearize(rays, fit.motion, fit.sigma, fit.information, g);
  return fit;
}

Parallax parallaxOf(const Rays &rays, const Motion &motion, double sigma)
{
  const FlowSums flow = flowSumsOfMatches(rays, termsOf(motion, sigma), motion.direction.data());
  Parallax parallax;
  if (flow.sum <= 0)
    return parallax;
  parallax.ratio = flow.along / std::max(flow.across, 1e-3 * flow.sum);
  parallax.score = flow.agreement / std::sqrt(std::max(flow.squares, 1e-12));
  return parallax;
}

double medianFlow(const Rays &rays, const Eigen::Matrix3d &aRb)
{
  std::vector<double> lengths;
  lengths.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d p = aRb * rays.b(i);
    if (p.z() >= 0.05)
      lengths.push_back((rays.a(i).head<2>() - p.head<2>() / p.z()).norm());
  }
  return lengths.empty() ? 0 : medianOf(std::move(lengths));
}

namespace
{
/// Direction that two matches allow once the rotation is known: both epipolar planes contain it.
std::optional<Eigen::Vector3d> twoPointDirection(const Rays &rays, std::size_t i, std::size_t j,
                                                 const Eigen::Matrix3d &aRb)
{
  const Eigen::Vector3d normal_i = rays.a(i).cross(aRb * rays.b(i)), normal_j = rays.a(j).cross(aRb * rays.b(j));
  const Eigen::Vector3d d = normal_i.cross(normal_j);
  if (d.norm() < 1e-12)
    return std::nullopt;
  return d.normalized();
}

void drawFrom(const Rays &rays, std::mt19937 &random, std::size_t n, Rays &sample)
{
  sample.clear();
  std::uniform_int_distribution<std::size_t> draw(0, rays.size() - 1);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = draw(random);
    sample.add(rays.a(k), rays.b(k));
  }
}
} // namespace

std::vector<Motion> motionStarts(const Rays &rays, const Eigen::Matrix3d &aRb, const MotionPrior &prior, double sigma)
{
  constexpr int kFew = 5;            // iterations
  constexpr std::size_t kSample = 6; // matches that a hypothesis is fitted to: five would do, one for the noise
  std::mt19937 random(kSeed);
  std::uniform_int_distribution<std::size_t> draw(0, rays.size() - 1);
  const bool rotation_known = prior.has_rotation;
  MotionPrior free = prior;
  free.direction_information = 0;
  std::vector<std::pair<double, Motion>> scored;
  scored.reserve(kHypotheses + 1);
  Rays sample;
  for (int hypothesis = 0; hypothesis < (rotation_known ? (kHypotheses + 1) / 2 : kHypotheses); ++hypothesis) {
    Motion motion{aRb, prior.direction};
    if (const auto d = twoPointDirection(rays, draw(random), draw(random), aRb))
      motion.direction = *d;
    if (!rotation_known) {
      JointFit fit;
      fit.motion = motion;
      fit.sigma = 3 * sigma;
      drawFrom(rays, random, kSample, sample);
      descend(sample, fit, free, kFew);
      motion = fit.motion;
    }
    scored.emplace_back(costOf(rays, motion, free, sigma), motion);
  }
  if (prior.has_direction)
    scored.emplace_back(costOf(rays, {aRb, prior.direction}, free, sigma), Motion{aRb, prior.direction});
  std::sort(scored.begin(), scored.end(), [](const auto &x, const auto &y) { return x.first < y.first; });
  std::vector<Motion> starts;
  for (const auto &[cost, motion] : scored) {
    const bool seen = std::any_of(starts.begin(), starts.end(), [&motion = motion](const Motion &other) {
      return std::abs(other.direction.dot(motion.direction)) > 0.95;
    });
    if (!seen)
      starts.push_back(motion);
    if (starts.size() == (rotation_known ? 2u : 5u))
      break;
  }
  return starts;
}
} // namespace bole::motion
