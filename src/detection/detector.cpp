// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/detector.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr int kLeastViews = 5; ///< views within the window that see both borders: fewer let chance pairs agree

/// A view reduced to the ground plane.
struct PlaneView
{
  const LevelProfile *profile;
  Vector2d position, forward, left; ///< of the level camera in the world
};

struct Columns
{
  double q_left, q_right;
};

/// Columns of the borders of the circle (xy, r); nothing when it is not in front of the view.
std::optional<Columns> bordersOf(const PlaneView &view, const Vector2d &xy, double r)
{
  const Vector2d w = xy - view.position;
  const double ahead = view.forward.dot(w), d2 = w.squaredNorm();
  if (ahead < 0.2 || d2 <= 1.2 * r * r)
    return std::nullopt;
  const double q = view.left.dot(w) / ahead, t = r / std::sqrt(d2 - r * r);
  if (q * t > 0.9 || q * t < -0.9)
    return std::nullopt;
  return Columns{(q + t) / (1 - q * t), (q - t) / (1 + q * t)};
}

/// How well a profile value continues a contrast: 1 the same, 0 nothing there, negative the other polarity.
double agreement(double value, double contrast) { return std::clamp(value / contrast, -0.3, 1.0); }

struct PairHypothesis
{
  ProfilePeak left, right;
  Vector2d direction; ///< of the bearing in the world, unit
  double s = 0;       ///< r / d
};

PairHypothesis makePair(const PlaneView &view, const ProfilePeak &left, const ProfilePeak &right)
{
  PairHypothesis pair{left, right, {}, 0};
  const double b_left = std::atan(left.q), b_right = std::atan(right.q);
  const double bearing = 0.5 * (b_left + b_right);
  pair.s = std::sin(0.5 * (b_left - b_right));
  pair.direction = std::cos(bearing) * view.forward + std::sin(bearing) * view.left;
  return pair;
}

/// How well the window agrees with one peak of the current view, if its border stood at each of the ranges swept. The
/// border of a trunk is a vertical line that hardly moves over a window, so the curves of two borders add up to that
/// of their pair.
struct RangeCurve
{
  std::vector<float> sum;  ///< of agreement over the views that see it, by range
  std::vector<short> seen; ///< those views
};

/// Ranges swept, uniform in inverse depth: near enough for no focus to fall between two.
std::vector<double> sweptRanges(const DetectorOptions &options)
{
  constexpr int kRanges = 80;
  const double far = 1 / (1.2 * options.range_max), near = 1 / options.range_min;
  std::vector<double> ranges;
  for (int i = 0; i < kRanges; ++i)
    ranges.push_back(1 / (far + (near - far) * i / (kRanges - 1)));
  return ranges;
}

RangeCurve sweep(const std::vector<PlaneView> &views, const ProfilePeak &peak, const std::vector<double> &ranges)
{
  RangeCurve curve{std::vector<float>(ranges.size(), 0.f), std::vector<short>(ranges.size(), 0)};
  const PlaneView &now = views.back();
  const Vector2d direction = (now.forward + peak.q * now.left).normalized();
  for (std::size_t v = 0; v + 1 < views.size(); ++v) {
    const Vector2d offset = now.position - views[v].position;
    const double ahead0 = views[v].forward.dot(offset), ahead1 = views[v].forward.dot(direction);
    const double left0 = views[v].left.dot(offset), left1 = views[v].left.dot(direction);
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const double ahead = ahead0 + ranges[i] * ahead1;
      const double q = (left0 + ranges[i] * left1) / ahead;
      if (ahead < 0.2 || !views[v].profile->covers(q))
        continue;
      ++curve.seen[i];
      curve.sum[i] += static_cast<float>(agreement(views[v].profile->strongestNear(q, peak.contrast), peak.contrast));
    }
  }
  return curve;
}

struct SweepResult
{
  double range = 0, agreement = 0;
};

/// The ranges at which the window agrees with the pair and with neither neighbour more, best first.
std::vector<SweepResult> focus(const PairHypothesis &pair, const RangeCurve &left, const RangeCurve &right,
                               const std::vector<double> &ranges, const DetectorOptions &options)
{
  const auto score = [&](std::size_t i) {
    const int seen = left.seen[i] + right.seen[i];
    const bool is_seen = std::min(left.seen[i], right.seen[i]) >= kLeastViews;
    const double r = pair.s * ranges[i];
    return is_seen && r >= options.radius_min && r <= options.radius_max ? (left.sum[i] + right.sum[i]) / seen : -1.0;
  };
  constexpr std::size_t kMost = 2;
  std::vector<SweepResult> maxima;
  double before = -1, here = score(0);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const double after = i + 1 < ranges.size() ? score(i + 1) : -1;
    if (here >= options.agreement_min && here >= before && here > after)
      maxima.push_back({ranges[i], here});
    before = here;
    here = after;
  }
  std::sort(maxima.begin(), maxima.end(),
            [](const SweepResult &a, const SweepResult &b) { return a.agreement > b.agreement; });
  if (maxima.size() > kMost)
    maxima.resize(kMost);
  return maxima;
}

struct Fit
{
  Vector3d p; ///< x, y, log r
  Matrix3d information = Matrix3d::Zero();
  int views = 0, inliers = 0;
  double rms_px = 0;
};

/// Normal equations of one border in one view: residual [px] of its column against a peak.
void accumulate(const PlaneView &view, const Vector3d &p, double q, double q_seen, double side, double px_per_q,
                Matrix3d &H, Vector3d &g, double weight)
{
  const Vector2d w = p.head<2>() - view.position;
  const double d = w.norm(), tangent = std::exp(p(2)) / std::sqrt(d * d - std::exp(2 * p(2)));
  Vector3d J;
  J.head<2>() = Vector2d(-w.y(), w.x()) / (d * d) - side * tangent / (d * d) * w;
  J(2) = side * tangent;
  J *= (1 + q * q) * px_per_q;
  const double residual = (q - q_seen) * px_per_q;
  H += weight * J * J.transpose();
  g += weight * residual * J;
}

/// Least squares on the nearest peaks of the window, with the log-normal prior on the radius.
Fit refine(const std::vector<PlaneView> &views, const PairHypothesis &pair, double range, double px_per_q,
           const DetectorOptions &options)
{
  Fit fit;
  fit.p << views.back().position + range * pair.direction, std::log(pair.s * range);
  constexpr int kIterations = 6;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    const double gate_px = iteration < 2 ? 2 * options.inlier_px : options.inlier_px;
    Matrix3d H = Matrix3d::Zero();
    Vector3d g = Vector3d::Zero();
    fit.views = fit.inliers = 0;
    double squares = 0;
    for (const PlaneView &view : views) {
      const auto columns = bordersOf(view, fit.p.head<2>(), std::exp(fit.p(2)));
      if (!columns || !view.profile->covers(columns->q_left) || !view.profile->covers(columns->q_right))
        continue;
      ++fit.views;
      const double left = view.profile->nearestPeak(columns->q_left, pair.left.contrast);
      const double right = view.profile->nearestPeak(columns->q_right, pair.right.contrast);
      const double left_px = (columns->q_left - left) * px_per_q, right_px = (columns->q_right - right) * px_per_q;
      const bool has_left = std::abs(left_px) < gate_px, has_right = std::abs(right_px) < gate_px; // false for NaN
      if (has_left)
        accumulate(view, fit.p, columns->q_left, left, 1, px_per_q, H, g, 1);
      if (has_right)
        accumulate(view, fit.p, columns->q_right, right, -1, px_per_q, H, g, 1);
      if (has_left && has_right) {
        ++fit.inliers;
        squares += 0.5 * (left_px * left_px + right_px * right_px);
      }
    }
    fit.rms_px = fit.inliers ? std::sqrt(squares / fit.inliers) : 1e9;
    fit.information = H;
    const bool is_hopeless = fit.inliers < kLeastViews || fit.inliers < 0.8 * options.inliers_min * fit.views;
    if (iteration == kIterations || is_hopeless)
      break;
    H.diagonal() += Vector3d(1e-2, 1e-2, 1.0); // holds what the window does not see
    const Vector3d step = H.ldlt().solve(-g);
    if (!step.allFinite())
      break;
    fit.p += step.cwiseMax(-0.5).cwiseMin(0.5);
    if (iteration >= 2 && iteration + 1 < kIterations && step.squaredNorm() < 1e-6)
      iteration = kIterations - 1; // settled: once more for the figures
  }
  return fit;
}

double parallaxOf(const std::vector<PlaneView> &views, const Vector2d &xy)
{
  double low = 0, high = 0;
  const Vector2d reference = (xy - views.back().position).normalized();
  for (const PlaneView &view : views) {
    const Vector2d w = xy - view.position;
    const double angle = std::atan2(reference.x() * w.y() - reference.y() * w.x(), reference.dot(w));
    low = std::min(low, angle);
    high = std::max(high, angle);
  }
  return high - low;
}

bool overlaps(const Detection &a, const Detection &b) { return a.q_left > b.q_right && b.q_left > a.q_right; }

/// Small residuals tell a trunk from chance; of two readings of the same place the wider is the silhouette, the
/// narrower a shadow's edge on the bark.
double quality(const Detection &detection)
{
  return detection.agreement * detection.inliers * std::sqrt(detection.trunk.radius()) *
         (0.5 + std::max(detection.foreground, 0.0)) / (detection.rms_px + 0.2);
}

/// Best first; a trunk that overlaps a better one in the image is another reading of the same lines.
std::vector<Detection> suppress(std::vector<Detection> found)
{
  std::sort(found.begin(), found.end(), [](const Detection &a, const Detection &b) { return quality(a) > quality(b); });
  std::vector<Detection> kept;
  for (const Detection &detection : found)
    if (std::none_of(kept.begin(), kept.end(), [&](const Detection &k) { return overlaps(k, detection); }))
      kept.push_back(detection);
  return kept;
}

std::optional<Detection> verify(const std::vector<PlaneView> &views, const PairHypothesis &pair,
                                const SweepResult &sweep, double px_per_q, const DetectorOptions &options)
{
  const Fit fit = refine(views, pair, sweep.range, px_per_q, options);
  if (fit.inliers < kLeastViews || fit.inliers < options.inliers_min * fit.views || fit.rms_px > options.rms_max_px)
    return std::nullopt;

  Detection detection;
  detection.trunk.xy = fit.p.head<2>();
  detection.trunk.log_radius = fit.p(2);
  const Vector2d w = detection.trunk.xy - views.back().position;
  detection.range = w.norm();
  const double r = detection.trunk.radius();
  detection.parallax = parallaxOf(views, detection.trunk.xy);
  Matrix3d information = fit.information;
  information.diagonal() += Vector3d(1e-2, 1e-2, 1.0);
  detection.covariance = information.inverse();
  const Vector2d along = w / detection.range;
  const double sigma = std::sqrt(along.dot(detection.covariance.topLeftCorner<2, 2>() * along));
  if (detection.range < options.range_min || detection.range > options.range_max || r < options.radius_min ||
      r > options.radius_max || detection.parallax < options.parallax_min ||
      sigma > options.range_sigma_max * detection.range)
    return std::nullopt;
  detection.agreement = sweep.agreement;
  detection.rms_px = fit.rms_px;
  detection.views = fit.views;
  detection.inliers = fit.inliers;
  detection.q_left = pair.left.q;
  detection.q_right = pair.right.q;
  detection.left_contrast = pair.left.contrast;
  detection.right_contrast = pair.right.contrast;
  return detection;
}

/// A pair that overlaps a known trunk is another reading of it, unless it holds all of it: then the known one may be an
/// edge on the bark of this.
bool inhibited(const std::vector<InhibitedRange> &known, double q_right, double q_left)
{
  return std::any_of(known.begin(), known.end(), [&](const InhibitedRange &range) {
    const bool overlaps = q_left > range.q_right && q_right < range.q_left;
    const bool holds_it =
        q_left > range.q_left && q_right < range.q_right && q_left - q_right > 1.2 * (range.q_left - range.q_right);
    return overlaps && !holds_it;
  });
}
} // namespace

double foregroundBetween(const vpImage<float> &p_background, const PinholeCamera &camera, const RelativeTrunk &relative,
                         const ElevationRange &range)
{
  const BorderLine left = borderLine(camera, relative, Border::left, range, 0);
  const BorderLine right = borderLine(camera, relative, Border::right, range, 0);
  double sum = 0;
  int n = 0;
  for (int v = std::max(left.row_begin, right.row_begin); v < std::min(left.row_end, right.row_end); ++v)
    for (int u = static_cast<int>(std::ceil(left.xAt(v))); u <= right.xAt(v); ++u, ++n)
      sum += 1 - static_cast<double>(p_background[v][u]);
  return n >= 30 ? sum / n : -1;
}

std::vector<Detection> detectTrunks(const std::vector<DetectorView> &views, const PinholeCamera &camera,
                                    const std::vector<InhibitedRange> &known, const vpImage<float> *p_background,
                                    const DetectorOptions &options)
{
  std::vector<Detection> found;
  if (static_cast<int>(views.size()) < kLeastViews)
    return found;
  std::vector<PlaneView> plane;
  for (const DetectorView &view : views) {
    const Vector3d axis = view.wMc.R.col(2);
    const Vector2d forward = axis.head<2>().normalized();
    plane.push_back({view.profile, view.wMc.t.head<2>(), forward, {-forward.y(), forward.x()}});
  }

  const auto &peaks = views.back().profile->peaks; // by rising q: from right to left
  const std::vector<double> ranges = sweptRanges(options);
  std::vector<RangeCurve> curves;
  for (const ProfilePeak &peak : peaks)
    curves.push_back(sweep(plane, peak, ranges));
  for (std::size_t i = 0; i < peaks.size(); ++i)
    for (std::size_t j = i + 1; j < peaks.size(); ++j) {
      const PairHypothesis pair = makePair(plane.back(), peaks[j], peaks[i]);
      if (pair.s * options.range_min > options.radius_max)
        break;
      if (pair.s * options.range_max < options.radius_min || inhibited(known, peaks[i].q, peaks[j].q))
        continue;
      for (const SweepResult &at : focus(pair, curves[j], curves[i], ranges, options)) {
        auto detection = verify(plane, pair, at, camera.fx, options);
        if (!detection)
          continue;
        if (p_background)
          detection->foreground = foregroundBetween(
              *p_background, camera, relativeTrunk(views.back().wMc, Pose(), detection->trunk), options.profile.range);
        if (p_background && detection->range < options.near_range && detection->foreground >= 0 &&
            detection->foreground < options.foreground_min)
          continue;
        found.push_back(*detection);
      }
    }
  return suppress(std::move(found));
}
} // namespace bole
