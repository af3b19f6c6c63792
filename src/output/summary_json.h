// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a run was made of and what came out, for people and scripts.

#include "output/flight_trace.h"
#include <bole/frame.h>
#include <bole/open_source.h>
#include <bole/trunk_record.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
struct InputDigest
{
  std::uint64_t bytes = 0;
  std::string sha256; ///< 64 hexadecimal digits
};

/// Hashes the bytes of a file, or the name and the bytes of every file in a folder in the order of their names; a
/// pattern such as `frames/%05d.png` stands for its folder. Returns nothing where \p input is none of these, cannot be
/// read, or \p is_cancelled becomes true. It reads the input once.
std::optional<InputDigest> digestOf(const std::string &input, const std::atomic<bool> &is_cancelled);

/// A time without a picture.
struct PictureGap
{
  double begin_s = 0; ///< stamp of the last frame before it
  double length_s = 0;
};

struct RunSummary
{
  // how the run was made
  std::vector<std::string> command; ///< program and arguments
  std::string working_folder;       ///< in which they count
  std::string input, preset, camera_file, odometry_file;
  std::string options; ///< all that were in effect, as YAML
  std::optional<InputDigest> digest;
  std::string note; ///< FrameSource::note()
  PinholeCamera camera;
  bool is_camera_known = true;        ///< false: the field of view is a guess
  double field_of_view_sigma_deg = 0; ///< of one that was measured in the video, 0: of a calibration
  bool has_odometry = false, has_gyro = false;

  // what came of it
  std::vector<CalibratedConstant> calibration; ///< what was measured of the sensors before the run
  bool is_complete = true;                     ///< false: the run was stopped, this is what was known by then
  bool has_ended = true;                       ///< false: it goes on, or was killed: no last look was taken
  WorldReference reference;                    ///< where scale and gravity come from
  std::map<FrameStatus, std::size_t> frames;
  std::map<FrameStatus, std::string> reasons;            ///< the first message of each status
  std::vector<PictureGap> gaps;                          ///< times without a picture that are far longer than usual
  std::vector<SensorVerdict> sensors;                    ///< sensors that contradict the others
  double duration_s = 0;                                 ///< from the first frame to the last
  double path_m = 0;                                     ///< length of the smoothed trajectory
  double extent_m = 0;                                   ///< farthest that the camera was from its first place
  double rotated_deg = 0;                                ///< most that it was rotated from its first attitude
  std::vector<TrunkRecord> trunks;                       ///< and hypotheses
  Eigen::Vector2d first_place = Eigen::Vector2d::Zero(); ///< from which an error of the scale moves them away [m]
  TimingTable timing;
  std::map<std::string, double> figures; ///< anything else a stage counts, by name
};

/// Prints command, options, input with its hash, versions; camera, frames by status, trunks by status with the medians
/// of their radius, standard deviation and observations, sources of scale and gravity, what is doubtful (judge()) and
/// the median cost by stage. A null says that there was nothing to measure.
std::string toJson(const RunSummary &summary);
/// Reads a summary.json. \throw vpException naming the file when it is none, or of a run that ended before its first
/// frame.
nlohmann::ordered_json readSummary(const std::string &path);
/// Tells \p error of the file \p path in one line.
std::string faultOf(const std::string &path, const std::exception &error);
/// Reads the sources of scale and gravity of a summary.json. Throws vpException naming the file when it is none.
WorldReference readReference(const std::string &path);
/// Reads the camera of a summary.json, and throws likewise.
PinholeCamera readCameraOfRun(const std::string &path);
/// The place of a run's input, and of its camera file, which is empty where none was given.
struct RunInput
{
  std::string path, camera_path;
};
/// Reads them of a summary.json, and throws likewise.
RunInput readInputOfRun(const std::string &path);
/// Writes toJson() atomically.
void writeSummary(const std::string &path, const RunSummary &summary);

/// The worth of a run in words: what is known, what is doubtful, and which option would help.
struct Verdict
{
  bool is_trusted = true;          ///< false: the camera never moved, only rotated, or saw nothing
  std::vector<std::string> facts;  ///< a line each
  std::vector<std::string> doubts; ///< a sentence each, with the option that would help; empty when all is well
};

Verdict judge(const RunSummary &summary);

/// Prints the last lines of `bole track`.
std::string toText(const Verdict &verdict);

/// Returns the versions of bole, its commit ("unknown" outside a repository), ViSP, OpenCV and libav.
std::map<std::string, std::string> versions();
} // namespace bole
