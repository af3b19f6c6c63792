// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"
#include "support/text.h"
#include <bole/open_source.h>
#include <bole/output_folder.h>

#include <bole/trunk_record.h>

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace fs = std::filesystem;

namespace bole
{
namespace
{
void writePng(const std::string &path, const cv::Mat &image)
{
  if (!cv::imwrite(path, image))
    throw ioError("{}: cannot write", path);
}

std::uint16_t rounded(std::uint16_t depth_mm)
{
  if (depth_mm == 65535)
    return depth_mm;
  const int step = depth_mm < 10000 ? 20 : 100;
  return static_cast<std::uint16_t>(std::min(65500, (depth_mm + step / 2) / step * step));
}

const FileNames kFiles = {"mav0/cam0/sensor.yaml",
                          "mav0/cam0/data.csv",
                          "mav0/cam0/data/*.png",
                          "mav0/imu0/data.csv",
                          "mav0/odom0/data.csv",
                          "mav0/state_groundtruth_estimate0/data.csv",
                          "trees.csv",
                          "trees_far.csv",
                          "scene.yaml",
                          "depth/*.png",
                          "trunk_id/*.png"};

/// Throws where \p folder is there and holds what a simulation does not write.
void requireOwn(const std::string &folder)
{
  const fs::file_status status = fs::symlink_status(folder);
  if (fs::exists(status) && !fs::is_directory(status))
    throw ioError("{}: is no folder, must not be lost", folder);
  if (const std::string foreign = fs::exists(status) ? firstForeign(folder, kFiles) : ""; !foreign.empty())
    throw ioError("{}/{}: was not written by a simulation, must not be lost: choose another folder", folder, foreign);
}
} // namespace

SequenceWriter::SequenceWriter(const std::string &folder, const CameraModel &camera, const Pose &bMc, double rate_hz,
                               bool overwrite)
    : m_folder(folder), m_partial(folder + ".partial"), m_overwrite(overwrite)
{
  if (folder.empty())
    throw badValue("output = '', must be the name of a folder");
  while (m_folder.size() > 1 && m_folder.back() == '/') {
    m_folder.pop_back();
    m_partial = m_folder + ".partial";
  }
  if (fs::exists(m_folder) && !overwrite)
    throw ioError("{}: exists already; --overwrite replaces it", m_folder);
  requireOwn(m_folder);
  requireOwn(m_partial);
  removeFiles(m_partial, kFiles);
  std::error_code error;
  for (const char *name : {"mav0/cam0/data", "mav0/imu0", "mav0/odom0", "mav0/state_groundtruth_estimate0"}) {
    fs::create_directories(path(name), error);
    if (error)
      throw ioError("{}: {}", path(name), error.message());
  }
  writeText("mav0/cam0/sensor.yaml", asl::sensorYaml({camera, bMc}, "simulated front camera", rate_hz));
  m_images.open(path("mav0/cam0/data.csv"));
  m_images << asl::kImagesHead;
  m_imu.open(path("mav0/imu0/data.csv"));
  m_imu << asl::kImuHead;
  m_odometry.open(path("mav0/odom0/data.csv"));
  m_odometry << asl::kPosesHead;
  m_truth.open(path("mav0/state_groundtruth_estimate0/data.csv"));
  m_truth << asl::kPosesHead;
}

void SequenceWriter::writeFrame(std::int64_t stamp_ns, const RenderedFrame &frame, const Pose &wMb_truth,
                                const Pose &wMb_odometry)
{
  const std::string name = fmt::format("{:013d}.png", stamp_ns);
  m_images << stamp_ns << ',' << name << '\n';
  m_truth << asl::poseLine(stamp_ns, wMb_truth);
  m_odometry << asl::poseLine(stamp_ns, wMb_odometry);
  vpImage<unsigned char> image = frame.image;
  writePng(path("mav0/cam0/data/" + name),
           cv::Mat(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()), CV_8U, image.bitmap));
  if (frame.depth.getSize() == 0)
    return;
  fs::create_directories(path("depth"));
  fs::create_directories(path("trunk_id"));
  const int height = static_cast<int>(frame.depth.getHeight()), width = static_cast<int>(frame.depth.getWidth());
  cv::Mat depth(height, width, CV_16U), trunk_id(height, width, CV_16U);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      depth.at<std::uint16_t>(row, column) = rounded(frame.depth[row][column]);
      trunk_id.at<std::uint16_t>(row, column) = frame.trunk_id[row][column];
    }
  }
  writePng(path("depth/" + name), depth);
  writePng(path("trunk_id/" + name), trunk_id);
}

void SequenceWriter::writeImu(const GyroSample &sample)
{
  m_imu << asl::imuLine(sample.stamp_ns, sample.rate, sample.force.value_or(Eigen::Vector3d::Zero()));
}

void SequenceWriter::writeForest(const Forest &forest)
{
  std::string near = "id,x [m],y [m],radius [m],lean [deg]\n", far = "id,x [m],y [m]\n";
  for (const SimulatedTrunk &trunk : forest.trunks) {
    const Eigen::Vector3d breast = trunk.axisAt(kBreastHeight); // where TruthTrunk is told
    near += fmt::format("{},{:.4f},{:.4f},{:.4f},{:.2f}\n", trunk.id, breast.x(), breast.y(), trunk.radius,
                        std::atan(trunk.lean.norm()) * 180 / M_PI);
  }
  for (const SimulatedTrunk &trunk : forest.far_trunks) {
    const Eigen::Vector3d breast = trunk.axisAt(kBreastHeight);
    far += fmt::format("{},{:.4f},{:.4f}\n", trunk.id, breast.x(), breast.y());
  }
  writeText("trees.csv", near);
  writeText("trees_far.csv", far);
}

void SequenceWriter::writeText(const std::string &name, const std::string &text)
{
  std::ofstream file(path(name));
  file << text;
  if (!file.flush())
    throw ioError("{}: cannot write", path(name));
}

void SequenceWriter::finish()
{
  for (std::ofstream *file : {&m_images, &m_imu, &m_odometry, &m_truth}) {
    file->close();
    if (file->fail())
      throw ioError("{}: cannot write", m_partial);
  }
  if (m_overwrite)
    removeFiles(m_folder, kFiles);
  fs::rename(m_partial, m_folder);
}
} // namespace bole
