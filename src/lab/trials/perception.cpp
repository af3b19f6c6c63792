// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/perception.h"

#include "support/text.h"
#include "support/units.h"
#include <bole/cylinder.h>
#include <bole/open_source.h>
#include <bole/output_folder.h>
#include <bole/pipeline.h>
#include <bole/vpMbTrunkTracker.h>

#include <Eigen/Geometry>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
/// What is the same in every report that the pipeline did not make.
FrameReport reportOn(const Frame &frame)
{
  FrameReport report;
  report.index = frame.index;
  report.stamp_ns = frame.stamp_ns;
  report.frame_status = frame.status;
  report.reason = frame.message;
  return report;
}

/// A tracker that knows the forest's trunks, from the height of knees to that of hands.
std::unique_ptr<vpMbTracker> trackerOf(TrackerKind kind, const PinholeCamera &camera, const Forest &forest)
{
  constexpr double kLow = 0.6, kHigh = 2; // over the foot [m]
  std::vector<Cylinder> model;
  for (const SimulatedTrunk &trunk : forest.trunks)
    model.push_back(cylinderOf(trunk.cylinder(), trunk.foot.z() + kLow, trunk.foot.z() + kHigh));
  std::string folder = (std::filesystem::temp_directory_path() / "bole-servo-XXXXXX").string();
  if (!mkdtemp(folder.data()))
    throw vpException(vpException::ioError, "%s: cannot be made", folder.c_str());
  const std::string path = folder + "/forest.cao"; // the trackers read files only
  writeCao(path, model);
  const Silence silence;
  std::unique_ptr<vpMbTracker> tracker = makeTracker(kind, {}, path, camera);
  removeFiles(folder, {"forest.cao"});
  return tracker;
}

/// Height, roll and pitch of a pose filter do not drift, so they are taken as they are; heading and place go on by its
/// steps from where the images put the drone last.
class TruthMapPerception
{
public:
  TruthMapPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, TrackerKind kind)
      : m_health(camera, bMc), m_sight(camera, bMc, forest), m_bMc(bMc), m_tracker(trackerOf(kind, camera, forest))
  {
    m_trunks = dynamic_cast<vpMbTrunkTracker *>(m_tracker.get());
  }

  FrameReport process(Frame &frame, const Pose &truth)
  {
    m_health.judge(frame);
    FrameReport report = reportOn(frame);
    const Pose wMb = frame.wMb_odometry ? predicted(*frame.wMb_odometry, truth) : m_estimate;
    m_estimate = wMb;
    bool is_tracked = false;
    if (frame.status == FrameStatus::ok)
      is_tracked = track(frame.image, wMb);
    if (frame.wMb_odometry)
      m_odometry = frame.wMb_odometry;
    m_sight.look(truth, m_estimate, is_tracked, report);
    return report;
  }

private:
  Pose predicted(const Pose &odometry, const Pose &truth) const
  {
    if (!m_odometry)
      return truth;
    const double turned = yawOf(m_estimate) - yawOf(*m_odometry);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(turned, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    Eigen::Vector3d t = m_estimate.t + turn * (odometry.t - m_odometry->t);
    t.z() = odometry.t.z();
    return {turn * odometry.R, t};
  }

  /// Whether the images say where the drone is: m_estimate.
  bool track(const vpImage<unsigned char> &image, const Pose &wMb)
  {
    const Silence silence;
    const vpHomogeneousMatrix cMw = (wMb * m_bMc).inverse().toVisp();
    try {
      if (!m_is_started)
        m_tracker->initFromPose(image, cMw);
      else if (!m_trunks)
        m_tracker->setPose(image, cMw);
      m_is_started = true;
      if (m_trunks)
        m_trunks->setMotionPrior(cMw, stepCovariance(wMb));
      m_tracker->track(image);
    }
    catch (const vpException &) {
      return false;
    }
    const Pose tracked = Pose::fromVisp(m_tracker->getPose());
    if (!tracked.isFinite())
      return false;
    m_estimate = tracked.inverse() * m_bMc.inverse();
    return true;
  }

  /// Of the camera's twist, by what the pose filter is off in a frame (SensorOptions, twice its noise).
  vpMatrix stepCovariance(const Pose &wMb) const
  {
    Matrix6d world = Matrix6d::Zero();
    world.diagonal() << Eigen::Vector3d(0.03, 0.03, 0.04).cwiseAbs2(), Eigen::Vector3d(0.008, 0.008, 0.01).cwiseAbs2();
    const Eigen::Matrix3d cRw = (wMb.R * m_bMc.R).transpose();
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = cRw;
    return toVisp(turn * world * turn.transpose());
  }

  FrameJudge m_health;
  TrueSight m_sight;
  Pose m_bMc;
  std::unique_ptr<vpMbTracker> m_tracker;
  vpMbTrunkTracker *m_trunks; ///< nullptr: ViSP's
  bool m_is_started = false;
  std::optional<Pose> m_odometry;
  Pose m_estimate;
};
} // namespace

const char *toString(PerceptionKind kind) { return nameOf(kind, {"truth", "truth-map", "visp-edges", "real"}); }

Perception realPerception(const PinholeCamera &camera, const Pose &bMc, const Options &options)
{
  const auto health = std::make_shared<FrameJudge>(camera, bMc);
  const auto pipeline = std::make_shared<Pipeline>(camera, bMc, options);
  return [health, pipeline](Frame &frame, const Pose &) {
    health->judge(frame);
    return pipeline->process(frame);
  };
}

Perception truthPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, double missing,
                           const std::vector<int> &asked_for)
{
  return [sight = TrueSight(camera, bMc, forest, missing, asked_for)](Frame &frame, const Pose &truth) mutable {
    FrameReport report = reportOn(frame);
    sight.look(truth, truth, true, report);
    return report;
  };
}

Perception truthMapPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, TrackerKind tracker)
{
  const auto perception = std::make_shared<TruthMapPerception>(camera, bMc, forest, tracker);
  return [perception](Frame &frame, const Pose &truth) { return perception->process(frame, truth); };
}
} // namespace bole
