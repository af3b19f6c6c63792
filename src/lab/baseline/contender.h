// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One tracker in a comparison: which class, with which settings, with how much help.

#include "baseline/model_tracker.h"
#include "baseline/test_flight.h"

#include <bole/vpMbTrunkTracker.h>

#include <memory>
#include <string>

namespace bole
{
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
  std::string message;
  double ms = 0; ///< thread CPU time of track() and what the help needs in the tracker, without the reading of images
};

class Contender
{
public:
  /// \p trunk_xml: settings file of vpMbTrunkTracker (trunk_settings.h), empty: its defaults. Of \p settings our
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
