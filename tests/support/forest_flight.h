// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A rendered flight of the shared data, whole in memory, with its truth: for tests and benchmarks of one stage.

#include "input/recorded_source.h"
#include "motion/gyro.h"
#include <bole/camera.h>

#include <fmt/format.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace bole::support
{
struct ForestFlight
{
  PinholeCamera camera;
  Pose bMc;
  std::vector<vpImage<unsigned char>> images;
  std::vector<Pose> wMb_odometry, wMb_truth;
  std::vector<Eigen::Matrix3d> pRc_gyro; ///< from the frame before, integrated
  std::vector<vpImage<float>> depths_m;  ///< infinity where there is none

  std::size_t size() const { return images.size(); }
  Pose wMc_truth(std::size_t i) const { return wMb_truth[i] * bMc; }
  Pose wMc_odometry(std::size_t i) const { return wMb_odometry[i] * bMc; }
};

inline std::string folderOf(const std::string &name) { return std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name; }

inline bool hasFlight(const std::string &name) { return std::ifstream(folderOf(name) + "/mav0/cam0/data.csv").good(); }

/// The first \p count frames of a rendered flight.
inline ForestFlight readForestFlight(const std::string &name, std::size_t count)
{
  AslSource source(folderOf(name));
  ForestFlight flight;
  flight.camera = source.camera();
  flight.bMc = source.bMc();
  std::vector<GyroSample> gyro;
  std::int64_t before_ns = 0;
  for (Frame frame; flight.size() < count && source.next(frame); before_ns = frame.stamp_ns) {
    gyro.insert(gyro.end(), frame.gyro.begin(), frame.gyro.end());
    const Eigen::Matrix3d turn = flight.size() > 0 ? integrateGyro(gyro, before_ns, frame.stamp_ns).R
                                                   : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    flight.pRc_gyro.emplace_back(flight.bMc.R.transpose() * turn * flight.bMc.R);
    flight.images.push_back(frame.image);
    flight.wMb_odometry.push_back(frame.wMb_odometry.value());
    flight.wMb_truth.push_back(frame.wMb_truth.value());
    const cv::Mat depth =
        cv::imread(fmt::format("{}/depth/{:013}.png", folderOf(name), frame.stamp_ns), cv::IMREAD_UNCHANGED);
    vpImage<float> metres(static_cast<unsigned>(depth.rows), static_cast<unsigned>(depth.cols));
    for (unsigned i = 0; i < metres.getSize(); ++i) {
      const std::uint16_t mm = depth.ptr<std::uint16_t>()[i];
      metres.bitmap[i] = mm == 65535 ? std::numeric_limits<float>::infinity() : mm * 1e-3f;
    }
    flight.depths_m.push_back(metres);
  }
  return flight;
}
} // namespace bole::support
