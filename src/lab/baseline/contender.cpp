// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/contender.h"
#include "support/text.h"
#include "support/units.h"
#include <bole/vpMbTrunkTracker.h>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

namespace bole
{
namespace
{
Matrix6d toEigen(const vpMatrix &m) { return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(m.data); }
} // namespace

const char *toString(Help help) { return nameOf(help, {"alone", "prior", "re-initialised", "true pose"}); }

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

void Contender::start(const std::string &cao_path, const PinholeCamera &camera, const vpImage<unsigned char> &image,
                      const Pose &cMo)
{
  const Silence silence;
  cv::setNumThreads(1); // of ViSP's KLT: everybody has one thread
  m_tracker = makeTracker(m_kind, m_settings, cao_path, camera, m_trunk_xml);
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
  const Matrix6d covariance = flight.predictedCovariance(predicted, m_cMo, toEigen(m_trunk->getPoseCovariance()));
  m_trunk->setMotionPrior(predicted.toVisp(), toVisp(covariance));
}

Answer Contender::track(const TestFlight &flight, std::size_t k, const vpImage<unsigned char> &image)
{
  const Silence silence;
  const double begin_ms = processorTime_ms(CLOCK_THREAD_CPUTIME_ID);
  Answer answer;
  const Pose predicted = flight.predicted(k, m_cMo);
  try {
    giveHelp(flight, k, predicted, image);
    m_tracker->track(image);
  }
  catch (const std::exception &) { // vpException, and cv::Exception out of ViSP's KLT
    answer.complained = true;
  }
  answer.cMo = Pose::fromVisp(m_tracker->getPose());
  if (answer.complained && m_help == Help::reinitialised) {
    answer.reinitialised = true;
    try {
      m_tracker->initFromPose(image, predicted.toVisp());
    }
    catch (const std::exception &) {
      answer.reinitialised = false;
    }
    answer.cMo = predicted;
  }
  if (answer.complained && m_help == Help::prior && !m_trunk)
    answer.cMo = predicted;
  m_cMo = answer.cMo.isFinite() ? answer.cMo : predicted;
  answer.ms = processorTime_ms(CLOCK_THREAD_CPUTIME_ID) - begin_ms;
  return answer;
}
} // namespace bole
