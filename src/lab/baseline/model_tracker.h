// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// ViSP's model-based trackers and ours, set up for the same model and camera.

#include <bole/camera.h>
#include <bole/pose.h>

#include <iosfwd>
#include <memory>
#include <string>
#include <visp3/mbt/vpMbTracker.h>

namespace bole
{
enum class TrackerKind
{
  visp_edge,
  visp_generic_edge,
  visp_generic_edge_klt,
  trunk
};
const char *toString(TrackerKind kind);

/// ViSP's moving-edge settings: what the sweep varies. Defaults are those of ViSP's tutorials.
struct EdgeSettings
{
  int mask_size = 5;        ///< [px]
  int range = 8;            ///< search along the normal [px]
  double threshold = 10000; ///< likelihood
  double sample_step = 4;   ///< [px]
  double far_m = 15;        ///< clipping of the model [m]
  std::string text() const;
};

/// ViSP tells std::cout and std::cerr of every model and every setPose(); not while this lives.
class Silence
{
public:
  Silence();
  ~Silence();
  Silence(const Silence &) = delete;
  Silence &operator=(const Silence &) = delete;

private:
  std::streambuf *m_out, *m_err;
};

vpMatrix toVisp(const Matrix6d &covariance);

/// \p trunk_xml: settings file of vpMbTrunkTracker, empty: its defaults. Of \p settings ours takes the far clipping
/// only.
std::unique_ptr<vpMbTracker> makeTracker(TrackerKind kind, const EdgeSettings &settings, const std::string &cao_path,
                                         const PinholeCamera &camera, const std::string &trunk_xml = "");
} // namespace bole
