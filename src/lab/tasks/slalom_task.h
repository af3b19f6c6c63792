// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Through a stand of trees along a straight line, round whatever may be in the way.
///
/// Idea: each frame the quickest safe way over the next metres is planned anew (way_planner.h) from where the drone
/// would come to rest, and flown until the next. Being off the line costs time; the line itself swings from side to
/// side, and the drone sidesteps once before it leaves: flying straight at a trunk gives no parallax, and what has none
/// is not in the map. The line swings on where the drone is held up, since what is no trunk shows itself as such from
/// another side. The camera looks where the way leads.

#include "tasks/servo_task.h"
#include "tasks/way_planner.h"

namespace bole
{
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
  SafetyOptions safety;
};

class SlalomTask : public ServoTask
{
public:
  explicit SlalomTask(const SlalomTaskOptions &options = {});

  const Way &way() const { return m_way; }
  double progress() const { return m_place.x(); } ///< [m]
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
