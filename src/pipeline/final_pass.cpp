// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/final_pass.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <set>

namespace bole
{
void KeyframeStore::add(const vpImage<unsigned char> &image, const ColumnImage &level, std::size_t pose, double time_s)
{
  constexpr std::size_t kMostBytes = std::size_t(256) << 20; // of pictures
  if (m_offered++ % m_every != 0)
    return;
  m_frames.push_back({pose, time_s, image, level});
  if (m_frames.size() * image.getSize() <= kMostBytes)
    return;
  m_every *= 2;
  std::deque<Keyframe> kept; // a vpImage that was moved from would not own what is assigned to it
  for (std::size_t i = 0; i < m_frames.size(); i += 2)
    kept.push_back(std::move(m_frames[i]));
  m_frames = std::move(kept);
}

KeyframeGradients::KeyframeGradients(const std::deque<Keyframe> &frames, const GradientOptions &options)
    : m_frames(frames), m_options(options), m_made(frames.size())
{
}

std::shared_ptr<const Gradient> KeyframeGradients::operator[](std::size_t frame)
{
  constexpr std::size_t kMostBytes = std::size_t(128) << 20; // 40 s of 320x240 at 10 Hz
  if (m_made[frame])
    return m_made[frame];
  auto gradient = std::make_shared<const Gradient>(computeGradient(m_frames[frame].image, m_options));
  const std::size_t bytes = gradient->signed_x.getSize() * sizeof(float);
  if (m_bytes + bytes <= kMostBytes) {
    m_bytes += bytes;
    m_made[frame] = gradient;
  }
  return gradient;
}

OddsTerms oddsTerms(const PhotoConsistency &evidence, double online)
{
  OddsTerms terms;
  terms << 1, evidence.own, std::clamp(std::min(evidence.background, evidence.nearer), -1.0, 2.0),
      evidence.is_best_at_own, online;
  return terms;
}

OddsTerms oddsWeights()
{
  OddsTerms weights;
  weights << -0.02, -0.93, 1.21, 1.24, 0.71;
  return weights;
}

std::optional<ScoredHypothesis> scoreHypothesis(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                                double farthest)
{
  const auto evidence = photoConsistency(hypothesis.trunk, views, farthest);
  if (!evidence)
    return std::nullopt;
  return scoreFrom(*evidence, hypothesis);
}

ScoredHypothesis scoreFrom(const PhotoConsistency &evidence, const Hypothesis &hypothesis)
{
  return {hypothesis.id,     hypothesis.trunk,
          hypothesis.online, hypothesis.points_beside,
          evidence,          oddsWeights().dot(oddsTerms(evidence, hypothesis.online))};
}

/// The weights were chosen on ten path-traced woods, 16 simulated ones (seeds 900001 to 900016), a path-traced street
/// and a real one: of 236 right trunks 2 are lost, of 25 strips of walls and shops 7 stay.
void weighAgainstSurface(ScoredHypothesis &scored, const std::vector<ColumnView> &views, double farthest,
                         const std::optional<double> &continuity)
{
  constexpr double kBias = 0.5; // log-odds where nothing beside it tells
  constexpr double kBeside = 6; // of a unit of freeBeside()
  constexpr double kMost = 1;   // units: one border alone does not decide
  const double against = kBias + scored.points_beside +
                         kBeside * std::clamp(freeBeside(scored.trunk, views, farthest), -kMost, kMost) -
                         (continuity ? logOddsOfSurface(*continuity) : 0);
  scored.log_odds = -std::log(std::exp(-scored.log_odds) + std::exp(-against));
}

bool isBackgroundInside(const PhotoConsistency &evidence)
{
  constexpr double kBackground = 0.15; // difference inside a border
  return std::max(evidence.inside_left, evidence.inside_right) > kBackground;
}

bool continuesBeyondBorder(const PhotoConsistency &evidence)
{
  constexpr double kGoesOn = -0.25; // difference beside a border
  return evidence.weakestOutside() < kGoesOn;
}

namespace
{
/// Mean vector from the camera to \p trunk [m] over the views that show it, of which there must be one.
Eigen::Vector2d meanLineOfSight(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest)
{
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int n = 0;
  for (const ColumnView &view : views)
    if (locate(trunk, view, farthest)) {
      sum += trunk.axisAt(view.z).head<2>() - view.position;
      ++n;
    }
  return sum / n;
}

/// \p trunk with its range along \p line_of_sight [m] changed by its logarithm \p by, as wide in the images as it is.
Trunk movedAlong(const Eigen::Vector2d &line_of_sight, Trunk trunk, double by)
{
  trunk.xy += (std::exp(by) - 1) * line_of_sight;
  trunk.log_radius += by;
  return trunk;
}

/// \p trunk with its borders moved outwards, left and right [m].
Trunk withBordersMoved(Trunk trunk, const std::array<double, 2> &move, const Eigen::Vector2d &leftwards)
{
  trunk.xy += 0.5 * (move[0] - move[1]) * leftwards;
  trunk.log_radius = std::log(trunk.radius() + 0.5 * (move[0] + move[1]));
  return trunk;
}

/// Covariance of place and log radius that follows from the variances of both borders [m^2].
Eigen::Matrix3d covarianceByBorders(const std::array<double, 2> &variance, const Eigen::Vector2d &leftwards,
                                    double radius)
{
  Eigen::Matrix<double, 3, 2> J;
  J << 0.5 * leftwards, -0.5 * leftwards, 0.5 / radius, 0.5 / radius;
  return J * Eigen::Vector2d(variance[0], variance[1]).asDiagonal() * J.transpose();
}

/// By how much \p trunk surely continues beyond its left and right border by depth [px].
std::array<double, 2> beyondBorders(const Trunk &trunk, const DepthBorders &borders)
{
  constexpr double kMixed_px = 1.25; // more than of 98 in 100 borders that are read right (seeds 400 to 423)
  std::array<double, 2> beyond{};
  for (std::size_t side = 0; side < beyond.size(); ++side)
    if (borders.least[side] && borders.likely[side])
      beyond[side] = std::max((*borders.least[side] - trunk.radius()) / borders.px - kMixed_px, 0.0);
  return beyond;
}

/// Log-odds against borders beyond which \p trunk continues by depth.
double logOddsAgainst(const Trunk &trunk, const DepthBorders &borders)
{
  constexpr double kOdds_px = 1, kMost = 4; // log-odds a pixel by which it does, of one border
  const auto [left, right] = beyondBorders(trunk, borders);
  return std::min(kOdds_px * left, kMost) + std::min(kOdds_px * right, kMost);
}
} // namespace

std::optional<BorderProposal> proposeBorders(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                             double farthest, double radius_max, double outside_px)
{
  constexpr double kSigma_px = 1; // of a border by depth
  // by which depth ends a trunk inside a border: more than of 19 in 20 that are read right; enough where the other is
  // not
  constexpr double kInside_px = 2.5, kBeside_px = 1.5;
  const Trunk &trunk = hypothesis.trunk;
  const std::optional<DepthBorders> borders = depthBorders(trunk, views, farthest, radius_max);
  if (!borders)
    return std::nullopt;
  const std::array<double, 2> beyond = beyondBorders(trunk, *borders);
  std::array<double, 2> move{}; // outwards [m]
  for (std::size_t side = 0; side < beyond.size(); ++side)
    if (const double off = borders->likely[side] ? *borders->likely[side] - trunk.radius() : 0;
        beyond[side] > 0 || off > outside_px * borders->px ||
        -off / borders->px > (beyond[1 - side] > 0 ? kBeside_px : kInside_px))
      move[side] = off;
  if (move[0] * move[1] < 0) { // beside the trunk: its width is known by more than these views
    move[0] = 0.5 * (move[0] - move[1]);
    move[1] = -move[0];
  }
  if (move[0] == 0 && move[1] == 0)
    return std::nullopt;
  const double radius = trunk.radius() + 0.5 * (move[0] + move[1]), variance = std::pow(kSigma_px * borders->px, 2);
  if (radius < borders->px || radius > radius_max)
    return std::nullopt;
  const Eigen::Vector2d leftwards = meanLineOfSight(trunk, views, farthest).unitOrthogonal();
  Hypothesis guess{hypothesis.id, withBordersMoved(trunk, move, leftwards), hypothesis.online,
                   hypothesis.points_beside};
  guess.covariance.topLeftCorner<3, 3>() = covarianceByBorders({variance, variance}, leftwards, radius);
  return BorderProposal{guess, logOddsAgainst(trunk, *borders), radius_max};
}

bool isBetterSilhouette(const ScoredHypothesis &other, const ScoredHypothesis &hypothesis,
                        const BorderProposal &proposal, const std::vector<ColumnView> &views, double farthest)
{
  constexpr double kSure = 0.1; // log-odds
  const auto borders = depthBorders(other.trunk, views, farthest, proposal.thickest);
  const double against = borders ? logOddsAgainst(other.trunk, *borders) : 0;
  return other.log_odds - against > hypothesis.log_odds - proposal.against + kSure;
}

double silhouetteScore(const ScoredHypothesis &hypothesis)
{
  constexpr double kOdds = 0.3, kClear = 0.5; // weight of a log-odd; a border of more is clear enough
  return kOdds * hypothesis.log_odds + std::min(hypothesis.evidence.weakestBorder(), kClear);
}

std::optional<Hypothesis> proposeRange(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                       double farthest, double radius_max)
{
  constexpr double kLeast = 0.01, kSigma = 0.02; // of the range: less leads to the same lines; how sure the bark is
  const std::optional<double> by_bark = rangeByTexture(hypothesis.trunk, views, farthest);
  if (!by_bark || std::abs(*by_bark) < kLeast || hypothesis.trunk.radius() * std::exp(*by_bark) > radius_max)
    return std::nullopt;
  const Eigen::Vector2d toward = meanLineOfSight(hypothesis.trunk, views, farthest);
  Hypothesis guess{hypothesis.id, movedAlong(toward, hypothesis.trunk, *by_bark), hypothesis.online,
                   hypothesis.points_beside};
  Eigen::Vector3d along; // as the range grows by its logarithm
  along << toward, 1;
  guess.covariance.topLeftCorner<3, 3>() = kSigma * kSigma * along * along.transpose();
  return guess;
}

TrunkEstimate fuseDepthBorders(TrunkEstimate estimate, const std::vector<ColumnView> &views, double farthest)
{
  constexpr double kBorder2 = 0.67, kDepth2 = 1; // variances of the ends by borders and by depth [px^2]
  constexpr double kMost_px = 2;                 // by which depth differs that counts
  constexpr double kSigma_px = 0.7; // of a border then, the same in all views: what light and shade move it by
  const std::optional<DepthBorders> borders = depthBorders(estimate.trunk, views, farthest);
  if (!borders)
    return estimate;
  const Eigen::Vector2d leftwards = meanLineOfSight(estimate.trunk, views, farthest).unitOrthogonal();
  const ColumnImage &image = *views.back().image;
  const double band = std::abs(image.elevation[0] - image.elevation[1]); // over which columns are added up [tan]
  const double smeared_px = band * std::abs(leftwards.dot(estimate.trunk.lean)) / image.step;
  const double share = kBorder2 / (kBorder2 + kDepth2 + smeared_px * smeared_px);
  const double before = estimate.trunk.radius(), most = std::min(kMost_px * borders->px, before);
  std::array<double, 2> move{}, variance{};
  for (std::size_t side = 0; side < move.size(); ++side) {
    if (borders->likely[0] && borders->likely[1])
      move[side] = share * std::clamp(*borders->likely[side] - before, -most, most);
    variance[side] = std::pow(kSigma_px * borders->px, 2) + move[side] * move[side];
  }
  estimate.trunk = withBordersMoved(estimate.trunk, move, leftwards);
  if (estimate.covariance)
    estimate.covariance->topLeftCorner<3, 3>() += covarianceByBorders(variance, leftwards, estimate.trunk.radius());
  return estimate;
}

Trunk fuseTextureRange(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest)
{
  constexpr double kBark = 0.5; // its share: it errs by as much as the borders (rms), and only in part as they do
  const std::optional<double> by_bark = rangeByTexture(trunk, views, farthest);
  return by_bark ? movedAlong(meanLineOfSight(trunk, views, farthest), trunk, kBark * *by_bark) : trunk;
}

namespace
{
/// Whether \p one is made of the lines of a \p better hypothesis: both fill the same columns in most views of \p one.
/// Views in which it is occluded do not count.
bool fillSameColumns(const ScoredHypothesis &one, const ScoredHypothesis &better, const std::vector<ColumnView> &views,
                     double farthest)
{
  constexpr int kLeastShared = 4;
  constexpr double kMostly = 0.5; // of what either fills; of the views
  int read = 0, same = 0;
  for (const ColumnView &view : views) {
    if (view.time_s < one.first_seen_s || view.time_s > one.last_seen_s)
      continue;
    const auto at_a = locate(one.trunk, view, farthest);
    if (!at_a)
      continue;
    ++read;
    const auto at_b = locate(better.trunk, view, farthest);
    if (!at_b)
      continue;
    const double left = std::min(at_a->bearing + at_a->half_angle, at_b->bearing + at_b->half_angle);
    const double right = std::max(at_a->bearing - at_a->half_angle, at_b->bearing - at_b->half_angle);
    const double either = 2 * (at_a->half_angle + at_b->half_angle) - (left - right);
    same += left - right > kMostly * either;
  }
  return same >= kLeastShared && same > kMostly * read;
}
} // namespace

std::vector<ScoredHypothesis> chooseSet(std::vector<ScoredHypothesis> scored, double least, double apart,
                                        const std::vector<ColumnView> &views, double farthest)
{
  scored.erase(
      std::remove_if(scored.begin(), scored.end(), [&](const ScoredHypothesis &one) { return one.log_odds < least; }),
      scored.end());
  std::sort(scored.begin(), scored.end(),
            [](const ScoredHypothesis &a, const ScoredHypothesis &b) { return a.log_odds > b.log_odds; });
  std::vector<ScoredHypothesis> chosen;
  for (const ScoredHypothesis &one : scored)
    if (std::none_of(chosen.begin(), chosen.end(), [&](const ScoredHypothesis &better) {
          return distanceBetween(one.trunk, better.trunk) < one.trunk.radius() + better.trunk.radius() + apart ||
                 fillSameColumns(one, better, views, farthest);
        }))
      chosen.push_back(one);
  return chosen;
}

std::vector<ScoredHypothesis> scoreBestAgain(std::vector<ScoredHypothesis> scored, double apart,
                                             const std::vector<ColumnView> &views, double farthest,
                                             const ScoreAgain &again)
{
  std::set<int> tried;
  while (true) {
    const std::vector<ScoredHypothesis> best = chooseSet(scored, kMayBeTrunk, apart, views, farthest);
    std::vector<ScoredHypothesis> untried;
    std::copy_if(best.begin(), best.end(), std::back_inserter(untried),
                 [&](const ScoredHypothesis &one) { return tried.count(one.id) == 0; });
    if (untried.empty())
      return scored;
    const std::vector<std::optional<ScoredHypothesis>> results = again(untried, best);
    for (std::size_t i = 0; i < untried.size(); ++i) {
      const int id = untried[i].id;
      tried.insert(id);
      const auto known = std::find_if(scored.begin(), scored.end(), [&](const auto &one) { return one.id == id; });
      if (results[i])
        *known = *results[i];
      else
        scored.erase(known);
    }
  }
}
} // namespace bole
