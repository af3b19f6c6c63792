// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/engine.h"

namespace bole
{
Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const Options &options)
    : Pipeline(camera, bMc, stageOptions(options, camera))
{
}

Pipeline::Pipeline(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options)
    : m_engine(std::make_unique<Engine>(camera, bMc, options))
{
}

Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline &&) noexcept = default;
Pipeline &Pipeline::operator=(Pipeline &&) noexcept = default;

FrameReport Pipeline::process(const Frame &frame) { return m_engine->process(frame); }
void Pipeline::finish() { m_engine->finish(); }
std::vector<TrunkRecord> Pipeline::map() const { return m_engine->map(); }
WorldReference Pipeline::reference() const { return m_engine->reference(); }
Trajectory Pipeline::smoothedTrajectory() const { return m_engine->smoothedTrajectory(); }
Trajectory Pipeline::onlineTrajectory() const { return m_engine->onlineTrajectory(); }
Graph Pipeline::graph() const { return m_engine->graph(); }
} // namespace bole
