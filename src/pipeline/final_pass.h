// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which hypotheses are trunks, decided when the whole flight is known.
///
/// Idea: while the drone flies, a hypothesis is judged by what a few frames showed, from poses that were still to be
/// corrected. At the end each one, also those that were given up, is looked up in all frames: its columns at its own
/// depth and at others (PhotoConsistency). The likely ones are tracked again through all frames, judged again where
/// that puts them, and the best set is kept of which no two stand in one place or are made of the same lines.

#include "detection/photo_consistency.h"
#include "pipeline/candidate_track.h"
#include <bole/pipeline.h>

#include <deque>
#include <functional>
#include <limits>
#include <vector>

namespace bole
{
/// A keyframe: an image that is kept for the final pass, with its rectified column image.
struct Keyframe
{
  std::size_t pose = 0;
  double time_s = 0;
  vpImage<unsigned char> image;
  ColumnImage level;
};

/// The keyframes of a flight, in bounded memory: when it is full, every other keyframe is dropped and later ones are
/// taken half as often.
class KeyframeStore
{
public:
  void add(const vpImage<unsigned char> &image, const ColumnImage &level, std::size_t pose, double time_s);
  const std::deque<Keyframe> &frames() const { return m_frames; }

private:
  std::deque<Keyframe> m_frames; ///< never moved to another place: pictures would be copied
  std::size_t m_every = 1, m_offered = 0;
};

/// Gradients of the keyframes, computed when first asked for and cached up to a bound of memory.
class KeyframeGradients
{
public:
  /// \p frames must outlive it.
  KeyframeGradients(const std::deque<Keyframe> &frames, const GradientOptions &options);
  std::shared_ptr<const Gradient> operator[](std::size_t frame);

private:
  const std::deque<Keyframe> &m_frames;
  GradientOptions m_options;
  std::vector<std::shared_ptr<const Gradient>> m_made;
  std::size_t m_bytes = 0;
};

/// Log-odds above which a hypothesis is weighed against a surface and tracked again.
inline constexpr double kMayBeTrunk = -1.5;

/// A hypothesis with its photo-consistency over all views and the log-odds that follow from it.
struct ScoredHypothesis
{
  int id = 0; ///< in the map
  Trunk trunk;
  double online = 0, points_beside = 0; ///< as of the Hypothesis
  PhotoConsistency evidence;
  double log_odds = 0; ///< that it is a trunk
  double first_seen_s = -std::numeric_limits<double>::infinity(),
         last_seen_s = std::numeric_limits<double>::infinity(); ///< when its borders were measured first and last
};

/// What the decision rests on, as Decision::kNames.
using OddsTerms = Eigen::Matrix<double, Decision::kNames.size(), 1>;
OddsTerms oddsTerms(const PhotoConsistency &evidence, double online);
/// Fitted by `bole fit-odds` to the simulated flights of seeds 300 to 323 and three rendered ones.
OddsTerms oddsWeights();

/// Scores \p hypothesis by its photo-consistency over \p views; none where too few of them have a parallax.
std::optional<ScoredHypothesis> scoreHypothesis(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                                double farthest);

/// The log-odds of a trunk before a background, of which scoreHypothesis() told those against chance, now against a
/// strip of a surface too: a window, the corner of a wall. \p continuity: mean of continuityAcross() its borders.
void weighAgainstSurface(ScoredHypothesis &scored, const std::vector<ColumnView> &views, double farthest,
                         const std::optional<double> &continuity);

/// The same as scoreHypothesis() from a photo-consistency that is known already.
ScoredHypothesis scoreFrom(const PhotoConsistency &evidence, const Hypothesis &hypothesis);

/// Whether the trunk continues beyond a border at its own range, so that the border is an edge of light and shade.
bool continuesBeyondBorder(const PhotoConsistency &evidence);
/// Whether the background is seen inside a border, so that the border belongs to something behind the trunk.
bool isBackgroundInside(const PhotoConsistency &evidence);
/// Borders that depth proposes in place of those of a hypothesis, which it contradicts.
struct BorderProposal
{
  Hypothesis guess;    ///< the hypothesis between the ends that depth gives the trunk
  double against = 0;  ///< log-odds of depth against the present borders
  double thickest = 0; ///< radius that the proposal may have had [m]
};
/// Proposes other borders for \p hypothesis where depth contradicts its own; none where it does not, or where the
/// proposal is wider than \p radius_max [m]. A hypothesis beside its trunk is moved with its width. \p outside_px:
/// borders are proposed where the trunk likely continues by more than this beyond one; by default where it surely
/// continues.
std::optional<BorderProposal> proposeBorders(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                             double farthest, double radius_max,
                                             double outside_px = std::numeric_limits<double>::infinity());
/// Whether \p other, tracked between the borders of \p proposal, is the better silhouette: what depth says for its
/// borders outweighs what it loses in log-odds against \p hypothesis.
bool isBetterSilhouette(const ScoredHypothesis &other, const ScoredHypothesis &hypothesis,
                        const BorderProposal &proposal, const std::vector<ColumnView> &views, double farthest);

/// The score by which two hypotheses for one trunk are compared in views from nearly one place. Log-odds alone would
/// choose a narrow one that lies on the bark all over, whose borders are not the occluding contours, so depth at the
/// weaker border counts too.
double silhouetteScore(const ScoredHypothesis &hypothesis);

/// Proposes the range at which the texture of \p hypothesis is the most consistent, with the same width in the images.
/// None where it stands there already, or where it would be thicker than \p radius_max [m].
std::optional<Hypothesis> proposeRange(const Hypothesis &hypothesis, const std::vector<ColumnView> &views,
                                       double farthest, double radius_max);

/// Fuses the borders of an estimate with those by depth, weighted by their variances; its covariance grows by what they
/// differ. The estimate is returned as it is where depth gives no borders.
TrunkEstimate fuseDepthBorders(TrunkEstimate estimate, const std::vector<ColumnView> &views, double farthest);

/// Fuses the range of \p trunk by its borders with that by its texture: the trunk at the mean of both.
Trunk fuseTextureRange(const Trunk &trunk, const std::vector<ColumnView> &views, double farthest);

/// Non-maximum suppression: the hypotheses with log-odds of at least \p least, best first, without those that stand in
/// the place of a better one (less than \p apart [m] between their bark) or fill the same columns as a better one in
/// most of their views.
std::vector<ScoredHypothesis> chooseSet(std::vector<ScoredHypothesis> scored, double least, double apart,
                                        const std::vector<ColumnView> &views, double farthest);

/// Scores hypotheses again by a closer look at them; none for one that does not bear it.
/// \p best: the set that they are of.
using ScoreAgain = std::function<std::vector<std::optional<ScoredHypothesis>>(
    const std::vector<ScoredHypothesis> &untried, const std::vector<ScoredHypothesis> &best)>;
/// Scores the best set of \p scored \p again, and what takes the place of those that do not bear it, until all of the
/// best set were scored again. Best is what chooseSet() chooses of those that may be trunks.
std::vector<ScoredHypothesis> scoreBestAgain(std::vector<ScoredHypothesis> scored, double apart,
                                             const std::vector<ColumnView> &views, double farthest,
                                             const ScoreAgain &again);
} // namespace bole
