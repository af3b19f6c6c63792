// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map as something to keep away from, and what must not be done near it.

#include <bole/report.h>

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace bole
{
/// A trunk at the height of the drone, with the covariance of its position *relative to the drone*: across the line of
/// sight from the predicted bearing, along it from the radius (range = radius over ratio, and the ratio is measured
/// well), plus, in both directions, the error of a border that was detected inside the bark.
/// The covariance in the world would include the drift of the drone, which moves drone and trunk alike.
struct Obstacle
{
  int id = 0;
  bool is_confirmed = false;
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();         ///< [m], world
  double radius = 0;                                    ///< [m]
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero(); ///< [m^2], world axes
  double evidence = 0;                                  ///< log odds to be a trunk (TrunkMap::evidence)

  /// Distance of \p p to the bark less \p sigmas standard deviations in that direction [m].
  double clearance(const Eigen::Vector2d &p, double sigmas) const;
};

/// Trunks of the map within \p range [m] of the drone that it must avoid: the confirmed ones, and hypotheses with at
/// least \p observations views, since an obstacle may be there that is no trunk. Left out are those whose log-odds are
/// below -2, those with triangulated points behind them, and those where the drone itself is.
std::vector<Obstacle> obstacles(const FrameReport &report, double range, int observations);

constexpr double kNearRange = 2.5; ///< points beyond this do not matter to a task yet [m]

/// Upright obstacles from triangulated points. They cover trunks that the map lacks or has in a wrong place. Points are
/// gathered in vertical columns; a column counts once it has enough points over enough height, and is forgotten after
/// some seconds.
class NearPoints
{
public:
  /// \p points of one frame, world [m]; those well below or above the drone at \p wMb are left out.
  void see(const std::vector<Eigen::Vector3d> &points, const Pose &wMb, double time_s);
  /// As obstacles without a radius to speak of, those within \p range [m] of \p wMb.
  void addTo(std::vector<Obstacle> &obstacles, const Pose &wMb, double range) const;

private:
  struct Column
  {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    int count = 0;
    double low = 1e9, high = -1e9; ///< [m]
    double last_s = 0;
  };
  std::map<std::pair<int, int>, Column> m_columns;
};

/// Free space: a grid of the cells that rays to triangulated points pass through. All other cells may be occupied: dark
/// bark has no corners and may show only one border, and outside the image nothing is observed. No ray
/// passes the middle of a cell that lies in bark, and a trunk as thick as two cells holds such a middle.
class SeenSpace
{
public:
  /// \p sights of one frame, from a camera at \p from (world, [m]): what they pass at about its height.
  void see(const std::vector<TriangulatedRay> &sights, const Eigen::Vector3d &from, double time_s);
  /// Where the drone is, nothing else stands.
  void stand(const Eigen::Vector2d &p);
  /// How far round \p p (world, [m]) all was seen through in the last seconds: a body of that radius fits there.
  /// 0 to kMostRoom, to half a cell of 0.1 m; 0 more than kRoomRange from where the drone stood last.
  double roomAt(const Eigen::Vector2d &p) const;

  static constexpr double kMostRoom = 1, kRoomRange = 4; ///< [m]

private:
  struct Cell
  {
    std::int32_t x = 0, y = 0;
    int rays = 0;
    double last_s = 0;
  };
  Cell &cellAt(const Eigen::Vector2d &p);
  bool isSeen(std::int32_t x, std::int32_t y) const;
  void measureRoom(const Eigen::Vector2d &p);

  static constexpr std::int32_t kSide = 128; ///< cells; the grid is a torus, so cells behind the drone are reused
  std::vector<Cell> m_cells = std::vector<Cell>(kSide * kSide);
  std::int32_t m_room_x = 0, m_room_y = 0; ///< first cell of those with a room
  std::vector<float> m_room;               ///< [m]
  double m_time_s = 0;
};

struct SafetyOptions
{
  int lost_frames = 5;       ///< frames without what the task hangs on before it hovers, 1 to 100
  int sure_frames = 3;       ///< frames with it before it goes on, 1 to 100
  int patience_frames = 40;  ///< good frames without it before it looks for another, 1 to 10000
  double hull = 0.28;        ///< radius of the drone [m], 0.05 to 2
  double least_free = 0.12;  ///< between hull and what is believed to be bark [m], 0 to 2: what the drone errs
  double stopping_s = 0.5;   ///< over which what is left of a way is flown [s], 0.1 to 5: a gain of 2/s, as hold's
  double unseen_speed = 0.5; ///< into what was not seen to be free [m/s], 0.02 to 3: a bump that breaks nothing
};

/// All that a task believes to stand round the drone, by the frames of a flight.
class Surroundings
{
public:
  void see(const FrameReport &report);
  /// Trunks of the map, candidates that have \p observations views among them, and what stands upright by the points,
  /// within \p range [m] of the drone.
  std::vector<Obstacle> surfaces(const FrameReport &report, double range, int observations) const;
  /// Round \p p (world), as far as it was seen to be free [m].
  double roomAt(const Eigen::Vector2d &p) const { return m_seen.roomAt(p); }

private:
  NearPoints m_near_points;
  SeenSpace m_seen;
};

/// \p velocity [m/s, world] at \p p, cut to what the laws allow a drone that would coast to \p rest:
/// - towards a believed surface (confirmed trunks that are rather trunks than none, upright points) no faster than lets
///   the drone stop least_free before it; nothing pushes back: what is no trunk must not drive the drone into one;
/// - no faster than lets it stop where its whole width, and least_free beside it, was seen to be free, or at
///   unseen_speed.
Eigen::Vector2d safeVelocity(const Eigen::Vector2d &velocity, const Eigen::Vector2d &p, const Eigen::Vector2d &rest,
                             const std::vector<Obstacle> &surfaces, const Surroundings &around,
                             const SafetyOptions &options);
} // namespace bole
