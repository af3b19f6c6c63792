// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// vpTrunkMapper: images in, a map of tree trunks and the pose of the drone out, in the habits of ViSP's trackers.
///
/// Idea: nothing has to be known of the wood and no first pose is needed. Trunks are found in the images, tracked as
/// cylinders, and mapped together with the trajectory. Where odometry is given it tells the scale; else the height of
/// the camera over the ground does (setCameraHeight()); else the scale is a guess, and getReference() says so.
///
/// Frames: w world (z up; the one of the odometry, else that of the first image), b body (x forward, y left, z up), c
/// camera (z forward, as in ViSP). Lengths [m], angles [rad], times [s].
///
/// Map once, then localise: saveModel() writes a model that vpMbTrunkTracker::loadModel() reads; its object frame is w.
///
/// \code
/// vpTrunkMapper mapper(cam);
/// mapper.setCameraHeight(1.5);
/// while (grab(I, stamp_s)) {
///   vpDisplay::display(I);
///   mapper.track(I, stamp_s);         // or track(I, stamp_s, wMb) where there is odometry
///   mapper.display(I);
///   vpDisplay::flush(I);
/// }
/// mapper.finish();
/// mapper.saveModel("map.cao");
/// \endcode
///
/// A frame that cannot be trusted (dark, frozen, of another size) throws nothing: its pose is predicted, and the next
/// frame goes on. testTracking() throws for it, as ViSP's trackers do. A frame that a program cannot mean (a stamp that
/// is not later than the last one, NaN, a matrix that is no rotation) throws vpException, and the mapper is as it was
/// before. One mapper a thread.

#include <bole/frame.h>
#include <bole/trunk_record.h>

#include <bole/visp.h>
#include <memory>
#include <string>
#include <vector>
#include <visp3/core/vpCameraParameters.h>
#include <visp3/core/vpColor.h>
#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

/// Maps trunks from images in ViSP's habits: track(), getPose(), getTrunks(), display().
class vpTrunkMapper
{
public:
  /// A camera at the body's origin that looks forward. \p cam may have ViSP's radial distortion (kud); the size of the
  /// images is that of the first one, where a camera that cannot be one is refused.
  explicit vpTrunkMapper(const vpCameraParameters &cam);
  /// \p bMc: the camera in the body.
  vpTrunkMapper(const vpCameraParameters &cam, const vpHomogeneousMatrix &bMc);
  ~vpTrunkMapper();
  /// Moves the flight with all that is known.
  vpTrunkMapper(vpTrunkMapper &&) noexcept;
  vpTrunkMapper &operator=(vpTrunkMapper &&) noexcept; ///< Moves the flight with all that is known.

  /// \name Before the first image
  ///@{

  /// Options as YAML, or a preset by its name. \throw vpException "file:line: key = value, must be ...".
  void loadConfigFile(const std::string &configFile);
  /// Of the camera over the ground in the mean of the flight [m], where no odometry tells the scale.
  void setCameraHeight(double height);
  /// Of the images that come without a stamp [Hz]; default 25.
  void setFrameRate(double rate);
  ///@}

  /// \name A frame each
  ///@{

  /// The next image, a period of setFrameRate() after the last.
  void track(const vpImage<unsigned char> &I);
  /// The next image, a period of setFrameRate() after the last.
  void track(const vpImage<vpRGBa> &I);
  /// The next image at its time [s].
  /// \throw vpException naming frame, stamp and value for what cannot be; the mapper is then as it was before.
  void track(const vpImage<unsigned char> &I, double stamp_s);
  /// \p wMb: the pose by odometry. All frames have one or none has.
  void track(const vpImage<unsigned char> &I, double stamp_s, const vpHomogeneousMatrix &wMb);
  /// \p gyro: samples since the frame before, oldest first, body frame.
  void track(const vpImage<unsigned char> &I, double stamp_s, const vpHomogeneousMatrix &wMb,
             const std::vector<bole::GyroSample> &gyro);
  /// \throw vpTrackingException saying why, when the last frame cannot be trusted, when gyro and odometry contradict
  /// the images, or when a flight with odometry has to do without it: it is not there, or contradicts the others. A
  /// gyro that is not believed throws nothing: the images do without.
  void testTracking() const;
  /// The sensors that contradicted the others so far: since when, and in what.
  std::vector<bole::SensorVerdict> getVerdicts() const;
  /// Smooths the whole flight once more; afterwards getTrunks() is as good as it gets.
  void finish();
  ///@}

  /// \name What is known
  ///@{
  void getPose(vpHomogeneousMatrix &wMb) const; ///< of the body at the last frame
  /// The same as a value.
  vpHomogeneousMatrix getPose() const;
  /// The world in the camera at the last frame: what vpMbTrunkTracker::initFromPose() takes for a model of this map.
  void getCameraPose(vpHomogeneousMatrix &cMw) const;
  std::vector<bole::TrunkRecord> getTrunks() const; ///< the confirmed ones
  bole::WorldReference getReference() const;        ///< where scale and gravity come from
  ///@}

  /// Draws the borders of the trunks of the last frame, confirmed ones \p thickness wide and candidates thin.
  /// vpColor::none gives each trunk a colour of its own.
  void display(const vpImage<unsigned char> &I, const vpColor &color = vpColor::none, unsigned int thickness = 2) const;
  /// Draws the trunks in view, the confirmed ones by their borders.
  void display(const vpImage<vpRGBa> &I, const vpColor &color = vpColor::none, unsigned int thickness = 2) const;

  /// The confirmed trunks as a `.cao` model of cylinders, which vpMbTrunkTracker and ViSP's own trackers load.
  /// \throw vpException where there is none, no range is known, or the file cannot be written.
  void saveModel(const std::string &modelFile) const;

private:
  class Impl;
  std::unique_ptr<Impl> m_impl;
};
