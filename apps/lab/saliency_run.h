// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Feeds a sequence to the saliency stage: gyro and odometry of a frame as priors of the camera's motion.

#include "geometry/so3.h"
#include "saliency/saliency.h"
#include <bole/open_source.h>

#include <optional>

namespace bole::apps
{
class SaliencyRun
{
public:
  SaliencyRun(FrameSource &source, const SaliencyOptions &options)
      : m_source(source), m_estimator(source.camera(), options)
  {
  }

  /// Reads on to the next frame that can be used; false at the end.
  bool next()
  {
    while (m_source.next(frame)) {
      if (frame.status != FrameStatus::ok) {
        m_estimator.reset();
        m_last_stamp_ns.reset();
        continue;
      }
      saliency = m_estimator.update(frame.image, gyro(), translation());
      m_last_stamp_ns = frame.stamp_ns;
      m_last_pose = frame.wMb_odometry;
      return true;
    }
    return false;
  }

  Frame frame;
  Saliency saliency;

private:
  static constexpr double kGyroSigma = 6e-4;         // [rad] a frame and axis
  static constexpr double kTranslationSigma = 0.017; // [m] a frame and axis: the difference of two poses good to 1.2 cm

  std::optional<RotationPrior> gyro() const
  {
    if (!m_last_stamp_ns || frame.gyro.empty())
      return std::nullopt;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    std::int64_t from = *m_last_stamp_ns;
    for (const GyroSample &sample : frame.gyro) {
      turn = turn * expSo3(sample.rate * (1e-9 * static_cast<double>(sample.stamp_ns - from)));
      from = sample.stamp_ns;
    }
    const Eigen::Matrix3d bRc = m_source.bMc().R;
    return RotationPrior{bRc.transpose() * turn * bRc, Eigen::Matrix3d::Identity() * kGyroSigma * kGyroSigma};
  }
  std::optional<TranslationPrior> translation() const
  {
    if (!m_last_stamp_ns || !m_last_pose || !frame.wMb_odometry)
      return std::nullopt;
    const Pose bMc = m_source.bMc();
    const Pose pMc = (*m_last_pose * bMc).inverse() * (*frame.wMb_odometry * bMc);
    return TranslationPrior{pMc.t, Eigen::Matrix3d::Identity() * kTranslationSigma * kTranslationSigma};
  }

  FrameSource &m_source;
  SaliencyEstimator m_estimator;
  std::optional<std::int64_t> m_last_stamp_ns;
  std::optional<Pose> m_last_pose;
};
} // namespace bole::apps
