// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A flight to compare trackers on, and one tracker in a comparison: which class, with which settings, with how much
/// help.
#include "baseline/model_tracker.h"
#include <bole/camera.h>
#include <bole/cylinder.h>
#include <bole/vpMbTrunkTracker.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
// A flight with everything that a fair comparison of trackers needs: images, the true pose of each, what odometry
// said of the motion between them, and the true model.

struct TestFrame
{
  vpImage<unsigned char> image;
  Pose cMo;                     ///< true pose
  std::optional<Pose> odometry; ///< cMo by odometry alone: drifts away from cMo
};

/// More is wrong.
struct Limits
{
  double position_m = 0.3;
  double rotation_deg = 5;
};

struct TestFlight
{
  std::string name;
  PinholeCamera camera;
  std::vector<TestFrame> frames;
  std::vector<Cylinder> trunks; ///< true model, world frame
  Limits limits;                ///< what counts as wrong at the scale of this flight
  /// Odometry knows height, roll and pitch for good (sonar, gravity) and drifts in x, y and yaw only.
  bool upright = true;
  Vector6d step_sigma = Vector6d::Constant(0.01);    ///< of odometry's step, world frame: t [m], rotation [rad]
  Vector6d absolute_sigma = Vector6d::Constant(1e3); ///< of what odometry knows for good, the same order

  /// Where odometry expects the camera in frame \p k, given where it was (\p cMo) in the frame before: what a
  /// pilot's program would compute. Upright: the step in x, y and yaw is put on \p cMo; height, roll and pitch are
  /// odometry's own. Otherwise the whole step is.
  Pose predicted(std::size_t k, const Pose &cMo) const;
  /// Covariance of predicted() (camera twist), after a pose with the covariance \p before at \p cMo_before.
  Matrix6d predictedCovariance(const Pose &predicted, const Pose &cMo_before, const Matrix6d &before) const;
  /// The trunks whose axis comes within \p range_m of the camera.
  std::vector<Cylinder> trunksWithin(double range_m) const;
};

/// Reads an ASL folder with truth and `trees.csv` (id, x, y, radius at 1.3 m, lean). Trunks are upright
/// cylinders from 0.1 m to 4 m over the ground.
/// \throw vpException naming file and line.
TestFlight readAslFlight(const std::string &folder);

/// ViSP's real cube-and-cylinder sequence (visp-images-data, `mbt/cube`): the object frame is the cube's, the
/// true pose that of ViSP's tracker on the *cube*, the odometry the same motion with added noise (seeded), the
/// model the cylinder alone. \p folder is .../ViSP-images/mbt. Frames from where ViSP loses the cube on are left out.
TestFlight readCubeFlight(const std::string &folder, int max_frames = 1000);

/// How much the caller helps.
enum class Help
{
  alone,         ///< nothing but the first pose
  prior,         ///< odometry's prediction every frame: setPose() for ViSP's, setMotionPrior() for ours
  reinitialised, ///< initFromPose() at odometry's prediction after each complaint
  truth ///< setPose() at the true pose every frame: only to time a tracker on the trunks that really are in view
};
const char *toString(Help help);

/// What a tracker answered on one frame.
struct Answer
{
  Pose cMo;
  bool complained = false; ///< threw; for ours also a status that says that the pose is predicted
  bool reinitialised = false;
  double ms = 0; ///< thread CPU time of track() and what the help needs in the tracker, without the reading of images
};

class Contender
{
public:
  /// \p trunk_xml: settings file of vpMbTrunkTracker, empty: its defaults. Of \p settings our
  /// tracker takes the far clipping only.
  Contender(TrackerKind kind, Help help, const EdgeSettings &settings, const std::string &trunk_xml = "");
  ~Contender();
  Contender(Contender &&) noexcept;

  std::string name() const;
  TrackerKind kind() const { return m_kind; }
  Help help() const { return m_help; }
  std::string settingsText() const;

  /// Loads the model and starts at the pose \p cMo of \p image. \p cao_path is read by the tracker itself.
  void start(const std::string &cao_path, const PinholeCamera &camera, const vpImage<unsigned char> &image,
             const Pose &cMo);
  /// Tracks frame \p k of \p flight, whose image may have been replaced by \p image; odometry as Help says.
  Answer track(const TestFlight &flight, std::size_t k, const vpImage<unsigned char> &image);

private:
  void giveHelp(const TestFlight &flight, std::size_t k, const Pose &predicted, const vpImage<unsigned char> &image);

  TrackerKind m_kind;
  Help m_help;
  EdgeSettings m_settings;
  std::string m_trunk_xml;
  std::unique_ptr<vpMbTracker> m_tracker;
  vpMbTrunkTracker *m_trunk = nullptr;
  Pose m_cMo; ///< last pose, or prediction where the tracker complained and is helped
};
} // namespace bole
