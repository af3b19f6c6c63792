// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/obstacles.h"

#include <algorithm>
#include <cmath>

#include "support/units.h"

namespace bole
{
namespace
{
constexpr double kMisread = 0.3;      ///< of the radius: a border read inside the bark, where light and shade meet
constexpr double kDoubted = -2;       ///< log odds below which a candidate is taken for nothing
constexpr double kSeenThrough = 4;    ///< KnownTrunk::seen_through from which nothing stands there
constexpr double kFlownThrough = 0.1; ///< of the drone from the bark: what stands there is none [m]
constexpr double kWidth = 0.15;       ///< of a column of points [m]
constexpr double kRemembered_s = 3;   ///< of what is out of view
constexpr int kSeen = 6;              ///< points in a column before it counts
constexpr double kUpright = 0.5;      ///< and their least extent in height [m]
constexpr double kPointRadius = 0.05; ///< of the bark round a point [m]
constexpr double kCell = 0.1;         ///< of the space seen [m]
constexpr double kGraze = 0.035;      ///< a ray farther from a cell's middle tells nothing of it [m]
constexpr int kRays = 4;              ///< through a cell before it counts as seen
constexpr double kSeenFor_s = 10;     ///< and how long it does
} // namespace

double Obstacle::clearance(const Eigen::Vector2d &p, double sigmas) const
{
  const Eigen::Vector2d away = p - xy;
  const double distance = away.norm();
  if (distance < 1e-9)
    return -radius;
  const Eigen::Vector2d u = away / distance;
  return distance - radius - sigmas * std::sqrt(std::max(0.0, u.dot(covariance * u)));
}

std::vector<Obstacle> obstacles(const FrameReport &report, double range, int observations)
{
  std::vector<Obstacle> near;
  for (const KnownTrunk &trunk : report.map) {
    const bool is_confirmed = trunk.status == TrunkStatus::confirmed;
    const bool counts = is_confirmed || (trunk.status == TrunkStatus::candidate && trunk.observations >= observations);
    if (!counts || trunk.seen_through > kSeenThrough || (!is_confirmed && trunk.log_odds < kDoubted))
      continue;
    const double radius = trunk.trunk.radius();
    const Eigen::Vector2d xy = trunk.trunk.axisAt(report.wMb.t.z()).head<2>(), w = xy - report.wMb.t.head<2>();
    const double d = w.norm();
    if (d > range || d < radius + kFlownThrough)
      continue;
    const double across = d * d * trunk.bearing_variance, along = d * d * trunk.log_radius_variance;
    const Eigen::Vector2d u = w / d, n(-u.y(), u.x());
    const double misread = kMisread * radius;
    near.push_back(
        {trunk.id, is_confirmed, xy, radius,
         across * n * n.transpose() + along * u * u.transpose() + misread * misread * Eigen::Matrix2d::Identity(),
         trunk.log_odds});
  }
  return near;
}

void NearPoints::see(const std::vector<Eigen::Vector3d> &points, const Pose &wMb, double time_s)
{
  constexpr double kLow = 0.8, kHigh = 0.8; // below and above the drone [m]
  for (auto column = m_columns.begin(); column != m_columns.end();)
    column = time_s - column->second.last_s > kRemembered_s ? m_columns.erase(column) : std::next(column);
  for (const Eigen::Vector3d &point : points) {
    if (point.z() < wMb.t.z() - kLow || point.z() > wMb.t.z() + kHigh)
      continue;
    Column &column =
        m_columns[{static_cast<int>(std::floor(point.x() / kWidth)), static_cast<int>(std::floor(point.y() / kWidth))}];
    column.sum += point.head<2>();
    ++column.count;
    column.low = std::min(column.low, point.z());
    column.high = std::max(column.high, point.z());
    column.last_s = time_s;
  }
}

void NearPoints::addTo(std::vector<Obstacle> &obstacles, const Pose &wMb, double range) const
{
  constexpr double kSure = 100; // log odds that something is there
  for (const auto &[place, column] : m_columns) {
    const Eigen::Vector2d xy = column.sum / column.count;
    if (column.count >= kSeen && column.high - column.low > kUpright && (xy - wMb.t.head<2>()).norm() < range)
      obstacles.push_back({-1, true, xy, kPointRadius, Eigen::Matrix2d::Zero(), kSure});
  }
}

namespace
{
std::int32_t cellNumber(double metres) { return static_cast<std::int32_t>(std::floor(metres / kCell)); }

std::size_t placeIn(std::int32_t side, std::int32_t x, std::int32_t y)
{
  const auto wrapped = [side](std::int32_t k) { return static_cast<std::size_t>((k % side + side) % side); };
  return wrapped(y) * static_cast<std::size_t>(side) + wrapped(x);
}
} // namespace

/// That of \p p, emptied where it was another's.
SeenSpace::Cell &SeenSpace::cellAt(const Eigen::Vector2d &p)
{
  const std::int32_t x = cellNumber(p.x()), y = cellNumber(p.y());
  Cell &cell = m_cells[placeIn(kSide, x, y)];
  if (cell.x != x || cell.y != y)
    cell = {x, y, 0, 0};
  return cell;
}

void SeenSpace::see(const std::vector<TriangulatedRay> &sights, const Eigen::Vector3d &from, double time_s)
{
  constexpr double kFar = 6;      // nothing beyond matters [m]
  constexpr double kHeight = 0.5; // of a ray above or below the camera [m]
  m_time_s = time_s;
  for (const TriangulatedRay &sight : sights) {
    const double level = sight.ray.head<2>().norm();
    const double surely_free = level / (std::max(sight.inverse_distance, 0.0) + 2 * sight.sigma) - kCell;
    const double end = std::min({surely_free, kFar, kHeight * level / std::max(std::abs(sight.ray.z()), 1e-6)});
    const Eigen::Vector2d along = sight.ray.head<2>() / level;
    for (double range = 0; range < end; range += 0.7 * kCell) {
      Cell &cell = cellAt(from.head<2>() + range * along);
      const Eigen::Vector2d w = kCell * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5) - from.head<2>();
      if (std::abs(w.x() * along.y() - w.y() * along.x()) > kGraze)
        continue;
      ++cell.rays;
      cell.last_s = time_s;
    }
  }
}

void SeenSpace::stand(const Eigen::Vector2d &p)
{
  constexpr int kBody = 3; // cells from its middle to its hull
  for (int dx = -kBody; dx <= kBody; ++dx)
    for (int dy = -kBody; dy <= kBody; ++dy) {
      Cell &cell = cellAt(p + kCell * Eigen::Vector2d(dx, dy));
      cell.rays = kRays;
      cell.last_s = m_time_s;
    }
  measureRoom(p);
}

bool SeenSpace::isSeen(std::int32_t x, std::int32_t y) const
{
  const Cell &cell = m_cells[placeIn(kSide, x, y)];
  return cell.x == x && cell.y == y && cell.rays >= kRays && m_time_s - cell.last_s < kSeenFor_s;
}

/// Distance to the nearest cell that was not seen: first along the rows, then over them.
void SeenSpace::measureRoom(const Eigen::Vector2d &p)
{
  constexpr int kMost = static_cast<int>(kMostRoom / kCell), kHalf = static_cast<int>(kRoomRange / kCell);
  constexpr int kCells = 2 * kHalf + 1;
  m_room_x = cellNumber(p.x()) - kHalf;
  m_room_y = cellNumber(p.y()) - kHalf;
  m_room.resize(kCells * kCells);
  std::vector<int> along(kCells * kCells);
  for (int row = 0; row < kCells; ++row) {
    int *const free = &along[static_cast<std::size_t>(row * kCells)];
    for (int k = 0; k < kCells; ++k)
      free[k] = isSeen(m_room_x + k, m_room_y + row) ? std::min(k > 0 ? free[k - 1] + 1 : 1, kMost) : 0;
    for (int k = kCells - 2; k >= 0; --k)
      free[k] = std::min(free[k], free[k + 1] + 1);
  }
  for (int row = 0; row < kCells; ++row)
    for (int k = 0; k < kCells; ++k) {
      int least = kMost * kMost;
      for (int dy = -kMost; dy <= kMost; ++dy) {
        const int other = row + dy,
                  free = other < 0 || other >= kCells ? 0 : along[static_cast<std::size_t>(other * kCells + k)];
        least = std::min(least, free * free + dy * dy);
      }
      m_room[static_cast<std::size_t>(row * kCells + k)] =
          static_cast<float>(kCell * std::max(0.0, std::sqrt(least) - 0.5));
    }
}

double SeenSpace::roomAt(const Eigen::Vector2d &p) const
{
  constexpr int kCells = 2 * static_cast<int>(kRoomRange / kCell) + 1;
  const int x = cellNumber(p.x()) - m_room_x, y = cellNumber(p.y()) - m_room_y;
  const bool is_near = !m_room.empty() && x >= 0 && x < kCells && y >= 0 && y < kCells;
  return is_near ? m_room[static_cast<std::size_t>(y * kCells + x)] : 0;
}

void Surroundings::see(const FrameReport &report)
{
  const double time_s = secondsOf(report.stamp_ns);
  m_near_points.see(placedPoints(report, kNearRange), report.wMb, time_s);
  m_seen.see(report.points, report.wMc.t, time_s);
  m_seen.stand(report.wMb.t.head<2>());
}

std::vector<Obstacle> Surroundings::surfaces(const FrameReport &report, double range, int observations) const
{
  std::vector<Obstacle> surfaces = obstacles(report, range, observations);
  m_near_points.addTo(surfaces, report.wMb, std::min(range, kNearRange));
  return surfaces;
}

Eigen::Vector2d safeVelocity(const Eigen::Vector2d &velocity, const Eigen::Vector2d &p, const Eigen::Vector2d &rest,
                             const std::vector<Obstacle> &surfaces, const Surroundings &around,
                             const SafetyOptions &options)
{
  constexpr double kLook = 0.1; // between the places asked [m]
  Eigen::Vector2d safe = velocity;
  for (const Obstacle &surface : surfaces) {
    const Eigen::Vector2d w = surface.xy - p;
    const double distance = w.norm();
    if (!surface.is_confirmed || surface.evidence < 0 || distance < 1e-6)
      continue;
    const Eigen::Vector2d u = w / distance;
    const double way = distance - surface.radius - options.hull - options.least_free - std::max(0.0, (rest - p).dot(u));
    safe -= std::max(0.0, safe.dot(u) - std::max(0.0, way / options.stopping_s)) * u;
  }
  const double speed = safe.norm();
  if (speed <= options.unseen_speed)
    return safe;
  const Eigen::Vector2d ahead = safe / speed;
  const double coast = std::max(0.0, (rest - p).dot(ahead)), wanted = coast + speed * options.stopping_s;
  double free = 0;
  while (free < wanted && around.roomAt(p + free * ahead) >= options.hull + options.least_free)
    free += kLook;
  return safe * (std::clamp((free - coast) / options.stopping_s, options.unseen_speed, speed) / speed);
}
} // namespace bole
