// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A tree trunk as a visual feature for ViSP's vpServo.

#include <bole/trunk.h>
#include <bole/trunk_record.h>

#include <bole/visp.h>
#include <visp3/core/vpRGBa.h>
#include <visp3/visual_features/vpBasicFeature.h>
#include <visp3/visual_features/vpFeatureLine.h>

/// What one view says of a vertical cylinder, four numbers, s = (bearing, inclination, tip, log
/// r/d):
///
/// - bearing [rad]: angle, in the plane perpendicular to the trunk, from the optical axis to the
/// trunk,
///   positive when the trunk is on the right;
/// - inclination [rad]: of the trunk in the image, positive when its top leans to the right;
/// - tip [rad]: of the top away from the camera (optical axis against the trunk's perpendicular);
/// - log ratio: log of radius over distance.
///
/// Why these: with m the unit vector to the axis, a the axis (up), n = a x m (left) and d the
/// distance,
///
///     d/dt bearing     =  n.v / d + a.w  (+ terms in the tip)     d/dt log ratio = m.v / d
///     d/dt inclination, tip: rotations alone
///
/// The log ratio does not change with any rotation, the bearing changes neither with a roll about
/// the optical axis nor (level camera) with a pitch, and their rows are orthogonal, so bearing and
/// log ratio servo a quadrotor whose roll and pitch belong to its velocity loop. The two border
/// lines (rho, theta) hold the same four numbers, but each of them couples all six velocities, and
/// their difference vanishes with distance. The log (and not r/d or d) makes the rate of approach
/// the same at every distance: exponential decrease of the error is exponential decrease of the
/// relative distance error.
///
/// Interaction matrix by the camera's velocity (v, w) in the camera frame, exact for given d; d =
/// radius / ratio, so a wrong radius only scales the translational columns, never a zero of the
/// error.
///
/// Laws (each a test): interaction() agrees with central differences and, through the chain rule,
/// with vpFeatureLine on the limbs of vpCylinder; the three builders agree; error is zero at
/// itself.
class vpFeatureTrunk : public vpBasicFeature
{
public:
  vpFeatureTrunk();

  /// An empty feature: ViSP calls it from the constructor.
  void init() override;
  /// From a tracked trunk; radius [m], known or believed.
  void buildFrom(const bole::RelativeTrunk &relative, double radius);
  /// From a trunk of the map and the camera's pose. Throws vpException where the camera is inside
  /// the trunk.
  void buildFrom(const bole::Trunk &trunk, const bole::Pose &wMc);
  /// The same of a trunk as vpTrunkMapper::getTrunks() gives it, seen from where getCameraPose() says.
  void buildFrom(const bole::TrunkRecord &trunk, const vpHomogeneousMatrix &cMw);
  /// From the image lines of its two borders (normalised coordinates, order does not matter); the
  /// trunk is the narrower of the two wedges. Throws vpException for lines that are one or that are
  /// no limbs of an upright trunk.
  void buildFrom(const vpFeatureLine &border, const vpFeatureLine &other_border, double radius);
  /// As numbers, e.g. for a desired feature.
  void buildFrom(double bearing, double inclination, double tip, double log_ratio, double radius);

  /// Of the axis [rad], to the right of the optical axis.
  double bearing() const { return s[0]; }
  /// Of the axis against the vertical in the image plane [rad].
  double inclination() const { return s[1]; }
  /// Of the axis towards the camera [rad].
  double tip() const { return s[2]; }
  /// Logarithm of radius over distance.
  double logRatio() const { return s[3]; }
  double distance() const; ///< from the camera's centre to the axis [m], with the radius given
  /// The four numbers as a relative trunk.
  bole::RelativeTrunk relativeTrunk() const;

  /// For vpServo::addFeature.
  static unsigned int selectBearing() { return FEATURE_LINE[0]; }
  /// For vpServo::addFeature.
  static unsigned int selectInclination() { return FEATURE_LINE[1]; }
  /// For vpServo::addFeature.
  static unsigned int selectTip() { return FEATURE_LINE[2]; }
  /// For vpServo::addFeature.
  static unsigned int selectLogRatio() { return FEATURE_LINE[3]; }

  /// Interaction matrix of the selected numbers by the camera's velocity [m/s, rad/s].
  vpMatrix interaction(unsigned int select = FEATURE_ALL) override;
  /// s - s*, angles brought to (-pi, pi].
  vpColVector error(const vpBasicFeature &s_star, unsigned int select = FEATURE_ALL) override;
  /// Prints the selected numbers in degrees and metres.
  void print(unsigned int select = FEATURE_ALL) const override;
  /// A copy, as vpServo keeps it.
  vpFeatureTrunk *duplicate() const override;
  /// Draws both borders.
  void display(const vpCameraParameters &cam, const vpImage<unsigned char> &I, const vpColor &color = vpColor::green,
               unsigned int thickness = 1) const override;
  /// Draws both borders.
  void display(const vpCameraParameters &cam, const vpImage<vpRGBa> &I, const vpColor &color = vpColor::green,
               unsigned int thickness = 1) const override;

private:
  void set(const bole::RelativeTrunk &relative);

  double m_radius = 0.15;
};
