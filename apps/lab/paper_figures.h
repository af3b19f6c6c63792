// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The pictures of the paper's figures 5 to 8, drawn from a flight that was mapped with its preset.

#include "input/truth.h"
#include <bole/camera.h>
#include <bole/pose.h>
#include <bole/report.h>

#include <string>
#include <vector>

namespace bole::apps
{
/// A frame as the preset of the paper saw it, and the map right after it.
struct SeenFrame
{
  vpImage<unsigned char> image;
  FrameReport report;
  std::vector<TrunkRecord> map;
};

/// The preset's way through one flight, and what was true.
struct SeenFlight
{
  std::string name;
  PinholeCamera camera;
  Pose bMc;
  std::vector<SeenFrame> frames;
  std::vector<TrunkRecord> map; ///< after the last smoothing
  Trajectory smoothed, truth;
  std::vector<TruthTrunk> trunks;
  std::vector<int> right; ///< ids of the map's trees that are trunks of the truth, one each

  Pose trueCamera(std::size_t frame) const;
};

/// One panel of a figure: a picture or two side by side, and what is said below them.
struct Panel
{
  struct Picture
  {
    std::string name;  ///< of its file, .svg or .png
    std::string bytes; ///< its content
  };
  std::vector<Picture> pictures;
  std::string caption;
};

/// The three columns of V (Eq. 14) as arrows over the image, one panel an axis, as SVG: Fig. 5.
std::string basisFlowsSvg(const PinholeCamera &camera);
Panel figure5(const PinholeCamera &camera);
Panel figure6(const SeenFlight &flight);
/// Three successes, and the two failures that the paper names, each where the flight has it.
std::vector<Panel> figure7(const SeenFlight &flight);
/// Two frames with newly found trees, each beside its saliency.
std::vector<Panel> figure8(const SeenFlight &flight);
} // namespace bole::apps
