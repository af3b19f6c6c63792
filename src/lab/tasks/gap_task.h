// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Flying between two trunks.
///
/// Idea: sidestep until the map holds two confirmed trunks with a gap between them and nothing in the way; then plan
/// the quickest safe way through it (way_planner.h) anew each frame, where what is beside the gap is a wall and being
/// off its axis costs time. All places are those of the map, taken anew each frame, so a trunk that moves in the map
/// moves the way, and what was not known when the gap was chosen is kept clear of. When the trunks leave the image on
/// both sides the map and the points carry the last metre.

#include "tasks/servo_task.h"
#include "tasks/way_planner.h"

#include <optional>

namespace bole
{
struct GapTaskOptions
{
  double width_min = 1.2; ///< least free width, bark to bark [m], 0.3 to 5
  double width_max = 3.5; ///< wider is no gap [m], more than width_min, to 20
  double range = 8;       ///< of the gap's middle [m], 1 to 20
  double evidence = 1.5;  ///< of both its trunks, at first: lower log odds only after two sweeps, -20 to 20
  double angle = 0.5;     ///< of the gap's middle from straight ahead [rad], 0.05 to 0.7
  double beyond = 1.5;    ///< stops this far behind it [m], 0.3 to 5
  double off_axis = 0.5;  ///< a second spent a metre off its axis counts as so much longer [1/m], 0 to 10
  double search_s = 45;   ///< gives up after [s], 1 to 600
  WayOptions way{0.6};
  ResponseOptions response;
  SafetyOptions safety;
};

/// Two trunks and the way between them.
struct Gap
{
  int left = -1, right = -1;                        ///< ids
  Eigen::Vector2d middle = Eigen::Vector2d::Zero(); ///< [m]
  Eigen::Vector2d along = Eigen::Vector2d::UnitX(); ///< unit vector through it, away from the drone
  double width = 0;                                 ///< free, bark to bark [m]
};

/// The gap between two trunks as seen from \p from: the middle of the free width.
Gap gapBetween(const Obstacle &one, const Obstacle &other, const Eigen::Vector2d &from);

/// The gap nearest to straight ahead, between trunks of at least \p evidence, whose corridor, from the drone to beyond
/// it, no other trunk narrows.
std::optional<Gap> chooseGap(const std::vector<Obstacle> &trunks, const Eigen::Vector2d &from, double heading,
                             double evidence, const GapTaskOptions &options);

class GapTask : public ServoTask
{
public:
  explicit GapTask(const GapTaskOptions &options = {});

  const std::optional<Gap> &gap() const { return m_gap; }
  Values errors() const override;

protected:
  bool sees(const FrameReport &report) const override;
  void giveUpTarget() override;
  TaskCommand act(const FrameReport &report) override;

private:
  TaskCommand search(const FrameReport &report);
  void refresh(const std::vector<Obstacle> &trunks, const Pose &wMb);
  TaskCommand fly(std::vector<Obstacle> surfaces, const Pose &wMb);

  GapTaskOptions m_options;
  Sidestep m_sidestep{0.8, 9};
  std::optional<Gap> m_gap;
  Way m_way;
  double m_across = 0, m_ahead = -100; ///< of the drone, from the gap's axis and middle [m]
};
} // namespace bole
