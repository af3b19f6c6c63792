// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The tasks that fly a way: between two trunks, and through a stand of trees.

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

/// Flying between two trunks.
///
/// Idea: sidestep until the map holds two confirmed trunks with a gap between them and nothing in the way; then plan
/// the quickest safe way through it (way_planner.h) anew each frame, where what is beside the gap is a wall and being
/// off its axis costs time. All places are those of the map, taken anew each frame, so a trunk that moves in the map
/// moves the way, and what was not known when the gap was chosen is kept clear of. When the trunks leave the image on
/// both sides the map and the points carry the last metre.
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

struct SlalomTaskOptions
{
  double look = 6;        ///< one sidestep before it leaves: what stands ahead shows by parallax [s], 0 (none) to 30
  double length = 40;     ///< along the heading at the start [m], 1 to 1000
  double swing = 0.7;     ///< amplitude of the line [m], 0 to 3: 3 degrees of parallax 6 m ahead every 2 m
  double wave_length = 8; ///< of the line [m], 2 to 50
  double reach = 4;       ///< largest offset from the line [m], 0.5 to 10
  double off_line = 0.4;  ///< a second spent a metre off the line counts as so much longer [1/m], 0 to 10
  WayOptions way{1.2};    ///< what it slows and turns for leaves a metre a second
  ResponseOptions response;
};

/// Through a stand of trees along a straight line, round whatever may be in the way.
///
/// Idea: each frame the quickest safe way over the next metres is planned anew (way_planner.h) from where the drone
/// would come to rest, and flown until the next. Being off the line costs time; the line itself swings from side to
/// side, and the drone sidesteps once before it leaves: flying straight at a trunk gives no parallax, and what has none
/// is not in the map. The line swings on where the drone is held up, since what is no trunk shows itself as such from
/// another side. The camera looks where the way leads.
class SlalomTask : public ServoTask
{
public:
  explicit SlalomTask(const SlalomTaskOptions &options = {});

  Values errors() const override;

protected:
  bool sees(const FrameReport &) const override { return true; }
  TaskCommand act(const FrameReport &report) override;

private:
  void locate(const FrameReport &report);
  double line(double x) const;

  SlalomTaskOptions m_options;
  bool m_started = false;
  Pose m_start;                                      ///< x along the line
  Eigen::Vector2d m_place = Eigen::Vector2d::Zero(); ///< along, across (left) [m]
  double m_lead = 0; ///< by how much the swing of the line is ahead, since it goes on where the drone does not [m]
  double m_time_s = 0;
  Sidestep m_sidestep;
  Way m_way;
};
} // namespace bole
