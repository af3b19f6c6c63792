// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/bundle.h"

#include "motion/epipolar.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace bole::motion
{
Eigen::Vector2d reprojection(const Pose &wMa, const Pose &wMb, const Eigen::Vector2d &xy_a, double inverse_depth,
                             const Eigen::Vector2d &xy_b, Eigen::Matrix<double, 2, 6> *J_a,
                             Eigen::Matrix<double, 2, 6> *J_b, Eigen::Vector2d *J_q, double focal, Eigen::Vector2d *J_f)
{
  const Eigen::Vector3d ray(xy_a.x() / focal, xy_a.y() / focal, 1);
  const Eigen::Matrix3d bRa = wMb.R.transpose() * wMa.R;
  const Eigen::Vector3d step = wMb.R.transpose() * (wMa.t - wMb.t);
  const Eigen::Vector3d y = bRa * ray + inverse_depth * step; // the point times its inverse depth
  const double z = std::max(y.z(), 0.02);
  const Eigen::Vector2d at = y.head<2>() / z;
  if (J_a != nullptr || J_b != nullptr || J_q != nullptr) {
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1 / z, 0, -at.x() / z, 0, 1 / z, -at.y() / z;
    projection *= focal;
    if (J_a != nullptr) {
      const Eigen::Matrix<double, 2, 3> turned = projection * bRa;
      *J_a << inverse_depth * turned, -turned * skew(ray);
    }
    if (J_b != nullptr)
      *J_b << -inverse_depth * projection, projection * skew(y);
    if (J_q != nullptr)
      *J_q = projection * step;
    if (J_f != nullptr)
      *J_f = focal * at - projection * bRa * Eigen::Vector3d(ray.x(), ray.y(), 0);
  }
  return focal * at - xy_b;
}

void triangulate(BundlePoint &point, const std::vector<BundleFrame> &frames)
{
  constexpr int kIterations = 5;
  constexpr double kStart = 0.05; // of the first baseline's inverse
  point.inverse_depth = kStart;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double H = 1e-12, g = 0;
    for (const BundleObservation &seen : point.seen) {
      Eigen::Vector2d J;
      const Eigen::Vector2d e = reprojection(frames[point.anchor].wMc, frames[seen.frame].wMc, point.xy,
                                             point.inverse_depth, seen.xy, nullptr, nullptr, &J);
      H += J.squaredNorm();
      g += J.dot(e);
    }
    point.inverse_depth -= g / H;
  }
  point.inverse_depth = std::max(point.inverse_depth, 0.0);
}

namespace
{
Eigen::Vector2d residualOf(const std::vector<BundleFrame> &frames, const BundlePoint &point,
                           const BundleObservation &seen, double focal)
{
  return reprojection(frames[point.anchor].wMc, frames[seen.frame].wMc, point.xy, point.inverse_depth, seen.xy, nullptr,
                      nullptr, nullptr, focal);
}

struct System
{
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  std::vector<double> point_H, point_g;
  std::vector<Eigen::VectorXd> cross; ///< poses by inverse depth, a column a point
};

class Bundle
{
public:
  Bundle(std::vector<BundleFrame> &frames, std::vector<BundlePoint> &points, const BundleOptions &options)
      : m_frames(frames), m_points(points), m_options(options)
  {
    for (const BundleFrame &frame : frames) {
      m_offset.push_back(frame.fixed ? -1 : m_size);
      m_size += frame.fixed ? 0 : 6;
    }
    m_focal = options.with_focal ? m_size++ : -1;
    m_log_focal = options.log_focal;
  }
  int size() const { return m_size; }
  double logFocal() const { return m_log_focal; }
  void setLogFocal(double log_focal) { m_log_focal = log_focal; }

  double cost(const std::vector<BundleFrame> &frames, const std::vector<BundlePoint> &points, double log_focal) const
  {
    const double focal = std::exp(log_focal);
    double sum = 0;
    for (const BundlePoint &point : points) {
      for (const BundleObservation &seen : point.seen)
        sum += costOf(residualOf(frames, point, seen, focal).norm() / m_options.sigma, kKernel);
      const double off = point.inverse_depth - point.prior;
      sum += 0.5 * point.prior_information * off * off;
    }
    for (std::size_t i = 1; i < frames.size(); ++i) {
      if (frames[i].previousRthis) {
        const Eigen::Vector3d phi = rotationResidual(frames, i);
        sum += 0.5 * phi.dot(frames[i].rotation_information * phi);
      }
    }
    if (m_options.first_baseline) {
      const double off = baselineResidual(frames);
      sum += 0.5 * off * off;
    }
    return sum;
  }

  System linearize()
  {
    System system;
    system.H = Eigen::MatrixXd::Zero(m_size, m_size);
    system.g = Eigen::VectorXd::Zero(m_size);
    for (BundlePoint &point : m_points)
      addPoint(system, point);
    for (std::size_t i = 1; i < m_frames.size(); ++i)
      addRotation(system, i);
    addBaseline(system);
    return system;
  }

  /// The poses' step after the points were eliminated; then the points follow. Returns the log of the focal length.
  double step(const System &system, double damping, std::vector<BundleFrame> &frames,
              std::vector<BundlePoint> &points) const
  {
    const auto [H, g] = reduced(system, damping);
    const Eigen::VectorXd delta = -H.ldlt().solve(g);
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (m_offset[i] >= 0)
        frames[i].wMc = frames[i].wMc.plus(delta.segment<6>(m_offset[i]));
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double H_q = system.point_H[k] * (1 + damping) + 1e-12;
      points[k].inverse_depth -= (system.point_g[k] + system.cross[k].dot(delta)) / H_q;
    }
    return m_focal < 0 ? m_log_focal : m_log_focal + delta[m_focal];
  }

  std::pair<Eigen::MatrixXd, Eigen::VectorXd> reduced(const System &system, double damping) const
  {
    Eigen::MatrixXd H = system.H;
    Eigen::VectorXd g = system.g;
    for (std::size_t k = 0; k < system.cross.size(); ++k) {
      const double H_q = system.point_H[k] * (1 + damping) + 1e-12;
      H.noalias() -= system.cross[k] * (system.cross[k] / H_q).transpose();
      g -= system.cross[k] * (system.point_g[k] / H_q);
    }
    H.diagonal() += damping * system.H.diagonal() + Eigen::VectorXd::Constant(m_size, 1e-6);
    return {H, g};
  }

private:
  static Eigen::Vector3d rotationResidual(const std::vector<BundleFrame> &frames, std::size_t i)
  {
    return logSo3(frames[i].previousRthis->transpose() * frames[i - 1].wMc.R.transpose() * frames[i].wMc.R);
  }

  double baselineResidual(const std::vector<BundleFrame> &frames) const
  {
    const double length = (frames[1].wMc.t - frames[0].wMc.t).norm();
    return (length - *m_options.first_baseline) / (kBaselineSigma * *m_options.first_baseline);
  }

  void addPoint(System &system, BundlePoint &point) const
  {
    Eigen::VectorXd cross = Eigen::VectorXd::Zero(m_size);
    double H_q = point.prior_information;
    double g_q = point.prior_information * (point.inverse_depth - point.prior);
    const int a = m_offset[point.anchor];
    const double focal = std::exp(m_log_focal);
    for (BundleObservation &seen : point.seen) {
      const int b = m_offset[seen.frame];
      Eigen::Matrix<double, 2, 6> J_a, J_b;
      Eigen::Vector2d J_q, J_f;
      const Eigen::Vector2d e = reprojection(m_frames[point.anchor].wMc, m_frames[seen.frame].wMc, point.xy,
                                             point.inverse_depth, seen.xy, &J_a, &J_b, &J_q, focal, &J_f);
      seen.weight = weightOf(e.norm() / m_options.sigma, kKernel);
      const double w = seen.weight / (m_options.sigma * m_options.sigma);
      H_q += w * J_q.squaredNorm();
      g_q += w * J_q.dot(e);
      if (a >= 0) {
        system.H.block<6, 6>(a, a).noalias() += w * J_a.transpose() * J_a;
        system.g.segment<6>(a).noalias() += w * J_a.transpose() * e;
        cross.segment<6>(a).noalias() += w * J_a.transpose() * J_q;
      }
      if (b >= 0) {
        system.H.block<6, 6>(b, b).noalias() += w * J_b.transpose() * J_b;
        system.g.segment<6>(b).noalias() += w * J_b.transpose() * e;
        cross.segment<6>(b).noalias() += w * J_b.transpose() * J_q;
      }
      if (a >= 0 && b >= 0) {
        const Matrix6d off = w * J_a.transpose() * J_b;
        system.H.block<6, 6>(a, b) += off;
        system.H.block<6, 6>(b, a) += off.transpose();
      }
      if (m_focal >= 0) {
        system.H(m_focal, m_focal) += w * J_f.squaredNorm();
        system.g[m_focal] += w * J_f.dot(e);
        cross[m_focal] += w * J_f.dot(J_q);
        const auto addWith = [&](int pose, const Eigen::Matrix<double, 2, 6> &J) {
          if (pose < 0)
            return;
          const Vector6d off = w * J.transpose() * J_f;
          system.H.block<6, 1>(pose, m_focal) += off;
          system.H.block<1, 6>(m_focal, pose) += off.transpose();
        };
        addWith(a, J_a);
        addWith(b, J_b);
      }
    }
    point.information = H_q;
    system.point_H.push_back(H_q);
    system.point_g.push_back(g_q);
    system.cross.push_back(std::move(cross));
  }

  void addRotation(System &system, std::size_t i) const
  {
    if (!m_frames[i].previousRthis)
      return;
    const Eigen::Vector3d phi = rotationResidual(m_frames, i);
    const Eigen::Matrix3d J_b = inverseRightJacobianSo3(phi);
    const Eigen::Matrix3d J_a = -J_b * m_frames[i].wMc.R.transpose() * m_frames[i - 1].wMc.R;
    const int a = m_offset[i - 1], b = m_offset[i];
    const Eigen::Matrix3d &information = m_frames[i].rotation_information;
    if (a >= 0) {
      system.H.block<3, 3>(a + 3, a + 3) += J_a.transpose() * information * J_a;
      system.g.segment<3>(a + 3) += J_a.transpose() * information * phi;
    }
    if (b >= 0) {
      system.H.block<3, 3>(b + 3, b + 3) += J_b.transpose() * information * J_b;
      system.g.segment<3>(b + 3) += J_b.transpose() * information * phi;
    }
    if (a >= 0 && b >= 0) {
      const Eigen::Matrix3d off = J_a.transpose() * information * J_b;
      system.H.block<3, 3>(a + 3, b + 3) += off;
      system.H.block<3, 3>(b + 3, a + 3) += off.transpose();
    }
  }

  void addBaseline(System &system) const
  {
    if (!m_options.first_baseline || m_offset[1] < 0)
      return;
    // The first frame is fixed wherever the baseline is asked for.
    const Eigen::Vector3d between = m_frames[1].wMc.t - m_frames[0].wMc.t;
    const Eigen::Vector3d J =
        m_frames[1].wMc.R.transpose() * between.normalized() / (kBaselineSigma * *m_options.first_baseline);
    const int b = m_offset[1];
    system.H.block<3, 3>(b, b) += J * J.transpose();
    system.g.segment<3>(b) += J * baselineResidual(m_frames);
  }

  static constexpr double kBaselineSigma = 1e-4; // relative: it only chooses the unit

  std::vector<BundleFrame> &m_frames;
  std::vector<BundlePoint> &m_points;
  const BundleOptions &m_options;
  std::vector<int> m_offset;
  int m_size = 0;
  int m_focal = -1; ///< where the log of the focal length stands
  double m_log_focal = 0;
};

double bulkOf(const std::vector<BundleFrame> &frames, const std::vector<BundlePoint> &points, double log_focal)
{
  std::vector<double> all;
  for (const BundlePoint &point : points) {
    for (const BundleObservation &seen : point.seen) {
      const Eigen::Vector2d e = residualOf(frames, point, seen, std::exp(log_focal));
      all.push_back(e.x());
      all.push_back(e.y());
    }
  }
  return bulkSigma(std::move(all));
}
} // namespace

BundleResult solveBundle(std::vector<BundleFrame> &frames, std::vector<BundlePoint> &points,
                         const BundleOptions &options)
{
  BundleResult result;
  Bundle bundle(frames, points, options);
  double damping = 1e-4, cost = bundle.cost(frames, points, bundle.logFocal());
  System system = bundle.linearize();
  for (int iteration = 0; iteration < options.iterations && bundle.size() > 0; ++iteration) {
    std::vector<BundleFrame> tried_frames = frames;
    std::vector<BundlePoint> tried_points = points;
    const double log_focal = bundle.step(system, damping, tried_frames, tried_points);
    const double tried = bundle.cost(tried_frames, tried_points, log_focal);
    if (!(tried < cost)) {
      damping = std::max(1e-3, damping * 10);
      continue;
    }
    const double gain = cost - tried;
    frames = std::move(tried_frames);
    points = std::move(tried_points);
    cost = tried;
    bundle.setLogFocal(log_focal);
    damping = std::max(1e-7, 0.2 * damping);
    system = bundle.linearize();
    if (gain < options.settled * cost)
      break;
  }
  double good = 0, all = 0;
  for (const BundlePoint &point : points) {
    for (const BundleObservation &seen : point.seen) {
      good += seen.weight > 0.5;
      all += 1;
    }
  }
  result.inliers = all > 0 ? good / all : 0;
  result.sigma = std::max(options.min_sigma, bulkOf(frames, points, bundle.logFocal()));
  if (bundle.size() >= 6 && std::isfinite(cost)) {
    const Eigen::MatrixXd H = bundle.reduced(system, 0).first;
    if (options.with_focal) {
      const Eigen::Index last = H.rows() - 1;
      const double variance = H.ldlt().solve(Eigen::VectorXd::Unit(H.rows(), last))[last];
      result.log_focal = bundle.logFocal();
      result.focal_sigma = std::sqrt(variance) * result.sigma / options.sigma;
      result.solved = std::isfinite(result.focal_sigma);
      return result;
    }
    result.last_covariance = H.bottomRightCorner<6, 6>().ldlt().solve(Matrix6d::Identity());
    result.solved = result.last_covariance.allFinite();
  }
  return result;
}
} // namespace bole::motion
