// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/model_tracker.h"

#include "support/text.h"
#include <bole/vpMbTrunkTracker.h>

#include <fmt/format.h>
#include <iostream>
#include <visp3/mbt/vpMbEdgeTracker.h>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace bole
{
Silence::Silence() : m_out(std::cout.rdbuf(nullptr)), m_err(std::cerr.rdbuf(nullptr)) {}
Silence::~Silence()
{
  std::cout.rdbuf(m_out); // also clears the state that writing to nothing has set
  std::cerr.rdbuf(m_err);
}

vpMatrix toVisp(const Matrix6d &covariance)
{
  vpMatrix m(6, 6);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(m.data) = covariance;
  return m;
}

const char *toString(TrackerKind kind)
{
  return nameOf(kind,
                {"vpMbEdgeTracker", "vpMbGenericTracker EDGE", "vpMbGenericTracker EDGE+KLT", "vpMbTrunkTracker"});
}

std::string EdgeSettings::text() const
{
  return fmt::format("mask {}, range {}, threshold {:g}, step {:g}, far {:g} m", mask_size, range, threshold,
                     sample_step, far_m);
}

std::unique_ptr<vpMbTracker> makeTracker(TrackerKind kind, const EdgeSettings &settings, const std::string &cao_path,
                                         const PinholeCamera &camera, const std::string &trunk_xml)
{
  vpMe me;
  me.setMaskSize(unsigned(settings.mask_size));
  me.setMaskNumber(180);
  me.setRange(unsigned(settings.range));
  me.setThreshold(settings.threshold);
  me.setMu1(0.5);
  me.setMu2(0.5);
  me.setSampleStep(settings.sample_step);
  std::unique_ptr<vpMbTracker> tracker;
  if (kind == TrackerKind::visp_edge) {
    auto edge = std::make_unique<vpMbEdgeTracker>();
    edge->setMovingEdge(me);
    tracker = std::move(edge);
  }
  else if (kind == TrackerKind::trunk) {
    tracker = std::make_unique<vpMbTrunkTracker>();
  }
  else {
    const bool klt = kind == TrackerKind::visp_generic_edge_klt;
    auto generic = std::make_unique<vpMbGenericTracker>(
        1, klt ? vpMbGenericTracker::EDGE_TRACKER | vpMbGenericTracker::KLT_TRACKER : vpMbGenericTracker::EDGE_TRACKER);
    generic->setMovingEdge(me);
    if (klt) {
      vpKltOpencv points;
      points.setMaxFeatures(300);
      points.setWindowSize(5);
      points.setQuality(0.01);
      points.setMinDistance(5);
      points.setHarrisFreeParameter(0.01);
      points.setBlockSize(3);
      points.setPyramidLevels(3);
      generic->setKltOpencv(points);
      generic->setKltMaskBorder(3);
    }
    tracker = std::move(generic);
  }
  if (kind == TrackerKind::trunk && !trunk_xml.empty())
    tracker->loadConfigFile(trunk_xml, false);
  tracker->setCameraParameters(camera.toVisp());
  tracker->setAngleAppear(vpMath::rad(85));
  tracker->setAngleDisappear(vpMath::rad(89));
  tracker->setNearClippingDistance(0.1);
  tracker->setFarClippingDistance(settings.far_m);
  tracker->setClipping(tracker->getClipping() | vpPolygon3D::FOV_CLIPPING);
  tracker->loadModel(cao_path);
  return tracker;
}
} // namespace bole
