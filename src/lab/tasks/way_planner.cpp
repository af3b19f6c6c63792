// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/way_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

namespace bole
{
namespace
{
constexpr double kGrid = 0.2;    ///< [m]
constexpr double kBehind = 1;    ///< as far the field reaches behind the drone [m]
constexpr double kNearSight = 3; ///< what is farther will be seen before it is reached [m]
constexpr double kTouchPace =
    50; ///< through what the hull would touch: none flies there, who stands there leaves [s/m]
constexpr double kOtherMind = 1.5; ///< times another way than the last: more than a frame changes what was seen
constexpr double kSameWay = 0.4;   ///< places as near to the last way belong to it [m]
constexpr double kSlant = 0.35;    ///< sine of the largest angle between what is flown and the way: 20 degrees
constexpr double kAim = 0.8;       ///< as far ahead on the way the drone aims [m]
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Step
{
  int dx, dy;
};
/// A knight's steps too: ways may go in sixteen directions.
constexpr Step kSteps[] = {{1, 0}, {-1, 0}, {0, 1},  {0, -1},  {1, 1}, {1, -1}, {-1, 1}, {-1, -1},
                           {2, 1}, {2, -1}, {-2, 1}, {-2, -1}, {1, 2}, {1, -2}, {-1, 2}, {-1, -2}};

/// The field of speeds and of the time that is left from each place.
class Field
{
public:
  Field(const std::vector<Obstacle> &surfaces, const Eigen::Vector2d &from, const WayGoal &goal,
        const WayOptions &options, const Way &last, const RoomAt &room_at)
      : m_low(onGrid(from.x() - kBehind), onGrid(goal.y_low)),
        m_columns(std::max(2, static_cast<int>((goal.x_end - m_low.x()) / kGrid) + 1)),
        m_rows(static_cast<int>((goal.y_high - goal.y_low) / kGrid) + 1),
        m_clearance(size(), kInfinite),
        m_speed(size()),
        m_pace(size()),
        m_left(size(), kInfinite)
  {
    measure(surfaces, options);
    for (std::size_t k = 0; k < size(); ++k) {
      const Eigen::Vector2d p = place(k);
      const bool is_wall = goal.is_wall && goal.is_wall(p.x(), p.y());
      m_speed[k] = speedAt(m_clearance[k], options);
      if (room_at && (p - from).norm() < kNearSight) // what was not seen may be bark
        m_speed[k] = std::min(m_speed[k],
                              std::max(options.unseenSpeed(), speedAt(room_at(p.x(), p.y()) - options.hull, options)));
      const double lost = 1 + (goal.detour ? goal.detour(p.x(), p.y()) : 0);
      const double other = last.places.empty() || isOn(last, p) ? 1 : kOtherMind;
      m_pace[k] = is_wall ? kInfinite : lost * other * (m_speed[k] > 0 ? 1 / m_speed[k] : kTouchPace);
    }
    search();
  }

  std::size_t size() const { return static_cast<std::size_t>(m_columns) * static_cast<std::size_t>(m_rows); }
  Eigen::Vector2d place(std::size_t k) const
  {
    return m_low + kGrid * Eigen::Vector2d(static_cast<double>(k % static_cast<std::size_t>(m_columns)),
                                           static_cast<double>(k / static_cast<std::size_t>(m_columns)));
  }
  std::size_t nearest(const Eigen::Vector2d &p) const
  {
    const auto clamped = [](double v, int n) { return std::clamp(static_cast<int>(std::lround(v)), 0, n - 1); };
    return index(clamped((p.x() - m_low.x()) / kGrid, m_columns), clamped((p.y() - m_low.y()) / kGrid, m_rows));
  }
  double speed(std::size_t k) const { return m_speed[k]; }
  double clearance(std::size_t k) const { return m_clearance[k]; }
  /// The next place on the quickest way; \p k itself at the goal, or where no way leads there.
  std::size_t next(std::size_t k) const
  {
    std::size_t best = k;
    double least = kInfinite;
    forEachNeighbour(k, [&](std::size_t other, double length) {
      const double left = m_left[other] + between(k, other, length);
      if (left < least && m_left[other] < m_left[k]) {
        least = left;
        best = other;
      }
    });
    return best;
  }
  bool isGoal(std::size_t k) const
  {
    return static_cast<int>(k % static_cast<std::size_t>(m_columns)) == m_columns - 1;
  }

private:
  static double onGrid(double v) { return kGrid * std::floor(v / kGrid); }
  std::size_t index(int column, int row) const
  {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(m_columns) + static_cast<std::size_t>(column);
  }
  template <class Use> void forEachNeighbour(std::size_t k, Use use) const
  {
    const int column = static_cast<int>(k) % m_columns, row = static_cast<int>(k) / m_columns;
    for (const Step &step : kSteps) {
      const int x = column + step.dx, y = row + step.dy;
      if (x >= 0 && x < m_columns && y >= 0 && y < m_rows)
        use(index(x, y), kGrid * std::hypot(step.dx, step.dy));
    }
  }
  double between(std::size_t a, std::size_t b, double length) const { return 0.5 * length * (m_pace[a] + m_pace[b]); }

  /// Clearances beyond which the speed is the largest are not needed.
  void measure(const std::vector<Obstacle> &surfaces, const WayOptions &options)
  {
    for (const Obstacle &surface : surfaces) {
      const double reach = surface.radius + options.sigmas * std::sqrt(surface.covariance.trace()) + options.hull +
                           options.free + kSlant * options.speed * options.stopping_s;
      const auto cells = [&](double v, double low, int n) {
        return std::make_pair(std::max(0, static_cast<int>(std::ceil((v - reach - low) / kGrid))),
                              std::min(n - 1, static_cast<int>(std::floor((v + reach - low) / kGrid))));
      };
      const auto [left, right] = cells(surface.xy.x(), m_low.x(), m_columns);
      const auto [bottom, top] = cells(surface.xy.y(), m_low.y(), m_rows);
      for (int row = bottom; row <= top; ++row)
        for (int column = left; column <= right; ++column) {
          const std::size_t k = index(column, row);
          m_clearance[k] = std::min(m_clearance[k], surface.clearance(place(k), options.sigmas) - options.hull);
        }
    }
  }
  static double speedAt(double clearance, const WayOptions &options)
  {
    if (clearance <= 0)
      return 0;
    const double speed = (clearance - options.free) / (kSlant * options.stopping_s);
    return std::clamp(speed, std::min(0.1, options.speed), options.speed);
  }
  static bool isOn(const Way &way, const Eigen::Vector2d &p)
  {
    return std::any_of(way.places.begin(), way.places.end(),
                       [&](const Eigen::Vector2d &place) { return (place - p).squaredNorm() < kSameWay * kSameWay; });
  }
  void search()
  {
    using Entry = std::pair<double, std::size_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    for (int row = 0; row < m_rows; ++row) {
      const std::size_t k = index(m_columns - 1, row);
      if (!std::isfinite(m_pace[k]))
        continue;
      m_left[k] = 0;
      open.emplace(0, k);
    }
    while (!open.empty()) {
      const auto [left, k] = open.top();
      open.pop();
      if (left > m_left[k])
        continue;
      forEachNeighbour(k, [&, from = k, so_far = left](std::size_t other, double length) {
        const double there = so_far + between(from, other, length);
        if (there < m_left[other]) {
          m_left[other] = there;
          open.emplace(there, other);
        }
      });
    }
  }

  Eigen::Vector2d m_low;
  int m_columns, m_rows;
  std::vector<double> m_clearance, m_speed, m_pace, m_left; ///< [m], [m/s], [s/m], [s]
};
} // namespace

Eigen::Vector2d Way::lookedAt(const Eigen::Vector2d &from, double range) const
{
  for (const Eigen::Vector2d &place : places)
    if ((place - from).norm() > range)
      return place - from;
  return places.empty() ? ahead : Eigen::Vector2d(places.back() - from);
}

Way planWay(const std::vector<Obstacle> &surfaces, const Eigen::Vector2d &from, const WayGoal &goal,
            const WayOptions &options, const Way &last, const RoomAt &room_at)
{
  const Field field(surfaces, from, goal, options, last, room_at);
  Way way;
  way.clearance = kInfinite;
  std::size_t k = field.nearest(from);
  double flown = 0;
  way.speed = options.speed;
  Eigen::Vector2d aim = field.place(k), before = from;
  while (true) {
    const Eigen::Vector2d here = field.place(k);
    flown += (here - before).norm();
    before = here;
    way.places.push_back(here);
    if (flown <= kAim)
      aim = here;
    if (flown < kNearSight)
      way.clearance = std::min(way.clearance, field.clearance(k));
    if (field.isGoal(k))
      way.is_open = true;
    const std::size_t next = field.next(k);
    if (next == k)
      break;
    if (field.clearance(next) <= field.clearance(k)) // what leads away need not slow down
      way.speed = std::min(way.speed, field.speed(next) + std::max(0.0, flown - kGrid) / options.stopping_s);
    k = next;
  }
  if ((aim - from).norm() > 1e-6)
    way.ahead = (aim - from).normalized();
  return way;
}
} // namespace bole
