// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// vpMbTrunkTracker: the pose of a camera from known trunks, a drop-in where a `vpMbTracker *` is used today.
///
/// Idea: predict the pose (setMotionPrior(), or constant velocity), scan the borders of all trunks under the predicted
/// covariance, let them agree on the maxima to follow, and solve for the pose by virtual visual servoing with robust
/// weights and the prediction as one more measurement. This is done twice, wide and then narrow.
/// Frames: o is the object, the world in which the `.cao` model places the trunks; getPose() is cMo as in ViSP.
/// Covariances (6x6, m and rad, order t then rotation) are those of the camera's twist: cMo_true = exp(-xi) cMo.
/// What the image does not tell (the height, with upright trunks) stays on the prediction and is named by
/// getUnobserved(). Without odometry a forest is rarely held for more than some 20 frames.
///
/// track() ends with testTracking(), which throws vpTrackingException unless getStatus() is `tracked` or
/// `partly_on_prior`. The pose is then the estimate (`uncertain`) or the prediction (the rest), and the next call of
/// track() tries again: nothing has to be initialised anew.
/// Of a model the cylinders are tracked, its faces and circles are not. LOD, Ogre and scan-line settings have no
/// effect.
///
/// \code
/// vpMbTrunkTracker tracker;
/// tracker.loadModel("trunks.cao");
/// tracker.initFromPose(I, cMo);
/// while (grab(I)) {
///   tracker.setMotionPrior(odometry * tracker.getPose(), covariance); // where there is odometry
///   tracker.track(I);                                                 // throws when the pose cannot be trusted
/// }
/// \endcode

#include <bole/visp.h>
#include <memory>
#include <visp3/mbt/vpMbTracker.h>
/// Camera poses from known trunks, as a ViSP model-based tracker.
class vpMbTrunkTracker : public vpMbTracker
{
public:
  /// What is known about the last pose.
  enum class Status
  {
    not_initialised,
    tracked,
    partly_on_prior, ///< some directions are not seen: getUnobserved()
    uncertain,       ///< borders were found, but the pose is not to be trusted: getMessage()
    no_trunk,        ///< no trunk of the model is in view
    lost,            ///< trunks should be in view, and their borders are not where they must be
    bad_image        ///< black, noise, frozen, smeared or of another size: getMessage()
  };
  /// As reports write it.
  static const char *toString(Status status);
  /// Thresholds and noise; set them from XML by loadConfigFile().
  struct Options
  {
    double border_sigma_px = 1.5; ///< of a border's place: bow and root flare of real trunks (0.1 .. 20)
    double lean_sigma_rad = 0.03; ///< how far a real trunk leans from its model (0.0001 .. 0.5)
    double radius_sigma = 0.15;   ///< how far its width differs from its model, as a share (0.001 .. 1)
    double min_length_px = 30;    ///< shorter borders are not used (4 .. 1000)
    double min_width_px = 4;      ///< thinner trunks are not used: their borders blur into each other (1 .. 100)
    double min_contrast = 1;      ///< weaker maxima are no border, grey levels a pixel (0 .. 50)
    double scan_max_px = 24;      ///< greatest half-width of the scan (8 .. 100)
    double step_sigma_m = 0.12;   ///< without a prior: translation between two frames (0.001 .. 10)
    double turn_sigma_rad = 0.04; ///< without a prior: rotation between two frames (0.0001 .. 1)
    double min_support = 0.35;    ///< share of the visible borders that must agree, else lost (0.05 .. 1)
    double max_sigma_m = 0.15;    ///< standard deviation along any axis beyond which a pose is uncertain (0.001 .. 100)
    double max_sigma_rad = 0.044; ///< about any axis (0.001 .. 3.2)
    double unobserved_m = 0.5;    ///< a direction that the image knows worse than this is unobserved (0.01 .. 10)
    double lever_m = 3;           ///< a rotation counts as a translation at this range in unobserved_m (0.1 .. 100)
    double detect_frozen = 1;     ///< 0: an image equal to the one before is believed (0 .. 1)
    void validate() const;        ///< \throw vpException "name = value, must be ..."
  };

  vpMbTrunkTracker();
  /// A tracker without model.
  explicit vpMbTrunkTracker(const Options &options);
  ~vpMbTrunkTracker() override;

  /// Where odometry or a gyro expects the camera at the next track(); what it knows for good (height by sonar, roll and
  /// pitch by gravity) may have a small variance. \throw vpException unless \p covariance is 6x6 and positive definite.
  void setMotionPrior(const vpHomogeneousMatrix &cMo, const vpMatrix &covariance);
  /// Of the last frame.
  Status getStatus() const;
  const std::string &getMessage() const; ///< the status in words
  vpMatrix getUnobserved() const;        ///< 6 x k: directions of the twist, orthonormal in m and rad * lever_m
  vpMatrix getPoseCovariance() const;    ///< of the last pose; also without setCovarianceComputation()
  /// As set.
  const Options &getOptions() const;
  /// \throws vpException where a value is out of range, with what is allowed
  void setOptions(const Options &options);
  /// Adds a trunk around the segment p1 p2 (world coordinates of the points, in the object frame).
  void addTrunk(const vpPoint &p1, const vpPoint &p2, double radius);

  /// Reads the cylinders of a .cao file [m]. \throws vpException with file and line
  void loadModel(const std::string &modelFile, bool verbose = false,
                 const vpHomogeneousMatrix &T = vpHomogeneousMatrix()) override;
  /// Reads Options from XML. \throws vpException with file and line
  void loadConfigFile(const std::string &configFile, bool verbose = true) override;
  /// Called by ViSP after the first pose is set.
  void init(const vpImage<unsigned char> &I) override;
  /// Forgets model and pose.
  void resetTracker() override;
  /// Loads another model and starts at \p cMo.
  void reInitModel(const vpImage<unsigned char> &I, const std::string &cad_name, const vpHomogeneousMatrix &cMo);
  /// Starts at \p cdMo.
  void setPose(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cdMo) override;
  /// Starts at \p cdMo.
  void setPose(const vpImage<vpRGBa> &I_color, const vpHomogeneousMatrix &cdMo) override;
  /// Finds the pose in the next image.
  void track(const vpImage<unsigned char> &I) override;
  /// Finds the pose in the next image.
  void track(const vpImage<vpRGBa> &I) override;
  /// \throws vpTrackingException when the last pose is not to be trusted
  void testTracking() override;
  vpColVector getError() const override;         ///< residuals at z = 1, a piece of a border each
  vpColVector getRobustWeights() const override; ///< of these residuals
  /// Of the last pose, 6 x 6, in ViSP's order [m, rad].
  vpMatrix getCovarianceMatrix() const override;
  /// Mean distance of the borders from the model [px].
  double computeCurrentProjectionError(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo,
                                       const vpCameraParameters &cam) override;
  /// Draws the model's borders.
  void display(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
               const vpColor &col, unsigned int thickness = 1, bool displayFullModel = false) override;
  /// Draws the model's borders.
  void display(const vpImage<vpRGBa> &I, const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
               const vpColor &col, unsigned int thickness = 1, bool displayFullModel = false) override;
  /// Lines (0, i1, j1, i2, j2) of the borders, as vpMbEdgeTracker gives them.
  std::vector<std::vector<double>> getModelForDisplay(unsigned int width, unsigned int height,
                                                      const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
                                                      bool displayFullModel = false) override;
  /// Places (0, i, j, state) where borders were found; state 0 good, 3 rejected by the robust weights.
  std::vector<std::vector<double>> getFeaturesForDisplay();

protected:
  /// Circles are no trunks: ignored.
  void initCircle(const vpPoint &, const vpPoint &, const vpPoint &, double, int, const std::string &) override;
  /// One trunk from the model file.
  void initCylinder(const vpPoint &p1, const vpPoint &p2, double radius, int, const std::string &) override;
  /// Faces are no trunks: ignored.
  void initFaceFromCorners(vpMbtPolygon &) override;
  /// Faces are no trunks: ignored.
  void initFaceFromLines(vpMbtPolygon &) override;
  /// Not used: the pose is found by its own solver.
  void computeVVSInit() override;
  /// Not used: the pose is found by its own solver.
  void computeVVSInteractionMatrixAndResidu() override;

private:
  struct Impl;
  std::unique_ptr<Impl> m_impl;
};
