// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A flight that is mapped as it goes and set on the map of an earlier one as soon as its trunks allow.

#include "map/constellation.h"
#include <bole/pipeline.h>

#include <optional>
#include <string>
#include <vector>

namespace bole::apps
{
/// The trunks of a run (its folder) or of a `.cao` model, at least three.
/// \throw vpException naming \p path when there are fewer.
std::vector<TrunkRecord> readKnownMap(const std::string &path);

class Localiser
{
public:
  Localiser(std::vector<TrunkRecord> map, const FrameSource &source, double camera_height);

  /// The frame after the last one; now and then the map is asked.
  FrameReport process(const Frame &frame);
  /// Ends the flight: the smoothed trajectory, and the last question.
  void finish();

  const std::optional<Placement> &placement() const { return m_placement; }
  /// From the first frame to the first placement [s].
  std::optional<double> placedAfter_s() const { return m_placed_s; }
  /// The same body pose on the map; it must have been placed.
  Pose onMap(const Pose &wMb) const;
  /// In the world of the flight.
  Trajectory smoothed() const { return m_pipeline.smoothedTrajectory(); }
  Trajectory smoothedOnMap() const;

private:
  void ask();

  std::vector<TrunkRecord> m_map;
  Pipeline m_pipeline;
  std::optional<Placement> m_placement;
  std::optional<double> m_first_s, m_placed_s;
  double m_now_s = 0;
  std::size_t m_frames = 0;
};
} // namespace bole::apps
