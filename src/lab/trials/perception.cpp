// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/perception.h"

#include "geometry/names.h"
#include "geometry/yaw.h"
#include "input/frame_health.h"
#include <bole/pipeline.h>
#include <bole/vpMbTrunkTracker.h>

#include <Eigen/Geometry>

#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
class RealPerception : public Perception
{
public:
  RealPerception(const PinholeCamera &camera, const Pose &bMc, const Options &options)
      : m_health(camera, bMc), m_pipeline(camera, bMc, options)
  {
  }
  FrameReport process(Frame &frame, const Pose &) override
  {
    m_health.judge(frame);
    return m_pipeline.process(frame);
  }

private:
  FrameHealth m_health;
  Pipeline m_pipeline;
};

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

class TruthPerception : public Perception
{
public:
  TruthPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, double missing)
      : m_sight(camera, bMc, forest, missing)
  {
  }
  FrameReport process(Frame &frame, const Pose &truth) override
  {
    FrameReport report = reportOn(frame);
    m_sight.look(truth, truth, true, report);
    return report;
  }

private:
  TrueSight m_sight;
};

/// Height, roll and pitch of a pose filter do not drift, so they are taken as they are; heading and place go on by its
/// steps from where the images put the drone last.
class TruthMapPerception : public Perception
{
public:
  TruthMapPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest)
      : m_health(camera, bMc), m_sight(camera, bMc, forest), m_camera(camera), m_bMc(bMc), m_forest(forest)
  {
    m_tracker.setCameraParameters(camera.toVisp());
    for (const SimulatedTrunk &trunk : forest.trunks) {
      const Trunk cylinder = trunk.cylinder();
      const auto point = [&](double h) {
        const Eigen::Vector3d p = cylinder.axisAt(trunk.foot.z() + h);
        vpPoint at;
        at.setWorldCoordinates(p.x(), p.y(), p.z());
        return at;
      };
      m_tracker.addTrunk(point(0.6), point(2), cylinder.radius());
    }
  }

  FrameReport process(Frame &frame, const Pose &truth) override
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
    const vpHomogeneousMatrix cMw = (wMb * m_bMc).inverse().toVisp();
    if (!m_is_started)
      m_tracker.initFromPose(image, cMw);
    m_is_started = true;
    m_tracker.setMotionPrior(cMw, stepCovariance(wMb));
    try {
      m_tracker.track(image);
    }
    catch (const vpException &) {
      return false;
    }
    vpHomogeneousMatrix tracked;
    m_tracker.getPose(tracked);
    m_estimate = Pose::fromVisp(tracked).inverse() * m_bMc.inverse();
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
    const Matrix6d camera = turn * world * turn.transpose();
    vpMatrix result(6, 6);
    for (unsigned i = 0; i < 6; ++i)
      for (unsigned k = 0; k < 6; ++k)
        result[i][k] = camera(i, k);
    return result;
  }

  FrameHealth m_health;
  TrueSight m_sight;
  PinholeCamera m_camera;
  Pose m_bMc;
  const Forest &m_forest;
  vpMbTrunkTracker m_tracker;
  bool m_is_started = false;
  std::optional<Pose> m_odometry;
  Pose m_estimate;
};
} // namespace

const char *toString(PerceptionKind kind) { return nameOf(kind, {"truth", "truth-map", "real"}); }

PerceptionKind perceptionFromString(const std::string &word)
{
  if (const auto kind = valueNamed(word, PerceptionKind::real))
    return *kind;
  throw vpException(vpException::badValue, "perception = %s, must be truth, truth-map or real", word.c_str());
}

std::unique_ptr<Perception> realPerception(const PinholeCamera &camera, const Pose &bMc, const Options &options)
{
  return std::make_unique<RealPerception>(camera, bMc, options);
}
std::unique_ptr<Perception> truthPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest,
                                            double missing)
{
  return std::make_unique<TruthPerception>(camera, bMc, forest, missing);
}
std::unique_ptr<Perception> truthMapPerception(const PinholeCamera &camera, const Pose &bMc, const Forest &forest)
{
  return std::make_unique<TruthMapPerception>(camera, bMc, forest);
}
} // namespace bole
