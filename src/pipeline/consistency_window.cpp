// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/consistency_window.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr std::size_t kFrames = 24; ///< that are compared with a new one
constexpr double kMemory = 24;      ///< views after which the weight of a view is a third
constexpr double kShortMemory = 8;  ///< the same for borders: light and shade move over the bark on the way round
} // namespace

const ColumnImage *ConsistencyWindow::add(const vpImage<unsigned char> &image, std::size_t pose, const Viewpoint &at,
                                          double spacing, const ElevationRange &range)
{
  if (m_last && (at.wMc.t - *m_last).norm() < spacing)
    return nullptr;
  m_last = at.wMc.t;
  if (m_frames.size() == kFrames)
    m_frames.pop_front();
  m_frames.push_back({pose, at.time_s, computeColumnImage(image, at.camera, at.wMc.R, range)});
  return &m_frames.back().level;
}

std::optional<PhotoConsistency> ConsistencyWindow::update(int id, const Trunk &trunk,
                                                          const std::vector<ColumnView> &views, double farthest)
{
  Known &known = m_known[id];
  if (const auto seen = consistencyOfView(trunk, views.size() - 1, views, farthest)) {
    known.recent.fade(1 - 1 / kMemory);
    known.recent.add(*seen);
    known.last.fade(1 - 1 / kShortMemory);
    known.last.add(*seen);
    ++known.views;
  }
  return consistencyOf(known.recent);
}

bool ConsistencyWindow::mayRedetect(int id) const
{
  // re-detection compares all frames of the window: after each attempt it waits for twice as many new views, in the end
  // for a whole window
  constexpr int kViewsBetween = 6, kMostDoublings = 2; // kFrames at last
  const auto known = m_known.find(id);
  return known != m_known.end() && known->second.views >= kViewsBetween
                                                              << std::min(known->second.redetections, kMostDoublings);
}

std::optional<PhotoConsistency> ConsistencyWindow::borderConsistency(int id) const
{
  const auto known = m_known.find(id);
  return known == m_known.end() ? std::nullopt : consistencyOf(known->second.last);
}

void ConsistencyWindow::noteRedetection(int id)
{
  m_known[id].views = 0;
  ++m_known[id].redetections;
}
} // namespace bole
