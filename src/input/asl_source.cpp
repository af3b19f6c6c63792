// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "geometry/median.h"
#include "geometry/so3.h"
#include "input/csv_reader.h"
#include "input/recorded_source.h"
#include "input/yaml_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>

namespace bole
{
namespace fs = std::filesystem;
namespace
{
fs::path sensorRoot(const std::string &folder)
{
  const fs::path path(folder);
  return fs::is_directory(path / "mav0") ? path / "mav0" : path;
}

std::vector<ImageRow> readImageRows(const fs::path &cam0)
{
  std::vector<ImageRow> rows;
  const std::string path = (cam0 / "data.csv").string();
  CsvReader csv(path, {2});
  while (csv.next()) {
    const std::int64_t stamp_ns = csv.risingStampNs(0);
    const fs::path name = csv.text(1);
    if (name.empty() || name.is_absolute() || std::find(name.begin(), name.end(), "..") != name.end())
      csv.fail(fmt::format("filename = \"{}\", must be that of an image in the folder data", name.string()));
    rows.push_back({stamp_ns, (cam0 / "data" / name).string()});
  }
  if (rows.empty())
    throw ioError("{}: no image in it", path);
  constexpr std::int64_t kFastest_ns = 1'000'000; // 1000 images a second
  if (rows.size() > 2 &&
      (rows.back().stamp_ns - rows.front().stamp_ns) / static_cast<std::int64_t>(rows.size() - 1) < kFastest_ns)
    throw badValue("{}: more than 1000 images a second: stamps must be in nanoseconds", path);
  return rows;
}

/// Throws for rates and stamps in other units than rad/s and ns.
void requirePlausible(const std::vector<GyroSample> &gyro, const std::string &path)
{
  constexpr double kFastest_rad_s = 35; // 2000 degrees a second, the range of the gyros that small drones carry
  constexpr double kSlowest_Hz = 5, kFastest_Hz = 20000;
  if (gyro.empty())
    throw ioError("{}: no sample in it (without a gyro the folder imu0 must not be there)", path);
  std::vector<double> rates;
  for (const GyroSample &sample : gyro)
    rates.push_back(sample.rate.norm());
  const double rate = quantileOf(std::move(rates), 0.75);
  if (rate > kFastest_rad_s)
    throw badValue("{}: angular rate = {:.3g} rad/s (upper quartile), must be at most {:g}: looks like degrees per "
                   "second",
                   path, rate, kFastest_rad_s);
  if (gyro.size() < 10)
    return;
  const double rate_Hz =
      1e9 * static_cast<double>(gyro.size() - 1) / static_cast<double>(gyro.back().stamp_ns - gyro.front().stamp_ns);
  if (rate_Hz < kSlowest_Hz || rate_Hz > kFastest_Hz)
    throw badValue("{}: {:.3g} samples a second, must be {:g} to {:g}: stamps must be in nanoseconds", path, rate_Hz,
                   kSlowest_Hz, kFastest_Hz);
}

/// Throws for an accelerometer that does not feel gravity. Columns of zeros are taken for none.
void requireGravity(std::vector<GyroSample> &gyro, const std::string &path)
{
  constexpr double kLeast = 4, kMost = 25;        // m/s^2, median of a flight: it hovers or swings, and shakes
  constexpr double kLeast_g = 0.7, kMost_g = 1.4; // the same where the unit is g
  constexpr std::size_t kFewest = 10;             // samples that make a median
  std::vector<double> norms;
  for (const GyroSample &sample : gyro)
    if (sample.force)
      norms.push_back(sample.force->norm());
  if (norms.size() < kFewest)
    return;
  const double median = medianOf(std::move(norms));
  if (median == 0)
    for (GyroSample &sample : gyro)
      sample.force.reset();
  else if (median < kLeast || median > kMost)
    throw badValue("{}: specific force = {:.3g} m/s^2 (median), must be {:g} to {:g}{}", path, median, kLeast, kMost,
                   median > kLeast_g && median < kMost_g               ? ": looks like g"
                   : median > 1e3 * kLeast_g && median < 1e3 * kMost_g ? ": looks like thousandths of g"
                   : median < kLeast_g ? ": looks as if gravity were taken out (leave the columns away)"
                                       : "");
}

/// Throws where the gyro turns some sixty times as far as the odometry, and as it does: degrees per second.
void requireSameTurns(const std::vector<GyroSample> &gyro, const Trajectory &odometry, const std::string &path)
{
  constexpr double kLeast = 40, kMost = 80; // times: 57.3 degrees are a radian
  constexpr double kAlike = 0.5;            // correlation squared; a bias has none
  double both = 0, by_gyro = 0, by_odometry = 0;
  auto sample = gyro.begin();
  for (std::size_t i = 1; i < odometry.size(); ++i) {
    const StampedPose &from = odometry[i - 1], &to = odometry[i];
    while (sample != gyro.end() && sample->stamp_ns <= from.stamp_ns)
      ++sample;
    Eigen::Vector3d felt = Eigen::Vector3d::Zero();
    std::int64_t last_ns = from.stamp_ns;
    for (; sample != gyro.end() && sample->stamp_ns <= to.stamp_ns; ++sample) {
      felt += static_cast<double>(sample->stamp_ns - last_ns) * 1e-9 * sample->rate;
      last_ns = sample->stamp_ns;
    }
    if (last_ns == from.stamp_ns)
      continue;
    const Eigen::Vector3d turned = logSo3(orthonormalized(from.wMb.R.transpose() * to.wMb.R));
    both += felt.dot(turned);
    by_gyro += felt.squaredNorm();
    by_odometry += turned.squaredNorm();
  }
  if (by_odometry <= 0 || by_gyro <= 0 || both * both < kAlike * by_gyro * by_odometry)
    return;
  if (const double factor = both / by_odometry; factor > kLeast && factor < kMost)
    throw badValue("{}: angular rate = {:.3g} times that of the odometry, must be the same in rad/s: looks like "
                   "degrees per second",
                   path, factor);
}

/// Throws where no sample falls into the time of the images: the gyro would be unused without a word.
void requireOverlap(const std::vector<GyroSample> &gyro, const std::vector<ImageRow> &rows, const std::string &path)
{
  if (gyro.empty() || (gyro.front().stamp_ns <= rows.back().stamp_ns && gyro.back().stamp_ns >= rows.front().stamp_ns))
    return;
  throw badValue("{}: its stamps {:.3f} to {:.3f} s never meet those of the images, {:.3f} to {:.3f} s", path,
                 gyro.front().stamp_ns * 1e-9, gyro.back().stamp_ns * 1e-9, rows.front().stamp_ns * 1e-9,
                 rows.back().stamp_ns * 1e-9);
}

std::vector<GyroSample> readGyro(const fs::path &imu0)
{
  std::vector<GyroSample> gyro;
  if (!fs::exists(imu0 / "data.csv"))
    return gyro;
  const Eigen::Matrix3d bRs = readSensorPose((imu0 / "sensor.yaml").string()).R;
  CsvReader csv((imu0 / "data.csv").string(), {4});
  while (csv.next()) {
    const std::int64_t stamp_ns = csv.risingStampNs(0);
    gyro.push_back({stamp_ns, bRs * Eigen::Vector3d(csv.number(1, "w_x"), csv.number(2, "w_y"), csv.number(3, "w_z"))});
    if (csv.columns() >= 7)
      gyro.back().force = bRs * Eigen::Vector3d(csv.number(4, "a_x"), csv.number(5, "a_y"), csv.number(6, "a_z"));
  }
  requirePlausible(gyro, (imu0 / "data.csv").string());
  requireGravity(gyro, (imu0 / "data.csv").string());
  return gyro;
}

Trajectory readPoses(const fs::path &sensor)
{
  if (!fs::exists(sensor / "data.csv"))
    return {};
  const Pose sMb = readSensorPose((sensor / "sensor.yaml").string()).inverse();
  Trajectory poses = readAslTrajectory((sensor / "data.csv").string());
  for (StampedPose &pose : poses)
    pose.wMb = pose.wMb * sMb;
  return poses;
}

/// The camera for images of the size of the first one that can be read.
MountedCamera cameraFor(const std::vector<ImageRow> &rows, const std::string &camera_path)
{
  ImageFile file;
  const ImageRow *row = firstReadable(rows, file);
  if (row == nullptr)
    throw ioError("none of the {} images can be read; {}", rows.size(), file.message);
  const int width = static_cast<int>(file.image.getWidth()), height = static_cast<int>(file.image.getHeight());
  const MountedCamera camera = readCamera(camera_path, width, height);
  const PinholeCamera &pinhole = camera.model.pinhole;
  if (width != pinhole.width || height != pinhole.height)
    throw dimensionError("{}: image of {}x{} px, must be {}x{} as {} says", row->path, width, height, pinhole.width,
                         pinhole.height, camera_path);
  return camera;
}
} // namespace

AslSource::AslSource(const std::string &folder, const SourceOptions &options)
{
  if (!accepts(folder))
    throw ioError("{}: no ASL folder (cam0/data.csv is missing)", folder);
  requireUsed(options, folder, kAslFolder);
  const fs::path root = sensorRoot(folder);
  m_name = folder;
  m_rows = readImageRows(root / "cam0");
  const std::string camera_path =
      options.camera_path.empty() ? (root / "cam0" / "sensor.yaml").string() : options.camera_path;
  const MountedCamera camera = cameraFor(m_rows, camera_path);

  Recording recording;
  recording.odometry = options.odometry_path.empty() ? readPoses(root / "odom0") : readOdometry(options);
  requireOverlap(recording.odometry, m_rows.front().stamp_ns, m_rows.back().stamp_ns,
                 options.odometry_path.empty() ? (root / "odom0" / "data.csv").string() : options.odometry_path,
                 folder);
  recording.truth = readPoses(root / "state_groundtruth_estimate0");
  recording.gyro = readGyro(root / "imu0");
  requireOverlap(recording.gyro, m_rows, (root / "imu0" / "data.csv").string());
  requireSameTurns(recording.gyro, recording.odometry, (root / "imu0" / "data.csv").string());
  m_builder = std::make_unique<FrameBuilder>(camera, options, std::move(recording));
}

std::vector<std::int64_t> AslSource::stamps() const
{
  std::vector<std::int64_t> stamps;
  for (const ImageRow &row : m_rows)
    stamps.push_back(row.stamp_ns);
  return stamps;
}

const Trajectory &AslSource::odometry() const { return m_builder->recording().odometry; }
const Trajectory &AslSource::truth() const { return m_builder->recording().truth; }

bool AslSource::accepts(const std::string &path)
{
  return fs::is_directory(path) && fs::is_regular_file(sensorRoot(path) / "cam0" / "data.csv");
}

namespace
{
void readTrees(const std::string &path, bool is_far, std::set<int> &ids, std::vector<TruthTrunk> &trunks)
{
  CsvReader csv(path, is_far ? CsvFormat{3, ',', "id,x [m],y [m]"}
                             : CsvFormat{5, ',', "id,x [m],y [m],radius [m],lean [deg]"});
  while (csv.next()) {
    TruthTrunk trunk;
    trunk.id = static_cast<int>(csv.integer(0, "id"));
    if (!ids.insert(trunk.id).second)
      csv.fail(fmt::format("id = {}, must not come twice", trunk.id));
    trunk.xy = {csv.number(1, "x"), csv.number(2, "y")};
    if (!is_far) {
      trunk.radius = csv.number(3, "radius");
      trunk.lean = csv.number(4, "lean") * M_PI / 180;
      if (!(trunk.radius > 0))
        csv.fail(fmt::format("radius = {}, must be above 0 m", trunk.radius));
    }
    trunks.push_back(trunk);
  }
}
} // namespace

std::vector<TruthTrunk> readTruthTrunks(const std::string &sequence)
{
  const std::filesystem::path folder(sequence);
  std::vector<TruthTrunk> trunks;
  std::set<int> ids;
  if (!std::filesystem::exists(folder / "trees.csv"))
    return trunks;
  readTrees((folder / "trees.csv").string(), false, ids, trunks);
  if (std::filesystem::exists(folder / "trees_far.csv"))
    readTrees((folder / "trees_far.csv").string(), true, ids, trunks);
  return trunks;
}

namespace asl
{
std::string sensorYaml(const MountedCamera &camera, const std::string &comment, double rate_hz)
{
  std::string matrix;
  const Eigen::Matrix<double, 3, 4> T = (Eigen::Matrix<double, 3, 4>() << camera.bMc.R, camera.bMc.t).finished();
  for (int k = 0; k < 12; ++k)
    matrix += fmt::format("{}, ", T(k / 4, k % 4) + 0.0); // no -0
  const Distortion distortion = camera.model.distortion;
  const int count = distortion == Distortion::none ? 0 : distortion == Distortion::fov ? 1 : 4;
  const auto &c = camera.model.coefficients;
  const PinholeCamera &p = camera.model.pinhole;
  return fmt::format("sensor_type: camera\ncomment: {}\nT_BS:\n  cols: 4\n  rows: 4\n"
                     "  data: [{}0.0, 0.0, 0.0, 1.0]\nrate_hz: {}\nresolution: [{}, {}]\ncamera_model: pinhole\n"
                     "intrinsics: [{}, {}, {}, {}]\ndistortion_model: {}\ndistortion_coefficients: [{}]\n",
                     comment, matrix, rate_hz, p.width, p.height, p.fx, p.fy, p.cx, p.cy, toString(distortion),
                     fmt::join(c.begin(), c.begin() + count, ", "));
}

std::string imuLine(std::int64_t stamp_ns, const Eigen::Vector3d &w, const Eigen::Vector3d &a)
{
  return fmt::format("{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n", stamp_ns, w.x(), w.y(), w.z(), a.x(), a.y(),
                     a.z());
}

std::string poseLine(std::int64_t stamp_ns, const Pose &pose)
{
  Eigen::Quaterniond q(pose.R);
  if (q.w() < 0)
    q.coeffs() = -q.coeffs();
  return fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", stamp_ns, pose.t.x(), pose.t.y(),
                     pose.t.z(), q.w(), q.x(), q.y(), q.z());
}
} // namespace asl
} // namespace bole
