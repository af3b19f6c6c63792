// SPDX-License-Identifier: GPL-2.0-or-later
#include "localiser.h"
#include "geometry/failure.h"

#include "mbt/cao_reader.h"
#include "output/trunks_csv.h"
#include <bole/cylinder.h>

#include <filesystem>

namespace bole::apps
{
namespace
{
constexpr double kMemory_s = 20;        ///< trunks seen within are asked: what is older has drifted against them
constexpr std::size_t kFramesApart = 5; ///< between two questions

Options optionsFor(const FrameSource &source, double camera_height)
{
  Options options;
  options.camera.compressed = source.isCompressed();
  options.camera.height = camera_height;
  options.stages.final_pass = false; // the map is asked in flight, and a live stream need not end
  return options;
}
} // namespace

std::vector<TrunkRecord> readKnownMap(const std::string &path)
{
  std::vector<TrunkRecord> map;
  if (std::filesystem::is_directory(path)) {
    for (const TrunkRecord &trunk : readTrunks(path + "/trunks.csv"))
      if (trunk.status == TrunkStatus::confirmed)
        map.push_back(trunk);
  }
  else {
    for (const Cylinder &cylinder : readTrunkModel(path)) {
      TrunkRecord trunk;
      trunk.id = static_cast<int>(map.size());
      trunk.xy = (0.5 * (cylinder.foot + cylinder.top)).head<2>();
      trunk.radius = cylinder.radius;
      trunk.covariance.setZero();
      map.push_back(trunk);
    }
  }
  if (map.size() < 3)
    throw badValue("{}: {} trunks, must be at least 3", path, map.size());
  return map;
}

Localiser::Localiser(std::vector<TrunkRecord> map, const FrameSource &source, double camera_height)
    : m_map(std::move(map)), m_pipeline(source.camera(), source.bMc(), optionsFor(source, camera_height))
{
}

void Localiser::ask()
{
  std::vector<TrunkRecord> recent;
  for (const TrunkRecord &trunk : m_pipeline.map())
    if (trunk.status == TrunkStatus::confirmed && m_now_s - *m_first_s - trunk.last_seen_s < kMemory_s)
      recent.push_back(trunk);
  if (const auto found = placeOnMap(recent, m_map))
    m_placement = found;
}

FrameReport Localiser::process(const Frame &frame)
{
  FrameReport report = m_pipeline.process(frame);
  m_now_s = 1e-9 * static_cast<double>(frame.stamp_ns);
  m_first_s = m_first_s.value_or(m_now_s);
  if (++m_frames % kFramesApart == 0) {
    ask();
    if (m_placement && !m_placed_s)
      m_placed_s = m_now_s - *m_first_s;
  }
  return report;
}

void Localiser::finish()
{
  m_pipeline.finish();
  if (m_first_s)
    ask();
  if (m_placement && !m_placed_s)
    m_placed_s = m_now_s - *m_first_s;
}

Pose Localiser::onMap(const Pose &wMb) const
{
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(m_placement->yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return Pose(turn * wMb.R, turn * wMb.t + Eigen::Vector3d(m_placement->t.x(), m_placement->t.y(), 0));
}

Trajectory Localiser::smoothedOnMap() const
{
  Trajectory trajectory = m_pipeline.smoothedTrajectory();
  for (StampedPose &pose : trajectory)
    pose.wMb = onMap(pose.wMb);
  return trajectory;
}
} // namespace bole::apps
