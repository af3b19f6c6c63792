// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A rendered flight of the shared data, whole in memory, with its truth: for tests and benchmarks of one stage.

#include "geometry/so3.h"
#include <bole/camera.h>
#include <bole/pose.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole::support
{
struct ForestFlight
{
  PinholeCamera camera{200, 200, 159.5, 119.5, 320, 240};
  Pose bMc;
  std::vector<std::int64_t> stamps_ns;
  std::vector<vpImage<unsigned char>> images;
  std::vector<Pose> wMb_odometry, wMb_truth;
  std::vector<Eigen::Matrix3d> pRc_gyro; ///< from the frame before, integrated
  std::vector<vpImage<float>> depths_m;  ///< infinity where there is none

  std::size_t size() const { return images.size(); }
  Pose wMc_truth(std::size_t i) const { return wMb_truth[i] * bMc; }
  Pose wMc_odometry(std::size_t i) const { return wMb_odometry[i] * bMc; }
};

inline std::vector<std::vector<double>> readNumbers(const std::string &path)
{
  std::vector<std::vector<double>> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#')
      continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::vector<double> row;
    for (double value; words >> value;)
      row.push_back(value);
    rows.push_back(row);
  }
  return rows;
}

inline bool hasFlight(const std::string &name)
{
  return std::ifstream(std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name + "/mav0/cam0/data.csv").good();
}

/// Frames [first, last] of a rendered flight.
inline ForestFlight readForestFlight(const std::string &name, std::size_t first, std::size_t last)
{
  const std::string root = std::string(BOLE_SHARED_DATA_DIR) + "/rendered/" + name;
  ForestFlight flight;
  flight.bMc.R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const auto pose = [](const std::vector<double> &r) {
    return Pose::fromQuaternion(r[4], r[5], r[6], r[7], {r[1], r[2], r[3]});
  };
  const auto odometry = readNumbers(root + "/mav0/odom0/data.csv");
  const auto truth = readNumbers(root + "/mav0/state_groundtruth_estimate0/data.csv");
  const auto gyro = readNumbers(root + "/mav0/imu0/data.csv");
  std::size_t sample = 0;
  for (std::size_t i = first; i <= last && i < odometry.size(); ++i) {
    const auto stamp = static_cast<std::int64_t>(odometry[i][0]);
    const std::string file = std::to_string(stamp);
    const std::string png = "/" + std::string(13 - file.size(), '0') + file + ".png";
    const cv::Mat image = cv::imread(root + "/mav0/cam0/data" + png, cv::IMREAD_GRAYSCALE);
    const cv::Mat depth = cv::imread(root + "/depth" + png, cv::IMREAD_UNCHANGED);
    vpImage<unsigned char> grey(static_cast<unsigned>(image.rows), static_cast<unsigned>(image.cols));
    vpImage<float> metres(grey.getHeight(), grey.getWidth());
    for (int v = 0; v < image.rows; ++v)
      for (int u = 0; u < image.cols; ++u) {
        grey[v][u] = image.at<unsigned char>(v, u);
        const auto mm = depth.at<std::uint16_t>(v, u);
        metres[v][u] = mm == 65535 ? std::numeric_limits<float>::infinity() : mm * 1e-3f;
      }
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    const double from =
        flight.stamps_ns.empty() ? static_cast<double>(stamp) : static_cast<double>(flight.stamps_ns.back());
    for (; sample + 1 < gyro.size() && gyro[sample][0] < static_cast<double>(stamp); ++sample) {
      if (gyro[sample][0] < from)
        continue;
      const double dt = (gyro[sample + 1][0] - gyro[sample][0]) * 1e-9;
      const Eigen::Vector3d rate(0.5 * (gyro[sample][1] + gyro[sample + 1][1]),
                                 0.5 * (gyro[sample][2] + gyro[sample + 1][2]),
                                 0.5 * (gyro[sample][3] + gyro[sample + 1][3]));
      turn = turn * expSo3(rate * dt);
    }
    flight.pRc_gyro.push_back(flight.bMc.R.transpose() * turn * flight.bMc.R);
    flight.stamps_ns.push_back(stamp);
    flight.images.push_back(grey);
    flight.depths_m.push_back(metres);
    flight.wMb_odometry.push_back(pose(odometry[i]));
    flight.wMb_truth.push_back(pose(truth[i]));
  }
  return flight;
}
} // namespace bole::support
