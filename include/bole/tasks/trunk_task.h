// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Image-based servoing on one trunk: hold its bearing and distance, or circle round it.
///
/// Idea: two of vpFeatureTrunk's four numbers, bearing and log r/d, are what a drone that keeps its own roll, pitch and
/// height can choose. vpServo drives both to their desired values over the drone's Jacobian (vx, vy, wz). Two numbers
/// leave one motion of three free: going round the trunk. `hold` leaves it at rest, `circle` gives it a speed as
/// vpServo's secondary task, which cannot disturb the two.
///
/// A small integral on log r/d takes out what a drone does not obey: it drifts outwards on a circle, and it flies
/// slower than it is told.
///
/// The features come from the trunk as tracked in the image of the moment; where it was missed for a frame or two, from
/// the map and the pose. A distance in metres needs the map's radius and is as good as that; a ratio needs nothing.

#include <bole/tasks/servo_task.h>
#include <bole/vpFeatureTrunk.h>

#include <visp3/vs/vpServo.h>

namespace bole
{
struct TrunkTaskOptions
{
  double ratio = 0;            ///< r/d to be kept, 0 (by distance) to 0.5
  double distance = 3;         ///< camera to axis, where no ratio is given [m], 0.5 to 20
  double bearing = 0;          ///< to be kept, positive right [rad], -0.5 to 0.5
  double speed = 0;            ///< round the trunk, positive to the left [m/s], -2 to 2; 0 holds
  double gain = 0.7;           ///< of vpServo [1/s], 0.05 to 3
  double integral = 0.15;      ///< of log r/d [1/s], 0 to 2
  double smoothing = 0.35;     ///< weight of a new image in the features, 0.05 to 1
  double largest_speed = 0.7;  ///< [m/s], 0.05 to 3
  double choice_angle = 0.35;  ///< trunks farther from straight ahead are not chosen [rad], 0.02 to 0.6
  double choice_range = 7;     ///< nor those beyond this [m], 1 to 20
  int choice_views = 25;       ///< a trunk seen less often is not chosen yet: what is none is given up sooner, 1 to 1000
  double search_s = 40;        ///< gives up after [s], 1 to 600
  SafetyOptions safety;

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// Laws (each a test, on exact features): the error decays at the gain; circling keeps bearing and log r/d.
class TrunkTask : public ServoTask
{
public:
  TrunkTask(const Pose &bMc, const TrunkTaskOptions &options);
  ~TrunkTask() override;

  int target() const { return m_target; } ///< id in the map, -1 while searching
  double desiredRatio() const { return m_ratio; } ///< r/d to be kept, by the radius as it is known now
  const TrunkTaskOptions &options() const { return m_options; }
  Values errors() const override;

  /// The control law alone: velocity (vx, vy, vz = 0, wz) of the body for \p feature; \p dt since the call before [s].
  Eigen::Vector4d velocityFor(const vpFeatureTrunk &feature, double radius, double dt);

protected:
  bool sees(const FrameResult &result, const Pipeline &pipeline) const override;
  TaskCommand act(const FrameResult &result, const Pipeline &pipeline) override;

private:
  TaskCommand search(const FrameResult &result, const Pipeline &pipeline, double time_s);
  int choose(const Pipeline &pipeline, const Pose &wMb) const;
  int successor(const Pipeline &pipeline) const;
  RelativeTrunk look(const FrameResult &result, const MapTrunk &trunk) const;
  void desire(double radius);

  Pose m_bMc;
  TrunkTaskOptions m_options;
  Sidestep m_sidestep;
  vpServo m_servo;
  vpFeatureTrunk m_current, m_desired;
  int m_target = -1;
  Eigen::Vector2d m_place = Eigen::Vector2d::Zero(); ///< of the target in the map
  double m_time_s = 0, m_ratio = 0.05;
  double m_sum = 0; ///< of the integral
  bool m_has_feature = false;
};
} // namespace bole
