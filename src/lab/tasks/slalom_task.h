// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Through a stand of trees along a straight line, round whatever the map says is in the way.
///
/// Idea: model-predictive control over a few candidates. Each frame the trajectories to a set of lateral offsets, at a
/// few speeds, are simulated over the next seconds with the drone's lag, and the cheapest is followed until the next
/// frame. The cost grows with the proximity to trunks (their covariance included), with the distance from the line, and
/// with slowness. The drone sidesteps once before it starts, and the line itself is a sine: flight straight towards a
/// trunk gives no parallax, and a trunk without parallax is not in the map. The sine goes on where the drone is
/// stopped, since a false trunk is recognised from another side. Upright columns of triangulated points are avoided as
/// well: a trunk may be missing in the map or misplaced. Space that was not observed to be free has a high cost, since
/// a trunk without corners is in neither. The heading is between the line and the direction of flight.

#include "lab/tasks/obstacles.h"
#include "lab/tasks/servo_task.h"

#include <functional>

namespace bole
{
struct SlalomTaskOptions
{
  double look = 6;           ///< one sidestep before it leaves: what stands ahead shows by parallax [s], 0 (none) to 30
  double length = 40;        ///< along the heading at the start [m], 1 to 1000
  double speed = 1;          ///< [m/s], 0.1 to 3
  double sideways = 0.9;     ///< largest speed across the line [m/s], 0.1 to 3
  double swing = 0.7;        ///< amplitude of the line [m], 0 to 3
  double wave_length = 8;    ///< of the line [m], 2 to 50
  double reach = 4;          ///< largest offset from the line [m], 0.5 to 10
  double body_radius = 0.28; ///< of the drone with its hull [m], 0.05 to 2
  double margin = 0.45;      ///< free space between hull and bark that costs nothing [m], 0 to 3
  double sigmas = 1.5;       ///< of a trunk's place that count as bark, 0 to 5
  int views = 5;             ///< a candidate seen this often is avoided too, 1 to 1000
  double horizon = 5;        ///< of the look ahead [s], 1 to 20
  double lag = 0.6;          ///< of the drone's sideways velocity [s], 0.05 to 3
  SafetyOptions safety;

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// A way: the offset from the line it leads to, and at what speed.
struct SlalomWay
{
  double offset = 0;    ///< [m], positive left
  double speed = 0;     ///< along the line [m/s]
  double clearance = 0; ///< least, hull to bark, covariance counted [m]
  double cost = 0;
};

/// Where the drone is on its line: x along, y across (left), [m]; \p vy [m/s]; \p lead: by how much the swing of the
/// line is ahead of x [m], since it goes on where the drone does not.
struct SlalomState
{
  double x = 0, y = 0, vy = 0, lead = 0;
};

/// Whether the place x along, y left of the line [m] was seen to be free.
using IsSeen = std::function<bool(double x, double y)>;

/// The cheapest way round \p trunks, whose places are on the line's axes (x along, y left), and round what \p is_seen
/// does not know of; none: all of it is.
SlalomWay chooseWay(const std::vector<Obstacle> &trunks, const SlalomState &state, double last_offset,
                    const SlalomTaskOptions &options, const IsSeen &is_seen = {});

class SlalomTask : public ServoTask
{
public:
  explicit SlalomTask(const SlalomTaskOptions &options = {});

  const SlalomWay &way() const { return m_way; }
  double progress() const { return m_state.x; } ///< [m]
  Values errors() const override;

protected:
  bool sees(const FrameReport &) const override { return true; }
  TaskCommand act(const FrameReport &report) override;

private:
  void locate(const FrameReport &report);

  SlalomTaskOptions m_options;
  bool m_started = false;
  Pose m_start;
  SlalomState m_state;
  double m_time_s = 0;
  NearPoints m_near_points;
  SeenSpace m_seen;
  Sidestep m_sidestep;
  SlalomWay m_way;
};
} // namespace bole
