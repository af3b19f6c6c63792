// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Flying an AR.Drone with ViSP's robot interface.

#include <bole/flight_laws.h>
#include <bole/vpArDroneGrabber.h>

#include <bole/visp.h>
#include <memory>
#include <visp3/robot/vpRobot.h>

/// Sends velocities to an AR.Drone over the connection of a grabber.
///
/// Idea: nothing is sent until open() gets the permission to fly; without it every command throws.
/// The drone obeys tilts, not velocities, so a loop at 30 Hz turns the wanted horizontal velocity
/// into tilts by a proportional law on the velocity of the navdata: tilt = gain (wanted - measured)
/// of the largest tilt. Climb and turn are shares of the drone's largest rates. In the same loop stand
/// bole::FlightLaws: commands or navdata that stay out make the drone hover and then land, a low battery lands it, a
/// fence and a band of heights cut what leads beyond them. The destructor and close() land a drone that this object
/// took off.
///
/// Degrees of freedom: vx, vy, vz, wz of the body (x forward, y left, z up); the others follow from
/// flying and are ignored. Thread-safe.
///
/// \code
/// vpArDroneGrabber g("ardrone://192.168.1.1");
/// g.open(I);
/// vpRobotArDrone robot(g);
/// robot.open(vpRobotArDrone::Permission::fly); // a person said that it may
/// robot.takeOff();
/// robot.setVelocity(vpRobot::CAMERA_FRAME, v); // at least every 0.5 s
/// robot.land();
/// \endcode
class vpRobotArDrone : public vpRobot
{
public:
  /// Whether commands may make it fly.
  enum class Permission
  {
    none,
    fly
  };
  /// Limits of what is sent.
  struct Options
  {
    bole::FlightLawOptions laws; ///< kept in the robot's own loop
    double gain = 0.3;           ///< share of the largest tilt per m/s, (0, 2): 0.5 gave 1.4 m/s^2 on a real drone
    double largest_share = 0.5;  ///< (0, 1]: of tilt, climb and turn
    double largest_climb = 0.7;  ///< [m/s], (0, 5): the drone's setting control:control_vz_max
    double largest_turn = 1.74;  ///< [rad/s], (0, 7): the drone's setting control:control_yaw
    vpHomogeneousMatrix bMc;     ///< camera in the body; default: looks ahead at the body's origin
    Options();
    /// \throws vpException where a value is out of range, with what is allowed
    void validate() const;
  };

  /// \param grabber open or connected; must outlive the robot.
  explicit vpRobotArDrone(vpArDroneGrabber &grabber);
  /// \param grabber open, outlives the robot \param options limits
  vpRobotArDrone(vpArDroneGrabber &grabber, const Options &options);
  ~vpRobotArDrone() override;

  /// Begins to send commands. Nothing is sent before.
  void open(Permission permission);
  /// Lands and stops sending.
  void close();
  /// Between open() and close().
  bool isOpen() const;

  /// \throws vpRobotException without permission
  void takeOff();
  /// At any time.
  void land();
  /// Stops where it is.
  void hover();
  /// Stops the motors at once, in the air too; again to leave that state on the ground.
  void emergency();
  /// Tells the standing drone that it stands level.
  void trim();
  /// Six numbers, [m/s] and [rad/s]. CAMERA_FRAME: of the camera; REFERENCE_FRAME: of the
  /// body. Others throw vpRobotException.
  void setVelocity(const vpRobot::vpControlFrameType frame, const vpColVector &v) override;

  /// What the watchdog does when no command comes.
  enum class Watchdog
  {
    idle,
    content,
    hovers,
    lands
  };
  Watchdog watchdog() const;     ///< what the loop does now
  std::string brokenLaw() const; ///< the law that overrules what was wanted now; empty where none does

  // The rest of vpRobot.
  /// Nothing to be done: open() starts it.
  void init() override {}
  void get_eJe(vpMatrix &jacobian) override; ///< 6x4: columns vx, vy, vz, wz
  void get_fJe(vpMatrix &jacobian) override; ///< throws: a flying body has no fixed frame
  /// (t, theta u) of the body in the odometry's world since take-off of the program; [m, rad].
  void getPosition(const vpRobot::vpControlFrameType frame, vpColVector &q) override;
  void getDisplacement(const vpRobot::vpControlFrameType frame,
                       vpColVector &q) override; ///< since the last call
  void setPosition(const vpRobot::vpControlFrameType frame,
                   const vpColVector &q) override; ///< throws

private:
  struct State;
  std::unique_ptr<State> m_state;
};

/// What robots that fly alike share.
namespace bole
{
/// vx, vy, vz [m/s] and wz [rad/s] of the body (x forward, y left, z up). \p velocity is a twist (vx, vy, vz, wx, wy,
/// wz) of the camera (vpRobot::CAMERA_FRAME) or of the body (vpRobot::REFERENCE_FRAME); as vpRobot does, the whole of
/// it is slowed until no linear component exceeds \p translation_max [m/s] and no angular one \p rotation_max [rad/s].
/// wx and wy of the body, which a quadrotor needs for its own balance, are dropped.
///
/// \throw vpRobotException on another length than 6, another frame, or numbers that are not finite.
Eigen::Vector4d bodyVelocity(vpRobot::vpControlFrameType frame, const vpColVector &velocity,
                             const vpHomogeneousMatrix &bMc, double translation_max, double rotation_max);

/// vpRobot::get_eJe() of a quadrotor, 6x4: its columns are vx, vy, vz and wz.
vpMatrix quadrotorJacobian();
/// From \p from to \p to as vpRobot tells it: translation and theta u in the frame of \p from.
vpColVector motionBetween(const Pose &from, const Pose &to);
} // namespace bole
