// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/vertical.h"

#include "geometry/constants.h"
#include "motion/epipolar.h"
#include "motion/image_view.h"
#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <vector>

namespace bole
{
namespace
{
constexpr double kPriorSigma = 20 * kDegree;
constexpr int kLeastEdges = 12; ///< patches
constexpr double kChance = 0.2; ///< share of edges at random that agree with the best direction

/// One straight edge a patch, where there is one: its centre and gradient direction from the
/// moments of the gradients.
std::vector<VerticalEdge> findEdges(const cv::Mat &grey, const PinholeCamera &camera, const Eigen::Vector3d &up)
{
  constexpr double kMaxTilt = 30 * kDegree; // of an edge from the expected vertical in the image
  constexpr double kMinGradient = 0.03;     // per pixel, grey 0 .. 1
  constexpr int kCell = 12;                 // side of the patches that vote [px]
  constexpr double kMinCoherence = 0.6;     // of the gradients of a patch: 1 is one straight edge
  cv::Mat gx, gy;
  cv::Sobel(grey, gx, CV_32F, 1, 0, 3, 1.0 / 8 / 255);
  cv::Sobel(grey, gy, CV_32F, 0, 1, 3, 1.0 / 8 / 255);
  std::vector<VerticalEdge> edges;
  for (int y0 = 2; y0 + kCell < grey.rows - 2; y0 += kCell) {
    for (int x0 = 2; x0 + kCell < grey.cols - 2; x0 += kCell) {
      double xx = 0, xy = 0, yy = 0, mx = 0, my = 0;
      for (int y = y0; y < y0 + kCell; ++y) {
        const float *row_x = gx.ptr<float>(y), *row_y = gy.ptr<float>(y);
        for (int x = x0; x < x0 + kCell; ++x) {
          const double a = row_x[x], b = row_y[x], w = a * a + b * b;
          xx += a * a;
          xy += a * b;
          yy += b * b;
          mx += w * x;
          my += w * y;
        }
      }
      const double energy = xx + yy;
      const double coherence = std::hypot(xx - yy, 2 * xy) / std::max(1e-12, energy);
      if (energy < kCell * kCell * kMinGradient * kMinGradient * 0.5 || coherence < kMinCoherence)
        continue;
      const Eigen::Vector2d centre(mx / energy, my / energy);
      const double angle = 0.5 * std::atan2(2 * xy, xx - yy); // of the gradient: across the edge
      const Eigen::Vector2d along(-std::sin(angle), std::cos(angle));
      // The edge must point to the expected zenith to within the tilt.
      const Eigen::Vector3d ray = camera.ray(centre);
      const Eigen::Vector2d zenith =
          Eigen::Vector2d(camera.fx * (up.x() - ray.x() * up.z()), camera.fy * (up.y() - ray.y() * up.z()));
      if (std::abs(along.dot(zenith)) < std::cos(kMaxTilt) * zenith.norm())
        continue;
      const Eigen::Vector3d far = camera.ray(centre + 20 * along);
      edges.push_back({ray.cross(far).normalized(), ray.normalized()});
    }
  }
  return edges;
}

/// \p frames: that the edges come from; they share the lean of their trunks.
VerticalEstimate fitUp(const std::vector<VerticalEdge> &edges, const Eigen::Vector3d &expected, int frames)
{
  constexpr double kSigma = 1.5 * kDegree; // of the direction of a patch's edge: trunks lean, bark is rough
  constexpr double kShared = 4;            // inflates the covariance: patches of one trunk share its lean
  VerticalEstimate estimate;
  estimate.up = expected;
  if (edges.size() < static_cast<std::size_t>(kLeastEdges))
    return estimate;
  const double inflation = kShared * frames;
  constexpr double kPrior = 1 / (kPriorSigma * kPriorSigma);
  double best = 1e300;
  for (const double roll : {0.0, -0.25, 0.25, -0.12, 0.12}) {
    Eigen::Vector3d up = (expSo3({0, 0, roll}) * expected).normalized();
    Eigen::Matrix2d H;
    double width = 4; // of the kernel, in sigmas: from wide to narrow
    for (int iteration = 0; iteration < 15; ++iteration, width = std::max(1.0, 0.8 * width)) {
      const Matrix32d B = directionBasis(up);
      H = kPrior * Eigen::Matrix2d::Identity();
      Eigen::Vector2d g = -kPrior * directionMinus(expected, up);
      for (const VerticalEdge &edge : edges) {
        const double e = edge.off(up) / (kSigma * width);
        const Eigen::Vector2d J = B.transpose() * edge.normal / edge.across(up);
        const double w = motion::weightOf(e, 1.5) / (kSigma * kSigma) / inflation;
        H += w * J * J.transpose();
        g += w * J * edge.off(up);
      }
      up = directionPlus(up, -H.ldlt().solve(g));
    }
    double cost = 0.5 * kPrior * directionMinus(expected, up).squaredNorm();
    int agreeing = 0;
    for (const VerticalEdge &edge : edges) {
      const double e = edge.off(up) / kSigma;
      cost += motion::costOf(e, 1.5) / inflation;
      agreeing += std::abs(e) < 2;
    }
    if (cost < best) {
      best = cost;
      estimate.up = up;
      estimate.information = H - kPrior * Eigen::Matrix2d::Identity();
      estimate.gradient = -kPrior * directionMinus(expected, up);
      estimate.edges = agreeing;
    }
  }
  // Edges at random agree too: those of a painted wall would put up anywhere. What remains may still be wrong in
  // common, the more the fewer they are.
  constexpr double kLeastShare = 0.25;
  estimate.share = std::max(0.0, 1 - kChance * static_cast<double>(edges.size()) / std::max(1, estimate.edges));
  estimate.information *= estimate.share * estimate.share;
  estimate.gradient *= estimate.share * estimate.share;
  estimate.known = estimate.edges >= kLeastEdges && estimate.share > kLeastShare;
  return estimate;
}
} // namespace

VerticalEstimate VerticalFinder::find(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                      const Eigen::Matrix3d &wRc, const std::optional<Eigen::Vector3d> &expected_up)
{
  constexpr std::size_t kMostFrames = 12; // beyond it the path may have turned otherwise than it says
  constexpr std::size_t kEnough = 3;      // times the least number: a trunk is in several of the frames
  const auto least = static_cast<std::size_t>(kLeastEdges);
  const Eigen::Vector3d expected = expected_up ? expected_up->normalized() : Eigen::Vector3d(0, -1, 0);
  std::vector<VerticalEdge> edges = findEdges(viewOf(image), camera, expected), in_w;
  for (const VerticalEdge &edge : edges)
    in_w.push_back({wRc * edge.normal, wRc * edge.ray});
  int frames = 1;
  const bool are_few = edges.size() < least;
  for (auto earlier = m_earlier.begin(); are_few && earlier != m_earlier.end() && edges.size() < kEnough * least;
       ++earlier, ++frames)
    for (const VerticalEdge &edge : *earlier)
      edges.push_back({wRc.transpose() * edge.normal, wRc.transpose() * edge.ray});
  m_earlier.push_front(std::move(in_w));
  if (m_earlier.size() > kMostFrames)
    m_earlier.pop_back();
  return fitUp(edges, expected, frames);
}

void VerticalFilter::add(const Eigen::Matrix3d &wRc, const VerticalEstimate &estimate)
{
  constexpr double kDrift = 1e-3; // standard deviation by which the rotation of a path errs from frame to frame [rad]
  constexpr int kIterations = 3;
  if (!estimate.known)
    return;
  const Eigen::Vector3d seen = wRc * estimate.up;
  if (m_n == 0) { // cameras are held upright, more or less
    m_up = wRc * -Eigen::Vector3d::UnitY();
    m_information = (Eigen::Matrix3d::Identity() - m_up * m_up.transpose()) / (kPriorSigma * kPriorSigma);
  }
  const Eigen::Vector3d before = m_up;
  const Matrix32d at = directionBasis(before);
  const Eigen::Matrix2d covariance =
      (at.transpose() * m_information * at).inverse() + kDrift * kDrift * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d known = covariance.inverse();
  // The log-likelihood of this frame about what it saw, in w.
  const Matrix32d B = wRc * directionBasis(estimate.up);
  const Eigen::Matrix3d information = B * estimate.information * B.transpose();
  const Eigen::Vector3d gradient = B * estimate.gradient;
  const auto gradientAt = [&](const Eigen::Vector3d &up) -> Eigen::Vector3d {
    return gradient - information * directionBasis(seen) * directionMinus(up, seen);
  };
  const Eigen::Matrix2d H = at.transpose() * information * at;
  double weight = 1;
  if (m_n >= 5) { // frames that contradict the others say less
    const Eigen::Vector2d g = at.transpose() * gradientAt(before);
    const double off2 = g.dot((H + H * covariance * H + 1e-9 * Eigen::Matrix2d::Identity()).ldlt().solve(g));
    weight = 1 / (1 + off2 / 4);
  }
  for (int i = 0; i < kIterations; ++i)
    m_up = directionPlus(before, directionMinus(m_up, before) + (known + weight * H)
                                                                    .ldlt()
                                                                    .solve(weight * at.transpose() * gradientAt(m_up) -
                                                                           known * directionMinus(m_up, before)));
  m_information = at * (known + weight * H) * at.transpose();
  ++m_n;
  m_share += estimate.share;
}

Eigen::Matrix2d VerticalFilter::covariance() const
{
  const Matrix32d B = directionBasis(m_n > 0 ? m_up : Eigen::Vector3d(0, -1, 0));
  const Eigen::Matrix2d H = B.transpose() * m_information * B + 1e-6 * Eigen::Matrix2d::Identity();
  const double lean = 0.7 * kDegree;
  return std::min(10, std::max(1, m_n)) * H.inverse() + lean * lean * Eigen::Matrix2d::Identity();
}
} // namespace bole
