// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/recent_columns.h"

#include <algorithm>

namespace bole
{
namespace
{
constexpr std::size_t kFrames = 24; ///< that are compared with a new one
constexpr double kMemory = 24;      ///< views in which what was seen fades to a third
constexpr double kShortMemory = 8;  ///< of the borders: on the way round, light and shade walk over the bark
} // namespace

const LevelImage *RecentColumns::add(const vpImage<unsigned char> &image, std::size_t pose, const Viewpoint &at,
                                     double spacing, const ElevationRange &range)
{
  if (m_last && (at.wMc.t - *m_last).norm() < spacing)
    return nullptr;
  m_last = at.wMc.t;
  if (m_frames.size() == kFrames)
    m_frames.pop_front();
  m_frames.push_back({pose, at.time_s, computeLevelImage(image, at.camera, at.wMc.R, range)});
  return &m_frames.back().level;
}

std::optional<ColumnEvidence> RecentColumns::look(int id, const Trunk &trunk, const std::vector<LevelView> &views,
                                                  double farthest)
{
  Known &known = m_known[id];
  if (const auto seen = columnsOfView(trunk, views.size() - 1, views, farthest)) {
    known.recent.fade(1 - 1 / kMemory);
    known.recent.add(*seen);
    known.last.fade(1 - 1 / kShortMemory);
    known.last.add(*seen);
    ++known.views;
  }
  return evidenceOf(known.recent);
}

bool RecentColumns::mayReadAgain(int id) const
{
  // another reading asks for all that was seen: one that was in vain has to wait until more of that is new, in the end
  // all of it
  constexpr int kViewsBetween = 6, kMostDoublings = 2; // kFrames at last
  const auto known = m_known.find(id);
  return known != m_known.end() && known->second.views >= kViewsBetween
                                                              << std::min(known->second.readings, kMostDoublings);
}

std::optional<ColumnEvidence> RecentColumns::lately(int id) const
{
  const auto known = m_known.find(id);
  return known == m_known.end() ? std::nullopt : evidenceOf(known->second.last);
}

void RecentColumns::noteReading(int id)
{
  m_known[id].views = 0;
  ++m_known[id].readings;
}
} // namespace bole
