// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A small ASL folder on disk that tests may damage.

#include "support/files.h"

#include <bole/frame.h>

#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

namespace bole::test
{
/// 64x48 images at 10 Hz, gyro at 100 Hz, odometry that moves 0.1 m a frame along x. Removed at the end.
class FlightFolder : public TemporaryFolder
{
public:
  explicit FlightFolder(std::size_t frames)
  {
    std::filesystem::create_directories(path() + "/mav0/cam0/data");
    std::string images = "#timestamp [ns],filename\n", poses = "#timestamp [ns],x,y,z,qw,qx,qy,qz\n",
                rates = "#timestamp [ns],x,y,z,ax,ay,az\n";
    for (std::size_t i = 0; i < frames; ++i) {
      images += fmt::format("{},{}\n", i * 100000000, imageName(i));
      poses += fmt::format("{},{},0,1,1,0,0,0\n", i * 100000000, 0.1 * static_cast<double>(i));
      writeImage(i, 64, 48);
    }
    for (std::size_t i = 0; i <= 10 * frames; ++i)
      rates += fmt::format("{},0,0,0.1,0,0,9.81\n", i * 10000000);
    write("mav0/cam0/data.csv", images);
    write("mav0/cam0/sensor.yaml", "resolution: [64, 48]\nintrinsics: [50, 50, 31.5, 23.5]\n");
    write("mav0/odom0/data.csv", poses);
    write("mav0/imu0/data.csv", rates);
  }
  static std::string imageName(std::size_t i) { return fmt::format("{:04d}.png", i); }
  std::string imagePath(std::size_t i) const { return path() + "/mav0/cam0/data/" + imageName(i); }
  static unsigned char pixel(std::size_t frame, int row, int column)
  {
    const double f = static_cast<double>(frame);
    return static_cast<unsigned char>(128 + 40 * std::sin(0.31 * column + 0.2 * f) +
                                      40 * std::sin(0.23 * row + 0.11 * column + 0.1 * f) +
                                      30 * std::sin(0.47 * column - 0.19 * row + 0.25 * f));
  }

  void writeImage(std::size_t i, int width, int height) const
  {
    cv::Mat image(height, width, CV_8UC1);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u)
        image.at<unsigned char>(v, u) = pixel(i, v, u);
    cv::imwrite(imagePath(i), image);
  }
  void removeImage(std::size_t i) const { std::filesystem::remove(imagePath(i)); }
  void truncateImage(std::size_t i, std::size_t size) const { std::filesystem::resize_file(imagePath(i), size); }
  void copyImage(std::size_t from, std::size_t to) const
  {
    std::filesystem::copy_file(imagePath(from), imagePath(to), std::filesystem::copy_options::overwrite_existing);
  }
  void flipByte(std::size_t i, std::size_t at) const
  {
    std::fstream file(imagePath(i), std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(static_cast<std::streamoff>(at));
    const char byte = static_cast<char>(file.get());
    file.seekp(static_cast<std::streamoff>(at));
    file.put(static_cast<char>(byte ^ 0x55));
  }
};

inline std::vector<Frame> readAll(FrameSource &source)
{
  std::vector<Frame> frames;
  for (Frame frame; source.next(frame);)
    frames.push_back(frame);
  return frames;
}
} // namespace bole::test
