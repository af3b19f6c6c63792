// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a user may ask of the pipeline. Lengths [m], angles [rad], times [s]; `bole options` prints every key with its
/// unit, range, default and effect.
///
/// What is not here is a constant of the stage that uses it. Thresholds on the picture are held for a camera with a
/// focal length of 200 px and follow the focal length of the camera in use.

namespace bole
{
/// All options of the pipeline; `bole options` prints them with unit, range and default.
struct Options
{
  static constexpr double kUsualRate_hz = 10; ///< at which times that are counted in frames are stated

  /// What the camera does to the picture.
  struct Camera
  {
    double height = 0;       ///< over the ground in the mean of the flight [m], 0: not known; the scale of a video
                             ///< without odometry
    double focal_sigma = 0;  ///< standard deviation of the log of the focal length; 0: calibrated
    double rate = 0;         ///< frames a second; 0: that of the first frames
    bool compressed = false; ///< the pictures went through a lossy codec
  } camera;                  ///< what the camera does to the picture

  /// Parts of the pipeline that can be left out, for comparisons.
  struct Stages
  {
    bool points = true;      ///< relative poses from point features
    bool saliency = true;    ///< motion saliency: off leaves detection ungated
    bool calibration = true; ///< constant errors of gyro, odometry and clocks of a recording are found and taken out
    bool final_pass = true;  ///< at the end every hypothesis is judged by all frames
    bool servoing = false;   ///< the camera is steered by what is tracked, and may rest or circle a trunk
  } stages;                  ///< what is left out

  /// What trunks look like.
  struct Trunks
  {
    double radius = 0.15;      ///< median of the prior [m]
    double radius_sigma = 0.5; ///< standard deviation of its logarithm
    double radius_min = 0.02;  ///< thinner trunks are not looked for [m]
    double radius_max = 0.60;  ///< thicker trunks are not looked for [m]
    double lean = 0.035;       ///< standard deviation of the lean [tan]; 0.0001: upright
    double low = 0.25;         ///< lower end of the part that is tracked, over the ground [m]
    double high = 2.6;         ///< upper end [m]
  } trunks;                    ///< what trunks look like

  struct Range ///< all [m]
  {
    double track = 12;        ///< known trunks farther than this are not tracked
    double detect_min = 1.5;  ///< of a new trunk
    double detect_max = 10.5; ///< of a new trunk
    double through = 9;       ///< whether points are seen through a trunk is asked nearer than this; 0: never
  } range;                    ///< how far is looked

  /// How new trunks are found.
  struct Detection
  {
    int window = 18;              ///< frames looked at together
    double elevation_low = -0.17; ///< lower end of the part of a trunk that is looked for [tan]
    double elevation_high = 0.45; ///< upper end [tan]
  } detection;                    ///< how new trunks are found

  /// How trunks are kept.
  struct Map
  {
    double confirm_probability = 0.5; ///< that a candidate is a trunk, at which it is confirmed
    double confirm_sigma = 0.8;       ///< of the place from where it was seen: the map leaves out what has more [m];
                                      ///< 0: nothing
    double merge_distance = 0.3;      ///< trunks with less than this between their bark are one [m]
    double candidate_memory = 5;      ///< a candidate not seen for longer is no longer looked for, a trunk only
                                      ///< while its bearing is known to its width [s]
    double lag = 0;                   ///< poses older than this are fixed and forgotten [s]; 0: never
  } map;                              ///< how trunks are kept

  struct Odometry ///< noise of the pose filter, a step: between two frames
  {
    double step = 0.012;         ///< horizontal noise of a step [m]
    double step_vertical = 0.03; ///< vertical noise of a step [m]
    double scale = 0.03;         ///< error in proportion to the path
    double height = 0.25;        ///< of the height about the truth [m]
    double tilt = 0.005;         ///< of roll and pitch about the truth [rad]
    double turn = 0.006;         ///< of the rotation of a step, used where there is no gyro [rad]
  } odometry;                    ///< of the pose filter

  /// The gyro.
  struct Gyro
  {
    double noise = 8e-4; ///< white noise of the rate [rad/s/sqrt(Hz)]
    double bias = 0.008; ///< standard deviation of the bias at the start [rad/s]
  } gyro;                ///< of the gyro

  void validate() const; ///< \throw vpException "key = value, must be ..."
};
} // namespace bole
