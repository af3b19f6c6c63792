// SPDX-License-Identifier: GPL-2.0-or-later
/// \file
/// What the point stage measures on the rendered flights, and what it costs in one thread: the tables of
/// src/doc/points.md.

#include "geometry/median.h"
#include "input/recorded_source.h"
#include "motion/point_motion.h"
#include "motion/point_odometry.h"
#include "motion/vertical.h"

#include <Eigen/Dense>
#include <fmt/format.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace
{
using namespace bole;

constexpr double kDegrees = 180 / M_PI;

/// Time of this thread alone [ms]: other work of the machine does not count.
double threadTime()
{
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * double(now.tv_sec) + 1e-6 * double(now.tv_nsec);
}

double mean(const std::vector<double> &values)
{
  double sum = 0;
  for (double value : values)
    sum += value;
  return sum / double(values.size());
}

struct Flight
{
  std::string name;
  PinholeCamera camera;
  Pose bMc;
  std::vector<Frame> frames;
};

Flight readFlight(const std::string &name)
{
  AslSource source(std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name);
  Flight flight{name, source.camera(), source.bMc(), {}};
  for (Frame frame; source.next(frame);)
    flight.frames.push_back(frame);
  return flight;
}

struct Errors
{
  std::vector<double> direction, direction_odometry, rotation, rotation_gyro, nees_rotation, nees_direction;
};

void compareRelativePoses(const Flight &flight, bool gyro)
{
  PointMotion motion(flight.camera, flight.bMc);
  std::map<int, Errors> errors;
  double time = 0;
  for (Frame frame : flight.frames) {
    if (!gyro)
      frame.gyro.clear();
    const double before = threadTime();
    const auto steps = motion.process(frame);
    motion.learn(steps);
    time += threadTime() - before;
    for (const RelativeMotion &step : steps) {
      const auto cameraAt = [&](std::size_t index) { return *flight.frames[index].wMb_truth * flight.bMc; };
      const Pose aMb = cameraAt(step.a_index).inverse() * cameraAt(step.b_index);
      Errors &e = errors[step.frames_back];
      const Eigen::Vector3d phi = logSo3(step.estimate.aRb.transpose() * aMb.R);
      const Eigen::Vector2d tau = directionMinus(aMb.t.normalized(), step.estimate.direction);
      if (step.gyro) {
        const Eigen::Matrix3d cRc = flight.bMc.R.transpose() * step.gyro->R * flight.bMc.R;
        e.rotation_gyro.push_back(logSo3(cRc.transpose() * aMb.R).norm() * kDegrees);
      }
      const auto filterAt = [&](std::size_t index) { return *flight.frames[index].wMb_odometry * flight.bMc; };
      const Eigen::Vector3d by_filter = (filterAt(step.a_index).inverse() * filterAt(step.b_index)).t;
      e.direction_odometry.push_back(directionMinus(aMb.t.normalized(), by_filter.normalized()).norm() * kDegrees);
      if (step.estimate.hasDirection()) {
        e.rotation.push_back(phi.norm() * kDegrees);
        e.direction.push_back(tau.norm() * kDegrees);
        const Matrix5d &S = step.estimate.covariance;
        e.nees_rotation.push_back(phi.dot(S.topLeftCorner<3, 3>().inverse() * phi) / 3);
        e.nees_direction.push_back(tau.dot(S.bottomRightCorner<2, 2>().inverse() * tau) / 2);
      }
    }
  }
  for (const auto &[back, e] : errors) {
    fmt::print("{:13} {:4} {:2} | {:6.2f} -> {:5.2f} deg | {:.4f} -> {:.4f} deg | {:5.2f} "
               "({:4.2f}) {:6.2f} ({:4.2f}) | "
               "{:3}/{:3} | {:4.2f} ms\n",
               flight.name, gyro ? "gyro" : "-", back, medianOf(e.direction_odometry), medianOf(e.direction),
               medianOf(e.rotation_gyro), medianOf(e.rotation), mean(e.nees_rotation), medianOf(e.nees_rotation),
               mean(e.nees_direction), medianOf(e.nees_direction), e.direction.size(),
               flight.frames.size() - static_cast<std::size_t>(back), time / double(flight.frames.size()));
  }
}

/// The cost of points alone.
void printCosts(const Flight &flight)
{
  PointTracker tracker(flight.camera);
  PointOdometry odometry(flight.camera);
  VerticalFilter vertical;
  double track_ms = 0, place_ms = 0, vertical_ms = 0;
  for (const Frame &frame : flight.frames) {
    const double t0 = threadTime();
    tracker.track(frame.image);
    const double t1 = threadTime();
    const auto placed = odometry.process(tracker);
    const double t2 = threadTime();
    vertical.add(placed.wMc.R, VerticalFinder().find(frame.image, flight.camera, placed.wMc.R, std::nullopt));
    track_ms += t1 - t0;
    place_ms += t2 - t1;
    vertical_ms += threadTime() - t2;
  }
  const double n = double(flight.frames.size());
  fmt::print("{:13} | {:.2f} + {:.2f} + {:.2f} ms\n", flight.name, track_ms / n, place_ms / n, vertical_ms / n);
}
} // namespace

int main()
{
  cv::setNumThreads(1);
  if (!std::filesystem::exists(std::string(BOLE_SHARED_DATA_DIR) + "/rendered")) {
    fmt::print("skipped: {}/rendered is absent\n", BOLE_SHARED_DATA_DIR);
    return 0;
  }
  std::vector<Flight> flights;
  for (const char *name : {"park-forward", "winter-weave", "pine-arc"})
    flights.push_back(readFlight(name));
  fmt::print("flight, prior, frames apart | direction, pose filter -> points (median) | rotation, "
             "gyro -> points | "
             "NEES a degree of freedom, rotation and direction: mean (median) | with direction | "
             "cost of both distances\n");
  for (const bool gyro : {true, false}) {
    for (const Flight &flight : flights)
      compareRelativePoses(flight, gyro);
  }
  fmt::print("\nflight | tracker + placing + vertical\n");
  for (const Flight &flight : flights)
    printCosts(flight);
  return 0;
}
