// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/baseline/contender.h"
#include "geometry/names.h"
#include <bole/vpMbTrunkTracker.h>

#include <ctime>
#include <fmt/format.h>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <visp3/mbt/vpMbEdgeTracker.h>
#include <visp3/mbt/vpMbGenericTracker.h>

namespace bole
{
namespace
{
/// ViSP tells std::cout and std::cerr of every model and every setPose(); not while this lives.
class Silence
{
public:
  Silence() : m_out(std::cout.rdbuf(nullptr)), m_err(std::cerr.rdbuf(nullptr)) {}
  ~Silence()
  {
    std::cout.rdbuf(m_out); // also clears the state that writing to nothing has set
    std::cerr.rdbuf(m_err);
  }
  Silence(const Silence &) = delete;
  Silence &operator=(const Silence &) = delete;

private:
  std::streambuf *m_out, *m_err;
};

/// Time that this thread has computed: what other programs take from the processor does not count.
double threadTime_ms()
{
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * double(t.tv_sec) + 1e-6 * double(t.tv_nsec);
}
} // namespace

const char *toString(TrackerKind kind)
{
  return nameOf(kind,
                {"vpMbEdgeTracker", "vpMbGenericTracker EDGE", "vpMbGenericTracker EDGE+KLT", "vpMbTrunkTracker"});
}

const char *toString(Help help) { return nameOf(help, {"alone", "prior", "re-initialised", "true pose"}); }

std::string EdgeSettings::text() const
{
  return fmt::format("mask {}, range {}, threshold {:g}, step {:g}, far {:g} m", mask_size, range, threshold,
                     sample_step, far_m);
}

Contender::Contender(TrackerKind kind, Help help, const EdgeSettings &settings, const std::string &trunk_xml)
    : m_kind(kind), m_help(help), m_settings(settings), m_trunk_xml(trunk_xml)
{
}
Contender::~Contender() = default;
Contender::Contender(Contender &&) noexcept = default;

std::string Contender::name() const { return fmt::format("{}, {}", toString(m_kind), toString(m_help)); }

std::string Contender::settingsText() const
{
  if (m_kind != TrackerKind::trunk)
    return m_settings.text();
  return fmt::format("{}, far {:g} m", m_trunk_xml.empty() ? "defaults" : m_trunk_xml, m_settings.far_m);
}

std::unique_ptr<vpMbTracker> Contender::make(const std::string &cao_path, const PinholeCamera &camera) const
{
  vpMe me;
  me.setMaskSize(unsigned(m_settings.mask_size));
  me.setMaskNumber(180);
  me.setRange(unsigned(m_settings.range));
  me.setThreshold(m_settings.threshold);
  me.setMu1(0.5);
  me.setMu2(0.5);
  me.setSampleStep(m_settings.sample_step);
  std::unique_ptr<vpMbTracker> tracker;
  if (m_kind == TrackerKind::visp_edge) {
    auto edge = std::make_unique<vpMbEdgeTracker>();
    edge->setMovingEdge(me);
    tracker = std::move(edge);
  }
  else if (m_kind == TrackerKind::trunk) {
    tracker = std::make_unique<vpMbTrunkTracker>();
  }
  else {
    const bool klt = m_kind == TrackerKind::visp_generic_edge_klt;
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
  if (m_kind == TrackerKind::trunk && !m_trunk_xml.empty())
    tracker->loadConfigFile(m_trunk_xml, false);
  tracker->setCameraParameters(camera.toVisp());
  tracker->setAngleAppear(vpMath::rad(85));
  tracker->setAngleDisappear(vpMath::rad(89));
  tracker->setNearClippingDistance(0.1);
  tracker->setFarClippingDistance(m_settings.far_m);
  tracker->setClipping(tracker->getClipping() | vpPolygon3D::FOV_CLIPPING);
  tracker->loadModel(cao_path);
  return tracker;
}

void Contender::start(const std::string &cao_path, const PinholeCamera &camera, const vpImage<unsigned char> &image,
                      const Pose &cMo)
{
  const Silence silence;
  cv::setNumThreads(1); // of ViSP's KLT: everybody has one thread
  m_tracker = make(cao_path, camera);
  m_trunk = dynamic_cast<vpMbTrunkTracker *>(m_tracker.get());
  m_tracker->initFromPose(image, cMo.toVisp());
  m_cMo = cMo;
}

void Contender::giveHelp(const TestFlight &flight, std::size_t k, const Pose &predicted,
                         const vpImage<unsigned char> &image)
{
  if (m_help == Help::truth)
    m_tracker->setPose(image, flight.frames[k].cMo.toVisp());
  if (m_help != Help::prior)
    return;
  if (!m_trunk) {
    m_tracker->setPose(image, predicted.toVisp());
    return;
  }
  const vpMatrix before = m_trunk->getPoseCovariance();
  Matrix6d P;
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      P(int(i), int(j)) = before[i][j];
  const Matrix6d covariance = flight.predictedCovariance(predicted, m_cMo, P);
  vpMatrix Q(6, 6);
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      Q[i][j] = covariance(int(i), int(j));
  m_trunk->setMotionPrior(predicted.toVisp(), Q);
}

Answer Contender::track(const TestFlight &flight, std::size_t k, const vpImage<unsigned char> &image)
{
  const Silence silence;
  const double begin_ms = threadTime_ms();
  Answer answer;
  const Pose predicted = flight.predicted(k, m_cMo);
  try {
    giveHelp(flight, k, predicted, image);
    m_tracker->track(image);
  }
  catch (const std::exception &error) { // vpException, and cv::Exception out of ViSP's KLT
    answer.complained = true;
    answer.message = error.what();
  }
  answer.cMo = Pose::fromVisp(m_tracker->getPose());
  if (answer.complained && m_help == Help::reinitialised) {
    try {
      m_tracker->initFromPose(image, predicted.toVisp());
      answer.reinitialised = true;
    }
    catch (const std::exception &error) {
      answer.message += std::string("; ") + error.what();
    }
    answer.cMo = predicted;
  }
  if (answer.complained && m_help == Help::prior && !m_trunk)
    answer.cMo = predicted;
  m_cMo = answer.cMo.isFinite() ? answer.cMo : predicted;
  answer.ms = threadTime_ms() - begin_ms;
  return answer;
}
} // namespace bole
