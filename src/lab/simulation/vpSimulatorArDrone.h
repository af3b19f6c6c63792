// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// An AR.Drone in a rendered forest, with ViSP's robot interface.

#include "simulation/flight_sensors.h"
#include "simulation/forest_renderer.h"
#include "simulation/quadrotor.h"
#include <bole/flight_laws.h>
#include <bole/frame.h>
#include <bole/vpRobotArDrone.h>

#include <memory>

/// Takes the calls of vpRobotArDrone and moves a simulated drone; its camera, gyro and pose filter are a
/// bole::FrameSource. A loop written against one flies the other.
///
/// Idea: the same velocity loop at 30 Hz, the same laws and the same limits as vpRobotArDrone, on a
/// bole::Quadrotor instead of a radio. Time is simulated: it passes in next() and advance() and nowhere else, so the
/// same seed and the same commands give the same flight on any machine. next() returns when a frame has come over the
/// video link, video_delay_s after it was taken: commands given then act on a drone that has moved on.
///
/// Frames: w the forest's world, b body (x forward, y left, z up), c camera. Not thread-safe.
///
/// \code
/// vpSimulatorArDrone robot(forest, options);
/// robot.open(vpSimulatorArDrone::Permission::fly);
/// robot.takeOff();
/// bole::Frame frame;
/// while (robot.next(frame))
///   robot.setVelocity(vpRobot::CAMERA_FRAME, v); // from what was seen in the frame
/// \endcode
class vpSimulatorArDrone : public vpRobot, public bole::FrameSource
{
public:
  using Permission = vpRobotArDrone::Permission;
  using Watchdog = vpRobotArDrone::Watchdog;
  struct Options : vpRobotArDrone::Options
  {
    double rate_hz = 10;         ///< of the camera, 1 to 60
    double exposure_s = 0.006;   ///< motion blur, 0 to 0.1
    double battery_s = 720;      ///< a full one lasts, 1 to 100000: an AR.Drone's 12 minutes
    double video_delay_s = 0.06; ///< from the middle of the exposure to next(), 0 to 1
    bool has_images = true;      ///< false: frames come without pixels, at no cost
    bole::QuadrotorOptions body;
    bole::SensorOptions sensors;
    bole::RendererOptions renderer; ///< its lens must have no distortion: frames are taken as a pinhole's
    Options();
    /// One seed for gusts, sensors and image noise.
    void setSeed(std::uint64_t seed);
    void validate() const;
  };

  /// It stands at the origin and looks along x.
  vpSimulatorArDrone(const bole::Forest &forest, const Options &options);
  ~vpSimulatorArDrone() override;

  // As vpRobotArDrone.
  void open(Permission permission);
  void close(); ///< lands
  bool isOpen() const;
  void takeOff();
  void land();
  void hover();
  void emergency(); ///< motors off: the simulated drone stands on the ground at once
  void trim();
  void setVelocity(const vpRobot::vpControlFrameType frame, const vpColVector &v) override;
  Watchdog watchdog() const;
  std::string brokenLaw() const; ///< the law that overrules what was wanted now; empty where none does
  void init() override {}
  void get_eJe(vpMatrix &jacobian) override;                                          ///< 6x4: columns vx, vy, vz, wz
  void get_fJe(vpMatrix &jacobian) override;                                          ///< throws
  void getPosition(const vpRobot::vpControlFrameType frame, vpColVector &q) override; ///< of the pose filter
  void getDisplacement(const vpRobot::vpControlFrameType frame, vpColVector &q) override;   ///< since the last call
  void setPosition(const vpRobot::vpControlFrameType frame, const vpColVector &q) override; ///< throws

  // The camera. next() never ends.
  bool next(bole::Frame &frame) override;
  bole::PinholeCamera camera() const override;
  bole::Pose bMc() const override;
  std::string name() const override { return "simulated AR.Drone"; }
  bool hasOdometry() const override { return true; }
  bool hasGyro() const override { return true; }

  // The simulation itself.
  void advance(double seconds); ///< time passes and no picture is taken (taking off, waiting)
  double time() const;          ///< [s]
  bool isInAir() const;
  void loseNavdata(bool are_lost); ///< from now on, as far as the robot's loop can tell
  /// The truth: for evaluation only.
  const bole::Quadrotor &body() const;
  /// Least distance of the body's origin to the bark of a trunk since take-off [m].
  double leastClearance() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
