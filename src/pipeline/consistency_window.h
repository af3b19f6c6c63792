// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Photo-consistency of each hypothesis over the last frames, while the drone flies.
///
/// Idea: the last frames from places apart are kept as rectified column images. Each new one is compared with those
/// before it at the range of every hypothesis in sight (PhotoConsistency), and the curves are kept with a fading
/// memory, so that a frame costs one comparison a hypothesis and not one with all that was seen of it.

#include "detection/photo_consistency.h"
#include "pipeline/prediction.h"

#include <deque>
#include <unordered_map>

namespace bole
{
class ConsistencyWindow
{
public:
  struct Frame
  {
    std::size_t pose = 0;
    double time_s = 0;
    ColumnImage level;
  };
  /// The rectified column image of a frame; nullptr where the camera has moved by less than \p spacing [units of the
  /// motion] since the last one. Valid until the next one.
  const ColumnImage *add(const vpImage<unsigned char> &image, std::size_t pose, const Viewpoint &at, double spacing,
                         const ElevationRange &range);
  const std::deque<Frame> &frames() const { return m_frames; } ///< the newest last
  /// Adds what the newest of \p views shows of a hypothesis to its curves and returns its photo-consistency; none
  /// before three views had a parallax.
  std::optional<PhotoConsistency> update(int id, const Trunk &trunk, const std::vector<ColumnView> &views,
                                         double farthest);
  /// Whether enough views came since re-detection of its borders was tried last.
  bool mayRedetect(int id) const;
  void noteRedetection(int id);
  /// Photo-consistency of a hypothesis over its last views, about half a metre of the path: for its present borders.
  std::optional<PhotoConsistency> borderConsistency(int id) const;
  /// Forgets the curves of a hypothesis whose borders were replaced.
  void forget(int id) { m_known.erase(id); }
  template <typename IsGone> void forgetIf(const IsGone &is_gone)
  {
    for (auto known = m_known.begin(); known != m_known.end();)
      known = is_gone(known->first) ? m_known.erase(known) : std::next(known);
  }

private:
  struct Known
  {
    ConsistencyCurves recent; ///< of a fading memory
    ConsistencyCurves last;   ///< of a shorter one
    int views = 0;            ///< since re-detection was tried last
    int redetections = 0;     ///< attempts
  };
  std::deque<Frame> m_frames;
  std::optional<Eigen::Vector3d> m_last;
  std::unordered_map<int, Known> m_known; ///< by id of the hypothesis
};
} // namespace bole
