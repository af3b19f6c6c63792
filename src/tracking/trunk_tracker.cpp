// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/trunk_tracker.h"

#include "geometry/names.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <nlopt.h>

namespace bole
{
namespace
{
/// Step in each direction of the tangent that moves a border by about a pixel.
Vector4d pixelScale(const PinholeCamera &camera, const RelativeTrunk &relative, int rows)
{
  return {2.0 / rows, 0.02, 1 / camera.fx, 1 / (camera.fx * relative.ratio())};
}

/// The image energy plus the prior on the tilt, in pixel-scaled coordinates round the start.
class Problem
{
public:
  struct Value
  {
    Vector4d xi;
    double e = 0; ///< of the image
    Vector4d f;   ///< its derivative by the tangent of theta^r
  };

  Problem(const TrunkEnergy &energy, const RelativeTrunk &start, const Vector4d &scale, const Vector4d &tilt_at_start,
          double tilt_information)
      : m_energy(energy),
        m_start(start),
        m_scale(scale),
        m_tilt_at_start(tilt_at_start.head<2>()),
        m_tilt_information(tilt_information)
  {
  }

  RelativeTrunk at(const Vector4d &xi) const { return m_start.plus(m_scale.cwiseProduct(xi)); }

  /// Of the image at \p xi: NLopt, and who reads its result, ask for one place more than once.
  const Value &image(const Vector4d &xi)
  {
    if (!m_is_known || m_value.xi != xi) {
      m_value.xi = xi;
      m_value.e = m_energy.evaluate(at(xi), &m_value.f);
      m_is_known = true;
    }
    return m_value;
  }

  double operator()(const Vector4d &xi, double *by_xi)
  {
    const Value &value = image(xi);
    const Eigen::Vector2d tilt = m_tilt_at_start + m_scale.cwiseProduct(xi).head<2>();
    if (by_xi) {
      Vector4d f = value.f;
      f.head<2>() += m_tilt_information * tilt;
      Vector4d::Map(by_xi) = f.cwiseProduct(m_scale);
    }
    return value.e + 0.5 * m_tilt_information * tilt.squaredNorm();
  }

private:
  const TrunkEnergy &m_energy;
  RelativeTrunk m_start;
  Vector4d m_scale;
  Eigen::Vector2d m_tilt_at_start; ///< start (-) prediction
  double m_tilt_information;
  Value m_value; ///< the last
  bool m_is_known = false;
};

double evaluateProblem(unsigned, const double *x, double *gradient, void *data)
{
  return (*static_cast<Problem *>(data))(Vector4d(x), gradient);
}

/// SLSQP for four parameters, set up once a thread.
class Optimiser
{
public:
  Optimiser() : m_optimiser(nlopt_create(NLOPT_LD_SLSQP, 4))
  {
    nlopt_set_xtol_abs1(m_optimiser, 2e-3);
    nlopt_set_maxeval(m_optimiser, 40);
  }
  Optimiser(const Optimiser &) = delete;
  Optimiser &operator=(const Optimiser &) = delete;
  ~Optimiser() { nlopt_destroy(m_optimiser); }

  /// Minimum within +-bound pixels; false where NLopt gives up.
  bool operator()(Problem &problem, double bound_px, Vector4d &xi)
  {
    nlopt_set_min_objective(m_optimiser, evaluateProblem, &problem);
    nlopt_set_lower_bounds1(m_optimiser, -bound_px);
    nlopt_set_upper_bounds1(m_optimiser, bound_px);
    double e = 0;
    xi.setZero();
    const nlopt_result result = nlopt_optimize(m_optimiser, xi.data(), &e);
    return (result > 0 || result == NLOPT_ROUNDOFF_LIMITED) && xi.allFinite() && std::isfinite(e);
  }

private:
  nlopt_opt m_optimiser;
};

struct SeenBorder
{
  BorderLine line;
  Eigen::Matrix<double, 1, 4> J_mid = Eigen::Matrix<double, 1, 4>::Zero(); ///< sideways move of its middle by theta^r
  bool visible = false;
};

SeenBorder look(const PinholeCamera &camera, const TrackingPrediction &prediction, Border border, int rows_min)
{
  SeenBorder seen;
  seen.line = borderLine(camera, prediction.relative, border, prediction.range);
  const bool hidden = border == Border::left ? prediction.left_hidden : prediction.right_hidden;
  seen.visible = !hidden && seen.line.rows() >= rows_min;
  if (seen.line.rows() > 0)
    seen.J_mid = borderJacobian(camera, prediction.relative, border, seen.line).colwise().mean();
  return seen;
}

/// The relative trunk whose borders lie where the pair was found: bearing and r/d from two borders, the bearing
/// alone from one.
RelativeTrunk startFrom(const PeakPair &pair, const SeenBorder &left, const SeenBorder &right,
                        const RelativeTrunk &predicted)
{
  Vector4d step = Vector4d::Zero();
  if (left.visible && right.visible) {
    Eigen::Matrix2d J;
    J << left.J_mid.tail<2>(), right.J_mid.tail<2>();
    step.tail<2>() = J.inverse() * Eigen::Vector2d(pair.left.offset_px, pair.right.offset_px);
  }
  else
    step(2) = left.visible ? pair.left.offset_px / left.J_mid(2) : pair.right.offset_px / right.J_mid(2);
  step(3) = std::clamp(step(3), -1.0, 1.0);
  return predicted.plus(step);
}

Eigen::Matrix2d offsetCovariance(const SeenBorder &left, const SeenBorder &right, const Matrix4d &covariance,
                                 double border_correlation)
{
  constexpr double kVariance = 0.5; // bow, taper and noise: 0.7 px
  Eigen::Matrix<double, 2, 4> J;
  J << left.J_mid, right.J_mid;
  Eigen::Matrix2d shape = Eigen::Matrix2d::Constant(kVariance * border_correlation);
  shape.diagonal().setConstant(kVariance);
  return J * covariance * J.transpose() + shape;
}

double evennessOf(const Gradient &gradient, const PinholeCamera &camera, const TrackingResult &result,
                  const ElevationRange &range)
{
  double sum = 0;
  const auto add = [&](Border border, double contrast) {
    sum += evennessAlong(gradient.signed_x, borderLine(camera, result.optimum, border, range), contrast < 0 ? -1 : 1);
  };
  if (result.left_used)
    add(Border::left, result.left_contrast);
  if (result.right_used)
    add(Border::right, result.right_contrast);
  return sum / (result.left_used + result.right_used);
}
} // namespace

const char *toString(TrackingStatus status)
{
  return nameOf(status,
                {"tracked", "not visible", "occluded", "no border", "diverged", "negative curvature", "sign changed"});
}

TrackingResult trackTrunk(const Gradient &gradient, const PinholeCamera &camera, const TrackingPrediction &prediction,
                          const TrackingOptions &options)
{
  TrackingResult result;
  result.optimum = prediction.relative;
  const auto finish = [&result](TrackingStatus status) {
    result.status = status;
    return result;
  };
  if (!prediction.relative.isFinite() || !prediction.covariance.allFinite())
    return finish(TrackingStatus::not_visible);
  SeenBorder left = look(camera, prediction, Border::left, options.rows_min);
  SeenBorder right = look(camera, prediction, Border::right, options.rows_min);
  if (prediction.left_on_bark && right.visible)
    left.visible = false;
  else if (prediction.right_on_bark && left.visible)
    right.visible = false;
  if (!left.visible && !right.visible)
    return finish(prediction.left_hidden || prediction.right_hidden ? TrackingStatus::occluded
                                                                    : TrackingStatus::not_visible);

  // scan for maxima under the prediction, and choose the pair of them that are the borders
  const Eigen::Matrix2d S = offsetCovariance(left, right, prediction.covariance, options.border_correlation);
  const auto scan = [&](const SeenBorder &border, double variance) {
    const double width =
        std::clamp(options.scan_sigmas * std::sqrt(variance), options.scan_min_px, options.scan_max_px);
    return border.visible ? scanBorder(gradient.signed_x, border.line, width, options.contrast_min)
                          : std::vector<BorderPeak>();
  };
  const auto left_peaks = scan(left, S(0, 0)), right_peaks = scan(right, S(1, 1));
  if ((left.visible && left_peaks.empty()) || (right.visible && right_peaks.empty()))
    return finish(TrackingStatus::no_border);
  const PeakPair pair =
      pairPeaks(left_peaks, right_peaks, {S, prediction.left_contrast, prediction.right_contrast}, 1).front();
  const RelativeTrunk start = startFrom(pair, left, right, prediction.relative);
  if (!start.isFinite())
    return finish(TrackingStatus::diverged);

  // polish
  const TrunkEnergy energy(gradient, camera, prediction.range, {left.visible, std::abs(pair.left.contrast)},
                           {right.visible, std::abs(pair.right.contrast)}, options.energy);
  const double tilt_variance = options.tilt_sigma * options.tilt_sigma + prediction.covariance.diagonal()(0);
  Vector4d scale = pixelScale(camera, start, std::max(left.line.rows(), right.line.rows()));
  if (!left.visible || !right.visible)
    scale(3) = 1e-9; // one border says nothing of r/d beside the bearing
  Problem problem(energy, start, scale, start.minus(prediction.relative), 1 / tilt_variance);
  Vector4d xi;
  thread_local Optimiser minimise;
  if (!minimise(problem, 2 * options.polish_max_px, xi) || xi.tail<2>().norm() > options.polish_max_px)
    return finish(TrackingStatus::diverged);

  result.optimum = problem.at(xi);
  result.left_used = left.visible;
  result.right_used = right.visible;
  result.left_contrast = left.visible ? energy.contrastAt(result.optimum, Border::left) : 0;
  result.right_contrast = right.visible ? energy.contrastAt(result.optimum, Border::right) : 0;
  const Problem::Value &value = problem.image(xi);
  result.energy = value.e;
  result.f = value.f;
  const auto curvature = energy.curvature(result.optimum);
  result.F = curvature.F;
  if (curvature.negative || !result.F.allFinite() || !result.optimum.isFinite())
    return finish(TrackingStatus::negative_curvature);
  result.evenness = evennessOf(gradient, camera, result, prediction.range);
  const auto flipped = [](double now, const std::optional<double> &before) { return before && now * *before < 0; };
  if (flipped(result.left_contrast, prediction.left_contrast) ||
      flipped(result.right_contrast, prediction.right_contrast))
    return finish(TrackingStatus::sign_changed);
  return finish(TrackingStatus::tracked);
}
} // namespace bole
