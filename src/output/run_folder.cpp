// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/run_folder.h"

#include "geometry/failure.h"
#include "output/atomic_file.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"

#include <fcntl.h>
#include <filesystem>
#include <sys/file.h>
#include <unistd.h>

namespace bole
{
namespace fs = std::filesystem;

RunFolder::RunFolder(std::string path) : m_path(std::move(path))
{
  std::error_code error;
  fs::create_directories(m_path, error);
  if (error)
    throw ioError("{}: cannot be made: {}", m_path, error.message());
  m_lock = ::open(m_path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (m_lock < 0)
    throw ioError("{}: cannot be opened", m_path);
  if (::flock(m_lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(m_lock);
    throw ioError("{}: another run writes into this folder", m_path);
  }
  for (const auto &entry : fs::directory_iterator(m_path, error))
    if (AtomicFile::isTemporary(entry.path().filename().string()))
      fs::remove(entry.path(), error);
}

RunFolder::~RunFolder() { ::close(m_lock); }

void RunFolder::write(const MapPicture &picture, const RunSummary &summary, const Eigen::Vector2d &camera) const
{
  writeTrajectory(file("trajectory.tum"), picture.smoothed);
  writeTrajectory(file("trajectory_online.tum"), picture.online);
  const bool has_ranges = summary.reference.has_ranges;
  writeTrunks(file("trunks.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  writeHypotheses(file("hypotheses.csv"), has_ranges ? summary.trunks : std::vector<TrunkRecord>());
  if (has_ranges)
    fs::remove(file("bearings.csv"));
  else
    writeBearings(file("bearings.csv"), summary.trunks, camera);
  writeMap(file("map.svg"), picture);
  writeTiming(file("timing.csv"), summary.timing);
  writeAtomically(file("options.yaml"), summary.options);
  writeSummary(file("summary.json"), summary);
}
} // namespace bole
