// SPDX-License-Identifier: GPL-2.0-or-later
#include "detection/detector.h"

#include "detection/detection_loops.h"
#include "geometry/solve_definite.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr double kAside_px = 2.5; ///< from a border into what is beside it: half of the window of saliency
constexpr int kLeastInliers = 5;  ///< views within the window that see both borders: fewer let chance pairs agree

/// A view reduced to the ground plane.
struct PlaneView
{
  const LevelProfile *profile;
  Vector2d position, forward, left; ///< of the level camera in the world
};

/// The views for the loops; places are relative to that of the last view.
ViewColumns columnsOf(const std::vector<PlaneView> &views)
{
  ViewColumns columns;
  const auto add = [&columns](const Vector2d &at, const PlaneView &view, double q_first, double q_last, double step) {
    const auto put = [](std::vector<float> &column, double value) { column.push_back(static_cast<float>(value)); };
    put(columns.x, at.x());
    put(columns.y, at.y());
    put(columns.forward_x, view.forward.x());
    put(columns.forward_y, view.forward.y());
    put(columns.left_x, view.left.x());
    put(columns.left_y, view.left.y());
    put(columns.q_first, q_first);
    put(columns.q_last, q_last);
    put(columns.by_step, 1 / step);
  };
  std::size_t samples = 0;
  for (const PlaneView &view : views)
    samples += view.profile->mean.size();
  columns.rising_peak.reserve(samples);
  columns.falling_peak.reserve(samples);
  for (const PlaneView &view : views) {
    const LevelProfile &profile = *view.profile;
    add(view.position - views.back().position, view, profile.q_first, profile.qLast(), profile.step);
    columns.first_sample.push_back(static_cast<int>(columns.rising_peak.size()));
    columns.rising_peak.insert(columns.rising_peak.end(), profile.rising_peak.begin(), profile.rising_peak.end());
    columns.falling_peak.insert(columns.falling_peak.end(), profile.falling_peak.begin(), profile.falling_peak.end());
  }
  constexpr std::size_t kTogether = 8; // views that are worked on at once: the last ones may be blind
  while (columns.x.size() % kTogether != 0) {
    add(Vector2d::Zero(), {nullptr, Vector2d::Zero(), Vector2d::Zero(), Vector2d::Zero()}, 1, 0, 1);
    columns.first_sample.push_back(0);
  }
  return columns;
}

/// A peak of the current view, with half of its bearing.
struct HalfBearing
{
  explicit HalfBearing(double q) : half(0.5 * std::atan(q)), sine(std::sin(half)), cosine(std::cos(half)) {}

  double half, sine, cosine;
};

struct PairHypothesis
{
  ProfilePeak left, right;
  double bearing = 0; ///< of the middle
  double s = 0;       ///< r / d

  PairHypothesis(const ProfilePeak &l, const HalfBearing &at_l, const ProfilePeak &r, const HalfBearing &at_r)
      : left(l), right(r), bearing(at_l.half + at_r.half), s(at_l.sine * at_r.cosine - at_l.cosine * at_r.sine)
  {
  }
};

/// How well the window agrees with one peak of the current view, if its border stood at each of the ranges swept. The
/// border of a trunk is a vertical line that hardly moves over a window, so the curves of two borders add up to that
/// of their pair.
struct RangeCurve
{
  float *sum;  ///< of agreement over the views that see it, by range
  float *seen; ///< how many those are
};

/// Ranges swept, uniform in inverse depth: near enough for no focus to fall between two. They fall.
struct SweptRanges
{
  explicit SweptRanges(const DetectorOptions &options)
      : far(1 / (1.2 * options.range_max)), step((1 / options.range_min - far) / (kCount - 1))
  {
    for (std::size_t i = 0; i < kCount; ++i)
      range[i] = static_cast<float>(1 / (far + step * static_cast<double>(i)));
  }
  /// The first at which \p s = r / d makes no more than \p radius.
  std::size_t firstWithin(double s, double radius) const
  {
    const double guess = std::clamp((s / radius - far) / step, 0.0, double(kCount));
    auto i = static_cast<std::size_t>(guess);
    while (i > 0 && !(s * range[i - 1] > radius))
      --i;
    while (i < kCount && s * range[i] > radius)
      ++i;
    return i;
  }

  static constexpr std::size_t kCount = 80;
  std::array<float, kCount> range;

private:
  double far, step; // of the inverse depth
};

/// Adds the agreement of every view with \p peak, by range, to \p curve, which is zero before.
void sweep(const std::vector<PlaneView> &views, const ProfilePeak &peak, const SweptRanges &ranges,
           const RangeCurve &curve)
{
  const PlaneView &now = views.back();
  const Vector2d direction = (now.forward + peak.q * now.left).normalized();
  for (std::size_t v = 0; v + 1 < views.size(); ++v) {
    const Vector2d offset = now.position - views[v].position;
    const LevelProfile &profile = *views[v].profile;
    const SweptView view{static_cast<float>(views[v].forward.dot(offset)),
                         static_cast<float>(views[v].forward.dot(direction)),
                         static_cast<float>(views[v].left.dot(offset)),
                         static_cast<float>(views[v].left.dot(direction)),
                         static_cast<float>(profile.q_first),
                         static_cast<float>(1 / profile.step),
                         (peak.contrast > 0 ? profile.rising : profile.falling).data(),
                         static_cast<int>(profile.mean.size())};
    addAgreement(view, static_cast<float>(1 / peak.contrast), ranges.range.data(), static_cast<int>(ranges.kCount),
                 curve.sum, curve.seen);
  }
}

struct SweepResult
{
  double range = 0, agreement = 0;
};

/// The ranges at which the window agrees with the pair and with neither neighbour more, best first. \p scores keeps its
/// memory.
std::vector<SweepResult> bestRanges(const PairHypothesis &pair, const RangeCurve &left, const RangeCurve &right,
                                    const SweptRanges &ranges, const DetectorOptions &options,
                                    std::vector<float> &scores)
{
  constexpr std::size_t kMost = 2;
  const std::size_t first = ranges.firstWithin(pair.s, options.radius_max);
  const std::size_t end = std::max(first, ranges.firstWithin(pair.s, options.radius_min));
  scores.resize(end - first);
  const float best = scoresOfPair({left.sum + first, left.seen + first}, {right.sum + first, right.seen + first},
                                  static_cast<int>(scores.size()), kLeastInliers, scores.data());
  std::vector<SweepResult> maxima;
  if (best < options.agreement_min)
    return maxima;
  for (std::size_t i = 0; i < scores.size(); ++i)
    if (scores[i] >= options.agreement_min && (i == 0 || scores[i] >= scores[i - 1]) &&
        (i + 1 == scores.size() || scores[i] > scores[i + 1]))
      maxima.push_back({ranges.range[first + i], scores[i]});
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

/// Least squares on the nearest peaks of the window, with the log-normal prior on the radius.
Fit refine(const PlaneView &now, const ViewColumns &views, const PairHypothesis &pair, double range, double px_per_q,
           const DetectorOptions &options)
{
  Fit fit;
  const Vector2d direction = std::cos(pair.bearing) * now.forward + std::sin(pair.bearing) * now.left;
  fit.p << now.position + range * direction, std::log(pair.s * range);
  constexpr int kIterations = 6;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    const double gate_px = iteration < 2 ? 2 * options.inlier_px : options.inlier_px;
    const Eigen::Vector2f at = (fit.p.head<2>() - now.position).cast<float>();
    const Circle circle{at.x(), at.y(), static_cast<float>(std::exp(fit.p(2))), pair.left.contrast > 0,
                        pair.right.contrast > 0};
    const BorderSums sums = sumsOfBorders(views, circle, static_cast<float>(px_per_q), static_cast<float>(gate_px));
    fit.views = static_cast<int>(sums.views);
    fit.inliers = static_cast<int>(sums.inliers);
    fit.rms_px = fit.inliers ? std::sqrt(static_cast<double>(sums.squares) / fit.inliers) : 1e9;
    Matrix3d H;
    H << sums.H[0], sums.H[1], sums.H[2], sums.H[1], sums.H[3], sums.H[4], sums.H[2], sums.H[4], sums.H[5];
    fit.information = H;
    const bool is_hopeless = fit.inliers < kLeastInliers || fit.inliers < 0.8 * options.inliers_min * fit.views;
    if (iteration == kIterations || is_hopeless)
      break;
    H.diagonal() += Vector3d(1e-2, 1e-2, 1.0); // holds what the window does not see
    const Vector3d step = -solveDefinite<3>(H, Eigen::Vector3f::Map(sums.g).cast<double>());
    if (!step.allFinite())
      break;
    fit.p += step.cwiseMax(-0.5).cwiseMin(0.5);
    if (iteration >= 2 && iteration + 1 < kIterations && step.squaredNorm() < 1e-6)
      iteration = kIterations - 1; // settled: once more for the figures
  }
  return fit;
}

/// Whether the bearing of a border changes by \p least over the views: the first that do end the question.
bool hasParallax(const std::vector<PlaneView> &views, const Vector2d &xy, double radius, double least)
{
  double low[2] = {0, 0}, high[2] = {0, 0};
  const Vector2d reference = xy - views.back().position;
  const auto halfAngle = [radius](const Vector2d &w) { return std::asin(std::min(radius / w.norm(), 1.0)); };
  const double here = halfAngle(reference);
  for (const PlaneView &view : views) {
    const Vector2d w = xy - view.position;
    const double angle = std::atan2(reference.x() * w.y() - reference.y() * w.x(), reference.dot(w));
    const double widened = halfAngle(w) - here;
    for (const int side : {0, 1}) {
      const double moved = angle + (side == 0 ? widened : -widened);
      low[side] = std::min(low[side], moved);
      high[side] = std::max(high[side], moved);
      if (high[side] - low[side] >= least)
        return true;
    }
  }
  return false;
}

bool overlaps(const Detection &a, const Detection &b) { return a.q_left > b.q_right && b.q_left > a.q_right; }

/// Small residuals tell a trunk from chance. Of two hypotheses for one place the wider is the silhouette and the
/// narrower a shadow's edge on the bark, unless the wider is wider than the trunks here: then it is a gap.
double quality(const Detection &detection, const LogNormal &radii)
{
  return detection.agreement * detection.inliers * std::sqrt(detection.trunk.radius()) *
         std::exp(radii.logOdds(detection.trunk.log_radius)) / (detection.rms_px + 0.2);
}

std::optional<Detection> verify(const std::vector<PlaneView> &views, const ViewColumns &columns,
                                const PairHypothesis &pair, const SweepResult &sweep, double px_per_q,
                                const DetectorOptions &options)
{
  const Fit fit = refine(views.back(), columns, pair, sweep.range, px_per_q, options);
  if (fit.inliers < kLeastInliers || fit.inliers < options.inliers_min * fit.views || fit.rms_px > options.rms_max_px)
    return std::nullopt;

  Detection detection;
  detection.trunk.xy = fit.p.head<2>();
  detection.trunk.log_radius = fit.p(2);
  const Vector2d w = detection.trunk.xy - views.back().position;
  detection.range = w.norm();
  const double r = detection.trunk.radius();
  Matrix3d information = fit.information;
  information.diagonal() += Vector3d(1e-2, 1e-2, 1.0);
  detection.covariance = information.inverse();
  const Vector2d along = w / detection.range;
  const double sigma = std::sqrt(along.dot(detection.covariance.topLeftCorner<2, 2>() * along));
  if (detection.range < options.range_min || detection.range > options.range_max || r < options.radius_min ||
      r > options.radius_max || sigma > options.range_sigma_max * detection.range ||
      !hasParallax(views, detection.trunk.xy, r, options.parallax_min))
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

/// Whether a pair overlaps a known trunk, of which it is another hypothesis. A pair that holds all of a known trunk is
/// not inhibited, as the known one may be an edge on its bark.
bool inhibited(const std::vector<InhibitedRange> &known, double q_right, double q_left)
{
  return std::any_of(known.begin(), known.end(), [&](const InhibitedRange &range) {
    const bool overlaps = q_left > range.q_right && q_right < range.q_left;
    const bool holds_it =
        q_left > range.q_left && q_right < range.q_right && q_left - q_right > 1.2 * (range.q_left - range.q_right);
    return overlaps && !holds_it;
  });
}

/// The lines of the newest view that have something beside them that is near enough to matter (paper, Section 5):
/// trunks are sought between these alone.
std::vector<ProfilePeak> salientPeaks(const DetectorView &view, const PinholeCamera &camera,
                                      const vpImage<float> &p_background, const DetectorOptions &options)
{
  const double aside = kAside_px / camera.fx;
  const auto isSalient = [&](double q) {
    const std::optional<double> background = meanAlong(p_background, camera, *view.profile, q, options.profile.range);
    return !background || 1 - *background >= options.foreground_min;
  };
  std::vector<ProfilePeak> salient;
  for (const ProfilePeak &peak : view.profile->peaks)
    if (isSalient(peak.q - aside) || isSalient(peak.q + aside))
      salient.push_back(peak);
  return salient;
}
} // namespace

std::vector<Detection> detectTrunks(const std::vector<DetectorView> &views, const PinholeCamera &camera,
                                    const std::vector<InhibitedRange> &known, const vpImage<float> *p_background,
                                    const DetectorOptions &options)
{
  std::vector<Detection> found;
  if (static_cast<int>(views.size()) < kLeastInliers)
    return found;
  std::vector<PlaneView> plane;
  plane.reserve(views.size());
  for (const DetectorView &view : views) {
    const Vector3d axis = view.wMc.R.col(2);
    const Vector2d forward = axis.head<2>().normalized();
    plane.push_back({view.profile, view.wMc.t.head<2>(), forward, {-forward.y(), forward.x()}});
  }

  const std::vector<ProfilePeak> peaks = // by rising q: from right to left
      p_background ? salientPeaks(views.back(), camera, *p_background, options) : views.back().profile->peaks;
  const ViewColumns columns = columnsOf(plane);
  const SweptRanges ranges(options);
  std::vector<float> scores;
  std::vector<float> sums(2 * peaks.size() * ranges.kCount, 0.f);
  std::vector<RangeCurve> curves;
  std::vector<HalfBearing> bearings;
  curves.reserve(peaks.size());
  bearings.reserve(peaks.size());
  for (const ProfilePeak &peak : peaks) {
    float *sum = sums.data() + 2 * curves.size() * ranges.kCount;
    curves.push_back({sum, sum + ranges.kCount});
    sweep(plane, peak, ranges, curves.back());
    bearings.emplace_back(peak.q);
  }
  for (std::size_t i = 0; i < peaks.size(); ++i)
    for (std::size_t j = i + 1; j < peaks.size(); ++j) {
      const PairHypothesis pair(peaks[j], bearings[j], peaks[i], bearings[i]);
      if (pair.s * options.range_min > options.radius_max)
        break;
      if (pair.s * options.range_max < options.radius_min || inhibited(known, peaks[i].q, peaks[j].q))
        continue;
      for (const SweepResult &at : bestRanges(pair, curves[j], curves[i], ranges, options, scores)) {
        auto detection = verify(plane, columns, pair, at, camera.fx, options);
        if (!detection)
          continue;
        const Vector2d w = detection->trunk.xy - plane.back().position;
        detection->trunk.lean = views.back().profile->lean * Vector2d(-w.y(), w.x()).normalized();
        detection->trunk.xy -= views.back().wMc.t.z() * detection->trunk.lean;
        detection->quality = quality(*detection, options.radii);
        found.push_back(*detection);
      }
    }
  std::sort(found.begin(), found.end(), [](const Detection &a, const Detection &b) { return a.quality > b.quality; });
  return found;
}

std::vector<Detection> suppressNonMaxima(const std::vector<Detection> &found)
{
  std::vector<Detection> best;
  for (const Detection &one : found)
    if (std::none_of(best.begin(), best.end(), [&](const Detection &other) { return overlaps(one, other); }))
      best.push_back(one);
  return best;
}
} // namespace bole
