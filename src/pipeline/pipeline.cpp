// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/median.h"
#include "input/camera_plausibility.h"
#include "input/frame_check.h"
#include "pipeline/engine.h"

#include <algorithm>

namespace bole
{
namespace
{
/// Throws for a camera that cannot be one.
const PinholeCamera &plausible(const PinholeCamera &camera, const Pose &bMc)
{
  MountedCamera mounted;
  mounted.model.pinhole = camera;
  mounted.bMc = bMc;
  requirePlausible(mounted);
  return camera;
}
} // namespace

/// Measures the rate of the frames: what is counted in frames is set by it.
class Pipeline::Rate
{
public:
  Rate(const PinholeCamera &camera, const Pose &bMc, const Options &options)
      : m_camera(camera), m_bMc(bMc), m_options(options)
  {
  }

  /// \param frame that is yet to be processed
  /// \return whether the rate is known by now; an engine for it that has seen the frames before where the one at hand
  /// is for another rate.
  bool measure(const Frame &frame, std::unique_ptr<Engine> &engine)
  {
    constexpr std::size_t kIntervals = 4;
    constexpr double kMost_hz = 100, kAlike = 1.25; // of two rates: nothing that is counted changes much
    m_first.push_back(frame);
    if (m_first.size() <= kIntervals)
      return false;
    std::vector<double> intervals;
    for (std::size_t i = 1; i < m_first.size(); ++i)
      intervals.push_back(1e-9 * static_cast<double>(m_first[i].stamp_ns - m_first[i - 1].stamp_ns));
    const double usual = Options::kUsualRate_hz;
    m_options.camera.rate = std::min(kMost_hz, 1 / std::max(1e-3, medianOf(intervals)));
    if (m_options.camera.rate < kAlike * usual && usual < kAlike * m_options.camera.rate)
      return true;
    engine = std::make_unique<Engine>(m_camera, m_bMc, stageOptions(m_options, m_camera));
    m_first.pop_back();
    for (const Frame &before : m_first)
      engine->process(before);
    return true;
  }

private:
  PinholeCamera m_camera;
  Pose m_bMc;
  Options m_options;
  std::vector<Frame> m_first;
};

Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const Options &options)
    : Pipeline(camera, bMc, stageOptions(options, plausible(camera, bMc)))
{
  if (options.camera.rate == 0)
    m_rate = std::make_unique<Rate>(camera, bMc, options);
}

Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options)
    : m_camera(plausible(camera, bMc)), m_engine(std::make_unique<Engine>(camera, bMc, options))
{
}

Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline &&) noexcept = default;
Pipeline &Pipeline::operator=(Pipeline &&) noexcept = default;

FrameReport Pipeline::process(const Frame &frame)
{
  requireSound(frame, m_frames, m_last_stamp_ns);
  ++m_frames;
  m_last_stamp_ns = frame.stamp_ns;
  const int width = static_cast<int>(frame.image.getWidth()), height = static_cast<int>(frame.image.getHeight());
  if (frame.status != FrameStatus::ok || (width == m_camera.width && height == m_camera.height))
    return take(frame);
  Frame without = frame;
  judgePicture(without, m_camera.width, m_camera.height);
  return take(without);
}

FrameReport Pipeline::take(const Frame &frame)
{
  if (m_rate && m_rate->measure(frame, m_engine))
    m_rate.reset();
  return m_engine->process(frame);
}
void Pipeline::finish() { m_engine->finish(); }
FrameReport Pipeline::review(std::size_t index) const { return m_engine->review(index); }
std::vector<TrunkRecord> Pipeline::map() const { return m_engine->map(); }
WorldReference Pipeline::reference() const { return m_engine->reference(); }
Trajectory Pipeline::smoothedTrajectory() const { return m_engine->smoothedTrajectory(); }
Trajectory Pipeline::onlineTrajectory() const { return m_engine->onlineTrajectory(); }
Graph Pipeline::graph() const { return m_engine->graph(); }

std::vector<Decision> Pipeline::decisions() const
{
  std::vector<Decision> decisions;
  for (const ScoredHypothesis &scored : m_engine->scored()) {
    Decision decision{scored.trunk, {}, scored.log_odds};
    OddsTerms::Map(decision.terms.data()) = oddsTerms(scored.evidence, scored.online);
    decisions.push_back(decision);
  }
  return decisions;
}
} // namespace bole
