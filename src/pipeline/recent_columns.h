// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the columns of the last frames say of each hypothesis, while the drone flies.
///
/// Idea: the last frames from places apart are kept as level images. Each new one is compared with those before it at
/// the range of every hypothesis in sight (ColumnEvidence), and the curves are kept with a fading memory, so that a
/// frame costs one comparison a hypothesis and not one with all that was seen of it.

#include "detection/column_evidence.h"
#include "pipeline/prediction.h"

#include <deque>
#include <unordered_map>

namespace bole
{
class RecentColumns
{
public:
  struct Frame
  {
    std::size_t pose = 0;
    double time_s = 0;
    LevelImage level;
  };
  /// The level image of a frame; nullptr where the camera has moved by less than \p spacing [units of the motion] since
  /// the last one. Valid until the next one.
  const LevelImage *add(const vpImage<unsigned char> &image, std::size_t pose, const Viewpoint &at, double spacing,
                        const ElevationRange &range);
  const std::deque<Frame> &frames() const { return m_frames; } ///< the newest last
  /// What the newest of \p views adds to what is known of a hypothesis; none before three of them had a parallax.
  std::optional<ColumnEvidence> look(int id, const Trunk &trunk, const std::vector<LevelView> &views, double farthest);
  /// Whether enough views came since another reading was tried.
  bool mayReadAgain(int id) const;
  void noteReading(int id);
  /// What the last views, some half a metre of them, say of its borders as they are read.
  std::optional<ColumnEvidence> lately(int id) const;
  /// What was known of it was of another reading.
  void forget(int id) { m_known.erase(id); }
  template <typename IsGone> void forgetIf(const IsGone &is_gone)
  {
    for (auto known = m_known.begin(); known != m_known.end();)
      known = is_gone(known->first) ? m_known.erase(known) : std::next(known);
  }

private:
  struct Known
  {
    ColumnCurves recent; ///< of a fading memory
    ColumnCurves last;   ///< of a shorter one
    int views = 0;       ///< since another reading was tried
    int readings = 0;    ///< that were tried
  };
  std::deque<Frame> m_frames;
  std::optional<Eigen::Vector3d> m_last;
  std::unordered_map<int, Known> m_known; ///< by id of the hypothesis
};
} // namespace bole
