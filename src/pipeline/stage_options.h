// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the stages are told: one aggregate a stage, made from Options by stageOptions(). Tests and the ablation set
/// them one by one.

#include "detection/line_detector.h"
#include "gradient/gradient.h"
#include "map/trunk_map.h"
#include "motion/point_motion.h"
#include "pipeline/motion_model.h"
#include "saliency/saliency_options.h"
#include "tracking/trunk_tracker.h"
#include <bole/camera.h>
#include <bole/options.h>
#include <bole/smoother.h>

namespace bole
{
/// More iterations a frame than the smoother takes by itself: what the detector and the map choose rests on where the
/// trunks stand now, and a flight has few poses against those the smoother is made for.
inline SmootherOptions closeToTheOptimum()
{
  SmootherOptions options;
  options.max_iterations = 4;
  return options;
}

/// What belongs to no single stage.
struct FlowOptions
{
  bool use_points = true;       ///< relative poses from point features
  bool use_saliency = true;     ///< motion saliency: off leaves detection ungated
  bool final_pass = true;       ///< at the end every hypothesis is judged by all frames: see final_pass.h
  int detect_every = 1;         ///< frames between two runs of the detector, 1 to 100
  int most_new_candidates = 3;  ///< detections that become candidates in one frame, the best, 1 to 100: each costs
                                ///< time and, while it is wrong, pulls on the trajectory
  double view_spacing = 0.06;   ///< least move between two views of the detector's window [m], 0 to 1
  double trunk_low = 0.25;      ///< part of a trunk that is tracked: height over the ground from [m], 0 to 5
  double trunk_high = 2.6;      ///< ... to [m]; its middle is near breast height, where radii are told
  double track_range = 12;      ///< known trunks farther than this are not tracked [m], 1 to 100
  double gate = 9.2;            ///< chi square (2) of bearing and log r/d against the prediction, 1 to 100
  double contrast_noise = 0.02; ///< contrast at which noise moves a border as much as its roughness does, 0 to 0.5
  double gate_sigma_px = 1.0;   ///< of a border beside the prediction [px], 0.1 to 10
  double search_px = 0;         ///< a trunk missed is looked for wider: standard deviation sideways for each frame in a
                                ///< row that it was missed [px], up to a third of tracking.scan_max_px; 0 to 5
  bool track_texture = false;   ///< near trunks are tracked by their texture from image to image
  bool mask_texture_edges = false; ///< a border beyond which the trunk continues by depth is not used
  bool detect_leaning = false;     ///< trunks that lean are looked for in flight, too
  double view_correlation = 0; ///< views of a trunk from places nearer to one another than this share what is wrong in
                               ///< them, and count by how far the camera moved between them [m], 0 (never) to 1
  int turned_frames = 0; ///< borders whose contrast changed its sign are accepted after so many frames in a row at
                         ///< the predicted place: from its other side a bright trunk may be darker than the
                         ///< background; 0 (never) to 1000
};

struct StageOptions
{
  FlowOptions flow;
  MotionModelOptions motion;
  PointMotionOptions points;
  double camera_height = 0; ///< over the ground, where it is known [m]; 0: unknown
  double focal_sigma = 0;   ///< of the log of the focal length; 0: calibrated
  GradientOptions gradient;
  SaliencyOptions saliency;
  DetectorOptions detection;
  LineDetectorOptions lines;
  TrackingOptions tracking;
  SmootherOptions smoothing = closeToTheOptimum();
  MapOptions map;
};

/// The stages' options for a user's, with thresholds in the pixels of \p camera.
/// \throw vpException naming the option, its value and the range.
StageOptions stageOptions(const Options &options, const PinholeCamera &camera);
} // namespace bole
