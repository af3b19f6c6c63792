// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"
#include "support/text.h"
#include <bole/open_source.h>
#include <bole/output_folder.h>

#include <bole/trunk_record.h>

#include <algorithm>
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
/// \p image: a copy, since OpenCV takes pixels that may be written only.
template <class Pixel> void writePng(const std::string &path, vpImage<Pixel> image)
{
  if (!cv::imwrite(path, cv::Mat(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()),
                                 cv::DataType<Pixel>::type, image.bitmap)))
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

SequenceWriter::SequenceWriter(const std::string &folder, const CameraModel &camera, double rate_hz, bool overwrite)
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
  writeText("mav0/cam0/sensor.yaml", asl::sensorYaml({camera, forwardCamera()}, "simulated front camera", rate_hz));
  const auto begin = [this](std::ofstream &file, const char *name, const auto &head) {
    file.open(path(name));
    file << head;
  };
  begin(m_images, "mav0/cam0/data.csv", asl::kImagesHead);
  begin(m_imu, "mav0/imu0/data.csv", asl::kImuHead);
  begin(m_odometry, "mav0/odom0/data.csv", asl::kPosesHead);
  begin(m_truth, "mav0/state_groundtruth_estimate0/data.csv", asl::kPosesHead);
}

void SequenceWriter::writeFrame(std::int64_t stamp_ns, const RenderedFrame &frame, const Pose &wMb_truth,
                                const Pose &wMb_odometry)
{
  const std::string name = fmt::format("{:013d}.png", stamp_ns);
  m_images << stamp_ns << ',' << name << '\n';
  m_truth << asl::poseLine(stamp_ns, wMb_truth);
  m_odometry << asl::poseLine(stamp_ns, wMb_odometry);
  writePng(path("mav0/cam0/data/" + name), frame.image);
  if (frame.depth.getSize() == 0)
    return;
  fs::create_directories(path("depth"));
  fs::create_directories(path("trunk_id"));
  vpImage<std::uint16_t> depth = frame.depth;
  std::transform(depth.bitmap, depth.bitmap + depth.getSize(), depth.bitmap, rounded);
  writePng(path("depth/" + name), depth);
  writePng(path("trunk_id/" + name), frame.trunk_id);
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
