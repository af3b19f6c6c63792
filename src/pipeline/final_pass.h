// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Which hypotheses are trunks, decided when the whole flight is known.
///
/// Idea: while the drone flies, a hypothesis is judged by what a few frames showed, from poses that were still to be
/// corrected. At the end each one, also those that were given up, is looked up in all frames: its columns at its own
/// depth and at others (ColumnEvidence). The likely ones are tracked again through all frames, judged again where that
/// puts them, and the best set is kept of which no two stand in one place or are made of the same lines.

#include "detection/column_evidence.h"
#include "pipeline/adoption.h"
#include <bole/pipeline.h>

#include <deque>
#include <limits>
#include <vector>

namespace bole
{
/// A frame that is kept to the end.
struct KeptFrame
{
  std::size_t pose = 0;
  double time_s = 0;
  vpImage<unsigned char> image;
  LevelImage level;
};

/// Frames of the flight. Bounded: when it is full every other frame goes, and the next ones are taken half as often.
class Album
{
public:
  void add(const vpImage<unsigned char> &image, const LevelImage &level, std::size_t pose, double time_s);
  const std::deque<KeptFrame> &frames() const { return m_frames; }

private:
  std::deque<KeptFrame> m_frames; ///< never moved to another place: pictures would be copied
  std::size_t m_every = 1, m_offered = 0;
};

/// Gradients of the frames of an album. Each is made once, and kept as far as the memory goes.
class AlbumGradients
{
public:
  /// \p frames must outlive it.
  AlbumGradients(const std::deque<KeptFrame> &frames, const GradientOptions &options);
  std::shared_ptr<const Gradient> operator[](std::size_t frame);

private:
  const std::deque<KeptFrame> &m_frames;
  GradientOptions m_options;
  std::vector<std::shared_ptr<const Gradient>> m_made;
  std::size_t m_bytes = 0;
};

/// A hypothesis with the odds that all frames give it.
struct Judged
{
  int id = 0; ///< in the map
  Trunk trunk;
  double online = 0;
  ColumnEvidence evidence;
  double log_odds = 0; ///< that it is a trunk
  double first_seen_s = -std::numeric_limits<double>::infinity(),
         last_seen_s = std::numeric_limits<double>::infinity(); ///< when its borders were read
};

/// What the decision rests on, as Decision::kNames.
using OddsTerms = Eigen::Matrix<double, Decision::kNames.size(), 1>;
OddsTerms oddsTerms(const ColumnEvidence &evidence, double online);
/// Fitted by `bole fit-odds` to the simulated flights of seeds 300 to 323 and three rendered ones.
OddsTerms oddsWeights();

/// What the columns of all frames say of \p hypothesis; none where too few views have a parallax.
std::optional<Judged> judge(const Hypothesis &hypothesis, const std::vector<LevelView> &views, double farthest);

/// The same of evidence at hand.
Judged judgedBy(const ColumnEvidence &evidence, const Hypothesis &hypothesis);

/// Whether the trunk goes on beside a border.
bool goesOnBeside(const ColumnEvidence &evidence);
/// Whether the background stands inside a border.
bool isBehind(const ColumnEvidence &evidence);
/// A reading whose borders depth contradicts.
struct BorderDoubt
{
  Hypothesis guess;   ///< of the silhouette: between the ends that depth gives the trunk
  double against = 0; ///< what depth says against the borders of the reading [log-odds]
};
/// None where the borders of \p reading are its ends, or the guess is wider than \p radius_max [m]. A reading beside
/// its trunk is moved as wide as it is. \p outside_px: a trunk that likely goes on by more beyond a border is doubted,
/// else one that surely does.
std::optional<BorderDoubt> doubtBorders(const Hypothesis &reading, const std::vector<LevelView> &views, double farthest,
                                        double radius_max, double outside_px = std::numeric_limits<double>::infinity());
/// Whether depth speaks for \p other by more than it is less of a trunk than the \p reading in \p doubt.
bool isSilhouetteOf(const Judged &other, const Judged &reading, const BorderDoubt &doubt,
                    const std::vector<LevelView> &views, double farthest);

/// By which two readings of one trunk are compared in views from nearly one place: a narrow one lies on the bark all
/// over and has the better odds to be a trunk, but its borders are not those of the silhouette.
double silhouetteScore(const Judged &reading);

/// Where the bark says that \p reading stands: nearer or farther along the lines of sight, as wide in the images as it
/// is. None where it stands there, or would be thicker than \p radius_max [m].
std::optional<Hypothesis> nearerOrFarther(const Hypothesis &reading, const std::vector<LevelView> &views,
                                          double farthest, double radius_max);

/// Between the borders that it was read from, moved towards where depth ends the trunk, and as sure of them as depth
/// agrees; as it is where depth tells of none.
TrunkEstimate endedByDepth(TrunkEstimate estimate, const std::vector<LevelView> &views, double farthest);

/// Where \p trunk stands by its bark as well as by its borders: at the mean of both ranges.
Trunk placedByBark(const Trunk &trunk, const std::vector<LevelView> &views, double farthest);

/// The best first, without those whose odds are below \p least, that stand in the place of a better one (less than
/// \p apart [m] between their bark) or fill the same columns in most of the views that they were read in.
std::vector<Judged> chooseSet(std::vector<Judged> judged, double least, double apart,
                              const std::vector<LevelView> &views, double farthest);
} // namespace bole
