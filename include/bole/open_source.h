// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One door to every kind of recording, and how recordings are read.

#include <bole/frame.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// A calibrated camera and where it sits in the body.
struct MountedCamera
{
  CameraModel model; ///< of the camera
  Pose bMc;          ///< place of the camera in the body
};

/// Pose in the body (x forward, y left, z up) of a camera at its origin that looks straight ahead.
Pose forwardCamera();

/// Reads a camera, whatever the name of its file: EuRoC, OpenCV, ROS or Kalibr YAML, or ViSP XML.
///
/// YAML: keys of the EuRoC datasets and no others; distortion_model is `none`, `radial-tangential`
/// (or `radtan`; k1 k2 p1 p2, a fifth coefficient must be 0), `equidistant` (k1 .. k4) or `fov` (s
/// [rad]). `T_BS` takes coordinates of the camera to those of the body; without it the camera is
/// forwardCamera(). XML: the model with distortion where there is one (kud becomes k1); a file with
/// several cameras is resolved by \p width and \p height [px], 0 for any.
///
/// A calibration of OpenCV or ROS (`camera_matrix`, or K as a printed camera_info has it) is that of a forwardCamera(),
/// of a fisheye where it says so; a third radial coefficient is folded into the other two.
///
/// Errors: vpException "file:line: key = value, must be ..." for an unknown, repeated, missing,
/// mistyped or out-of-range key, and for a T_BS that is not a rigid motion;
/// "file: ..." for a camera that cannot be one (field of view, distortion that folds the picture, place in the body).
MountedCamera readCamera(const std::string &path, int width = 0, int height = 0);

/// A constant of a sensor, as it was measured.
struct CalibratedConstant
{
  std::string name;  ///< for programs: gyro_late_s, gyro_bias, accelerometer_bias, odometry_late_s, odometry_rotation,
                     ///< odometry_scale
  double value = 0;  ///< [s], [rad/s], [m/s^2], [s], [rad] or [1]; of a vector its length
  double sigma = 0;  ///< standard deviation
  bool used = false; ///< false: as stated by the sensor to what can be measured, and read so
  std::string text;  ///< for the user: "gyro: clock 31 +- 2 ms late"
};

/// Constant errors of the motion sensors of a recording: what the sensors say is corrected by them as it is read.
/// o: the body as the odometry has it.
struct SensorCalibration
{
  double gyro_late_s = 0;                               ///< stamps of the gyro less the true times
  double odometry_late_s = 0;                           ///< stamps of the odometry less the true times
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< [rad/s]
  Eigen::Vector3d force_bias = Eigen::Vector3d::Zero(); ///< of the accelerometer [m/s^2]
  Eigen::Matrix3d bRo = Eigen::Matrix3d::Identity();    ///< rotation of the odometry's body in the body
  double odometry_scale = 1;                            ///< horizontal lengths of the odometry over the true ones
  double odometry_rotation_sigma = 0;                   ///< what is left open of bRo [rad]
  double odometry_scale_sigma = 0;                      ///< what is left open of odometry_scale [1]
  std::vector<CalibratedConstant> constants;            ///< all that were measured
  std::vector<SensorVerdict>
      verdicts; ///< sensors that contradict the others from the start on, for which no constant helps
};

/// Options of every frame source. One that has no effect on the source is refused.
struct SourceOptions
{
  std::string camera_path;   ///< camera file (readCamera()); empty: the one of the folder, or a guess
  std::string odometry_path; ///< trajectory file (readTrajectory()); empty: the one of the folder, or none
  /// [s], added to the stamps of odometry_path so that they count as the video's do. Default 0.
  double odometry_offset_s = 0;
  /// [Hz], > 0, 1e-3 to 1e4: rate of numbered images, which have no stamps of their own.
  /// Default: `rate_hz` of the camera file, else 25.
  std::optional<double> frame_rate_hz;
  /// [px], 0 (keep) or >= 64: wider images are shrunk to this. Default 640: see Rectifier.
  int max_width_px = 640;
  /// [degrees], 10 to 150: horizontal field of view where no camera is given. Default: 65 is assumed, and said, which
  /// is between a phone's video and an action camera's.
  std::optional<double> field_of_view_deg;
  /// Radial distortion where no camera is given: k1 of Distortion::radial_tangential. Default: 0.
  double distortion_k1 = 0;
  /// Errors of gyro and odometry that are taken out. Default: none.
  SensorCalibration calibration;

  /// \throws vpException where a value is out of range, with what is allowed
  void validate() const;
};

/// Opens \p input: an ASL folder (AslSource), a video file whatever its name (VideoSource), a folder of numbered images
/// or a pattern such as `image%04d.png` (SequenceSource), or an address. Errors: vpException, one line that names the
/// input and what is wrong with it.
///
/// \code
/// const auto source = openSource("data/park-forward");
/// for (Frame frame; source->next(frame);)
///   use(frame);
/// \endcode
std::unique_ptr<FrameSource> openSource(const std::string &input, const SourceOptions &options = {});

/// The one judge of frames: gives each its status and the reason, as those of openSource() have them, with the gyro and
/// the odometry that came with it. One that was `ok` becomes `stale`, `resized` or `doubtful` with a message, by its
/// image, gyro and odometry against those of the frames before; others stay as they are. Images may be raw or
/// rectified, but always the same.
///
/// A frame that comes far later than usual after the one before tells so (Frame::gap_s) and is used. Usual is the
/// median of the last intervals, so that a camera whose rate changes is one that changes its rate.
class FrameJudge
{
public:
  /// \param camera of the images judged; only its focal length is used.
  /// \param bMc the camera in the body, to which gyro and odometry belong
  FrameJudge(const PinholeCamera &camera, const Pose &bMc);
  ~FrameJudge();
  FrameJudge(FrameJudge &&) noexcept; ///< Moves what it knows of the frames before.
  void judge(Frame &frame);           ///< in the order of time

private:
  struct State;
  std::unique_ptr<State> m_state;
};

/// A trunk of the truth. Position and radius are those at breast height, 1.3 m above the ground, where forest
/// inventories measure: in the rendered forests the axes that were fitted to the depth maps pass (x, y) at 1.3 m to
/// about 6 mm, with this radius to 7 mm, and are up to 0.08 m away from it at the foot.
struct TruthTrunk
{
  int id = 0;                                   ///< as in the file
  Eigen::Vector2d xy = Eigen::Vector2d::Zero(); ///< [m]
  double radius = 0;                            ///< [m], 0 when not known (far trunks)
  double lean = 0;                              ///< from the vertical [rad], direction not known
};

/// Reads `trees.csv` (id, x, y, radius, lean) and, where it is there, `trees_far.csv` (id, x, y) of
/// the folder \p sequence; empty when the sequence has no `trees.csv`. Errors: vpException with
/// file:line for a row that is not what it must be or an id that comes twice.
std::vector<TruthTrunk> readTruthTrunks(const std::string &sequence);

/// \name Lines of an ASL folder, for those that write one
///@{
namespace asl
{
constexpr const char *kImagesHead = "#timestamp [ns],filename\n"; ///< first line of cam0/data.csv
constexpr const char *kImuHead = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
                                 "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"; ///< of imu0/data.csv
constexpr const char *kPosesHead = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],"
                                   "q_RS_y [],q_RS_z []\n"; ///< of odom0 and of the truth
/// cam0/sensor.yaml; \p comment in one line.
std::string sensorYaml(const MountedCamera &camera, const std::string &comment, double rate_hz);
/// A line of imu0/data.csv.
std::string imuLine(std::int64_t stamp_ns, const Eigen::Vector3d &rate, const Eigen::Vector3d &force);
/// A line of odom0/data.csv and of the truth.
std::string poseLine(std::int64_t stamp_ns, const Pose &pose);
} // namespace asl
///@}
} // namespace bole
