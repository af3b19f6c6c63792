// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Simulated flights past trunks, as factors alone: no image is drawn. Every measurement is the
/// truth plus noise of exactly the covariance it claims.

#include "geometry/so3.h"
#include <bole/smoother.h>

#include <cmath>
#include <random>
#include <utility>
#include <vector>

namespace bole::test
{
struct FlightOptions
{
  int poses = 100;
  int visible = 6;               ///< trunks seen at a time, at most
  double step = 0.1;             ///< [m] a frame
  double spacing = 2;            ///< [m] of path a new trunk
  int lap = 0;                   ///< poses a round, 0: straight ahead
  double sigma_position = 0.012; ///< [m] odometry
  double sigma_rotation = 0.001; ///< [rad] odometry
  double sigma_bearing = 0.003;  ///< [rad] of a view, also of its slope in the image
  double sigma_tip = 0.05;       ///< [rad] away from the camera
  double sigma_ratio = 0.05;     ///< of log s
  double sigma_log_radius = 0.3; ///< of the truth about the prior
  double sigma_lean = 0.02;
  double outliers = 0; ///< share of views of something else
  unsigned seed = 1;
};

/// The flight in the order of time: odometry[i] goes from pose i - 1 to pose i (0: unused).
struct Flight
{
  std::vector<Pose> truth;
  std::vector<Trunk> trunks;
  std::vector<Odometry> odometry;
  Matrix6d first_covariance;
  Pose first;
  std::vector<std::vector<std::pair<int, SummaryFactor>>> views; ///< (trunk, summary) of each pose
};

inline Pose poseOnPath(const FlightOptions &o, int i)
{
  Pose pose;
  if (o.lap > 0) {
    const double angle = 2 * M_PI * i / o.lap, radius = o.step * o.lap / (2 * M_PI);
    pose.t = Eigen::Vector3d(radius * std::sin(angle), radius * (1 - std::cos(angle)), 1.5);
    pose.R = expSo3(Eigen::Vector3d(0, 0, angle));
  }
  else {
    const double s = o.step * i;
    pose.t = Eigen::Vector3d(s, std::sin(0.3 * s), 1.5 + 0.1 * std::sin(0.5 * s));
    pose.R = expSo3(Eigen::Vector3d(0, 0, std::atan(0.3 * std::cos(0.3 * s)))) *
             expSo3(Eigen::Vector3d(0.05 * std::sin(s), 0.05 * std::cos(s), 0));
  }
  return pose;
}

inline std::vector<Trunk> trunksAlong(const FlightOptions &o, std::mt19937 &random)
{
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> aside(1.2, 4);
  const int path = o.lap > 0 ? std::min(o.lap, o.poses) : o.poses;
  const int count = static_cast<int>(path * o.step / o.spacing) + (o.lap > 0 ? 0 : o.visible);
  std::vector<Trunk> trunks;
  for (int j = 0; j < count; ++j) {
    const Pose beside = poseOnPath(o, static_cast<int>(j * o.spacing / o.step));
    const Eigen::Vector3d at = beside * Eigen::Vector3d(0, (j % 2 ? 1 : -1) * aside(random), 0);
    Trunk trunk;
    trunk.lean = Eigen::Vector2d(normal(random), normal(random)) * o.sigma_lean;
    trunk.xy = at.head<2>() - at.z() * trunk.lean;
    trunk.log_radius = std::log(0.15) + o.sigma_log_radius * normal(random);
    trunks.push_back(trunk);
  }
  return trunks;
}

/// The nearest trunks ahead: (distance, trunk), at most o.visible.
inline std::vector<std::pair<double, int>> trunksInSight(const FlightOptions &o, const Pose &wMb,
                                                         const std::vector<Trunk> &trunks, int pose)
{
  std::vector<std::pair<double, int>> seen;
  int from = 0, to = static_cast<int>(trunks.size());
  if (o.lap == 0) { // sorted along the path
    from = std::max(0, static_cast<int>(pose * o.step / o.spacing) - 2);
    to = std::min(to, from + 4 * o.visible);
  }
  for (int j = from; j < to; ++j) {
    const Eigen::Vector3d b = wMb.inverse() * trunks[j].axisAt(wMb.t.z());
    if (b.x() > 0.8 && std::abs(b.y()) < b.x() * 1.1)
      seen.emplace_back(b.head<2>().norm(), j);
  }
  std::sort(seen.begin(), seen.end());
  if (static_cast<int>(seen.size()) > o.visible)
    seen.resize(o.visible);
  return seen;
}

inline Flight simulateFlight(const FlightOptions &o)
{
  std::mt19937 random(o.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const Pose bMc = SmootherOptions::forwardCamera();
  Flight flight;
  flight.trunks = trunksAlong(o, random);
  flight.odometry.resize(o.poses);
  flight.views.resize(o.poses);
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(o.sigma_position), Eigen::Vector3d::Constant(o.sigma_rotation);
  const Vector4d view_sigma(o.sigma_bearing, o.sigma_tip, o.sigma_bearing, o.sigma_ratio);
  for (int i = 0; i < o.poses; ++i) {
    const Pose wMb = poseOnPath(o, i);
    flight.truth.push_back(wMb);
    if (i > 0) {
      Vector6d noise;
      for (int k = 0; k < 6; ++k)
        noise(k) = sigma(k) * normal(random);
      flight.odometry[i].aMb = (flight.truth[i - 1].inverse() * wMb).plus(noise);
      flight.odometry[i].covariance = sigma.cwiseAbs2().asDiagonal();
    }
    for (const auto &[distance, j] : trunksInSight(o, wMb, flight.trunks, i)) {
      Vector4d noise;
      for (int k = 0; k < 4; ++k)
        noise(k) = view_sigma(k) * normal(random);
      SummaryFactor summary;
      summary.optimum = relativeTrunk(wMb, bMc, flight.trunks[j]).plus(noise);
      if (uniform(random) < o.outliers)
        summary.optimum = summary.optimum.plus(Vector4d(0.05, 0, 0.3, 0.5));
      summary.F = view_sigma.cwiseAbs2().cwiseInverse().asDiagonal();
      flight.views[i].emplace_back(j, summary);
    }
  }
  Vector6d noise;
  const Vector6d first_sigma = Vector6d::Constant(1e-3);
  for (int k = 0; k < 6; ++k)
    noise(k) = first_sigma(k) * normal(random);
  flight.first_covariance = first_sigma.cwiseAbs2().asDiagonal();
  flight.first = flight.truth[0].plus(noise);
  return flight;
}

inline SmootherOptions smootherFor(const FlightOptions &o)
{
  SmootherOptions options;
  options.prior_log_radius_sigma = o.sigma_log_radius;
  options.prior_lean_sigma = o.sigma_lean;
  return options;
}

/// Feeds a flight to a smoother, frame by frame. trunk_id[j] is the smoother's id of trunk j, -1:
/// not yet seen.
struct Replay
{
  const Flight &flight;
  Smoother smoother;
  std::vector<int> trunk_id;
  int next = 0;

  Replay(const Flight &f, const SmootherOptions &options) : flight(f), smoother(options), trunk_id(f.trunks.size(), -1)
  {
  }

  /// Adds the next frame without solving.
  void add()
  {
    const int i = next++;
    const std::size_t pose = i == 0 ? smoother.addFirstPose(flight.first, flight.first_covariance)
                                    : smoother.addPose(flight.odometry[i].aMb, flight.odometry[i].covariance);
    const Pose wMc = smoother.pose(pose) * smoother.options().bMc;
    for (const auto &[j, summary] : flight.views[i]) {
      if (trunk_id[j] < 0)
        trunk_id[j] = static_cast<int>(
            smoother.addTrunk(trunkFromRelative(wMc, summary.optimum, smoother.options().prior_radius)));
      smoother.addObservation(pose, trunk_id[j], summary);
    }
  }
  UpdateResult step()
  {
    add();
    return smoother.update();
  }
  void run()
  {
    while (next < static_cast<int>(flight.truth.size()))
      step();
  }
};
} // namespace bole::test
