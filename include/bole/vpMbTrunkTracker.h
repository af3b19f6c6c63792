// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// vpMbTrunkTracker: the pose of a camera from known trunks, a drop-in where a `vpMbTracker *` is used today.
///
/// Idea: predict (motion prior, or the pose before turned by an alignment of whole images), scan each
/// border of each trunk under the predicted covariance for the maxima of its mean signed contrast, let all trunks
/// agree on which maxima to follow, and solve for the pose by virtual visual servoing with robust weights and
/// the prior as one more measurement (tracking/border_profile.h, vpMbtDistanceTrunk.h). Twice: wide, then narrow.
///
/// Frames: o is the object, i.e. the world in which the `.cao` model places the trunks; getPose() is cMo as in ViSP.
/// Covariances (6x6, m and rad, order t then rotation) are those of the camera's twist: cMo_true = exp(-xi) cMo.
///
/// What the image cannot say stays on the prior: with upright trunks the height, with one trunk the turn about
/// it as well. getUnobserved() names these directions, getStatus() says `partly_on_prior`, the covariance grows.
///
/// A pose that may be wrong is not vouched for: `uncertain` when a standard deviation is beyond
/// Options::max_sigma_m or max_sigma_rad (without a prior the height drifts there in some 25 frames), or, without a
/// prior, when the borders agree less than they do where the pose is right. It is then the estimate, which goes on.
///
/// Loss is noticed: track() ends with testTracking(), as ViSP's own trackers do, which throws vpTrackingException
/// unless getStatus() is `tracked` or `partly_on_prior`. When lost or given a bad image, the pose is the prediction,
/// and the next call of track() tries again by itself: nothing has to be re-initialised.
///
/// Differences from ViSP's trackers: models hold cylinders only (others are refused with file and line); no
/// polygons, so getNbPolygon() is 0 and LOD, Ogre and scan-line settings have no effect; the visibility of trunks
/// behind trunks is computed exactly.
///
/// \code
/// vpMbTrunkTracker tracker;
/// tracker.loadConfigFile("trunks.xml");
/// tracker.loadModel("trunks.cao");
/// tracker.initFromPose(I, cMo);
/// while (grab(I)) {
///   tracker.setMotionPrior(odometry * tracker.getPose(), covariance)  ; // where there is one
///   tracker.track(I);                                                          // throws when lost
///   tracker.getPose(cMo);
/// }
/// \endcode
///
/// Cost: see README, "Against ViSP's edge trackers". One tracker a thread.

#include "input/image_health.h"
#include "mbt/border_vote.h"
#include "mbt/camera_motion.h"
#include "mbt/rotation_aligner.h"
#include "mbt/vpMbtDistanceTrunk.h"

#include <Eigen/Core>

#include <optional>
#include <visp3/mbt/vpMbTracker.h>

class vpMbTrunkTracker : public vpMbTracker
{
public:
  enum class Status
  {
    not_initialised,
    tracked,         ///< all six directions seen in the image
    partly_on_prior, ///< some directions are not seen: getUnobserved()
    no_trunk,        ///< no trunk of the model is in view: the pose is the prediction
    uncertain,       ///< borders were found, but the pose is not to be vouched for: getMessage()
    lost,            ///< trunks should be in view and their borders are not found where they must be
    wrong_size,      ///< the rest: the image cannot be believed, the pose is the prediction
    black,
    noise,
    frozen,
    smeared
  };
  static const char *toString(Status status);

  struct Options
  {
    vpMbtDistanceTrunk::Options trunk;
    bole::ImageHealth::Options health;
    bole::RotationAligner::Options aligner;
    bole::VoteOptions vote;
    /// Standard deviation of a border's place [px]: bow and root flare of real trunks (0.1 .. 20).
    double border_sigma_px = 1.5;
    double lean_sigma_rad = 0.03; ///< how far a real trunk leans from its model (0.0001 .. 0.5)
    /// How much the width of a real trunk differs from its model, as a share: taper, bark, shading edges
    /// (0.001 .. 1). Bearings of trunks, which have no such bias, then say where the camera is.
    double radius_sigma = 0.15;
    double scan_min_px = 4;  ///< least half-width of the scan (2 .. 20)
    double scan_max_px = 24; ///< greatest (8 .. 100)
    double refine_px = 5;    ///< half-width of the second scan (2 .. 20)
    int refinements = 1;     ///< scans after the first (0 .. 5)
    /// Without a motion prior: what the camera may do between two frames, after the turn is taken out.
    double step_sigma_m = 0.12;    ///< across the trunks, per axis, while its velocity is unknown (0.001 .. 10)
    double accel_sigma_m = 0.03;   ///< change of that step from one frame to the next (0.001 .. 10)
    double climb_sigma_m = 0.03;   ///< along the trunks, which they do not tell (0.001 .. 10)
    double turn_sigma_rad = 0.006; ///< about each axis (1e-4 .. 1)
    double memory_rate = 0.15;     ///< how fast remembered contrast follows (0.01 .. 1)
    double min_support = 0.35;     ///< share of the visible borders that must agree, else lost (0.05 .. 1)
    /// Without a motion prior: mean of the vote's share and the supporting share, over a few frames, below which
    /// the trunks found may be others (0 .. 1). Right poses of simulated flights have 0.79, wrong ones 0.57.
    double min_agreement = 0.68;
    /// Without a motion prior: squared Mahalanobis distance from the motion expected beyond which trunks were taken for
    /// others, and the pose is not believed (0.1 .. 1000). Right poses of simulated flights stay below 6 in 998 of 1000
    /// frames.
    double max_jump = 6;
    double max_sigma_m = 0.15;    ///< standard deviation along any axis beyond which a pose is uncertain (0.001 .. 100)
    double max_sigma_rad = 0.044; ///< about any axis (0.001 .. 3.2)
    double unobserved_m = 0.5;    ///< a direction the image knows worse than this is not observed (0.01 .. 10)
    double lever_m = 3;           ///< radians count as metres at this range in unobserved_m (0.1 .. 100)
    void validate() const;        ///< throws vpException "name = value, must be ..."
  };

  vpMbTrunkTracker();
  explicit vpMbTrunkTracker(const Options &options);
  ~vpMbTrunkTracker() override;

  /// \name What a trunk tracker adds
  ///@{
  /// Where odometry or a gyro expects the camera at the next track(), and the covariance of that expectation as
  /// a whole. Used once. It is weighed as one more measurement: what odometry knows for good (height by sonar, roll and
  /// pitch by gravity) may be given with a small variance and holds what the trunks cannot say. \throw vpException when
  /// \p covariance is not a finite, positive definite 6x6 matrix.
  void setMotionPrior(const vpHomogeneousMatrix &cMo, const vpMatrix &covariance);
  Status getStatus() const { return m_status; }
  const std::string &getMessage() const { return m_message; } ///< the status in words
  /// Directions of the twist (6 x k, orthonormal in m and rad * lever_m) that the image does not know.
  vpMatrix getUnobserved() const;
  /// Pose covariance after the last track(); also without setCovarianceComputation().
  vpMatrix getPoseCovariance() const;
  const std::vector<vpMbtDistanceTrunk> &getTrunks() const { return m_trunks; }
  const Options &getOptions() const { return m_options; }
  void setOptions(const Options &options);
  /// Trunks added by hand, in the object frame.
  void addTrunk(const bole::Cylinder &trunk);
  ///@}

  /// \name vpMbTracker
  ///@{
  using vpMbTracker::initFromPose;
  using vpMbTracker::setEstimatedDoF;
  void loadModel(const std::string &modelFile, bool verbose = false,
                 const vpHomogeneousMatrix &T = vpHomogeneousMatrix()) override;
  void loadConfigFile(const std::string &configFile, bool verbose = true) override;
  void init(const vpImage<unsigned char> &I) override;
  void resetTracker() override;
  void reInitModel(const vpImage<unsigned char> &I, const std::string &cad_name, const vpHomogeneousMatrix &cMo,
                   bool verbose = false, const vpHomogeneousMatrix &T = vpHomogeneousMatrix());
  void setPose(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cdMo) override;
  void setPose(const vpImage<vpRGBa> &I_color, const vpHomogeneousMatrix &cdMo) override;
  void setCameraParameters(const vpCameraParameters &cam) override;
  void track(const vpImage<unsigned char> &I) override;
  void track(const vpImage<vpRGBa> &I) override;
  void testTracking() override;
  vpColVector getError() const override { return m_error; }
  vpColVector getRobustWeights() const override { return m_w; }
  vpMatrix getCovarianceMatrix() const override;
  double computeCurrentProjectionError(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo,
                                       const vpCameraParameters &cam) override;
  void display(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
               const vpColor &col, unsigned int thickness = 1, bool displayFullModel = false) override;
  void display(const vpImage<vpRGBa> &I, const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
               const vpColor &col, unsigned int thickness = 1, bool displayFullModel = false) override;
  /// Lines (0, i1, j1, i2, j2) of the borders, as vpMbEdgeTracker gives them.
  std::vector<std::vector<double>> getModelForDisplay(unsigned int width, unsigned int height,
                                                      const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
                                                      bool displayFullModel = false) override;
  /// Places (0, i, j, state) where borders were found; state 0 good, 3 rejected by the robust weights.
  virtual std::vector<std::vector<double>> getFeaturesForDisplay();
  ///@}

protected:
  void initCircle(const vpPoint &p1, const vpPoint &p2, const vpPoint &p3, double radius, int idFace = 0,
                  const std::string &name = "") override;
  void initCylinder(const vpPoint &p1, const vpPoint &p2, double radius, int idFace = 0,
                    const std::string &name = "") override;
  void initFaceFromCorners(vpMbtPolygon &polygon) override;
  void initFaceFromLines(vpMbtPolygon &polygon) override;
  void computeVVSInit() override;
  void computeVVSInteractionMatrixAndResidu() override;

private:
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  struct MotionPrior
  {
    vpHomogeneousMatrix cMo;
    Matrix6d covariance;
  };
  /// Where the pose is expected, before the image is looked at.
  struct Prediction
  {
    vpHomogeneousMatrix cMo;
    Matrix6d covariance;
  };

  static constexpr double kRightAgreement =
      0.79; ///< of right poses, mean over simulated flights: what a start is taken for

  // vpMbTrunkTrackerPose.cpp: the estimation
  Eigen::Vector3d alongTrunks() const;
  Prediction predictAlone();
  Prediction predict(const vpImage<unsigned char> *I);
  Status estimate(const vpImage<unsigned char> &I, const Prediction &prediction);
  void predictTrunks(const vpImage<unsigned char> &I);
  void scanTrunks(const vpImage<unsigned char> &I, const Matrix6d &covariance, double max_half_px);
  static std::vector<float> response(const vpMbtDistanceTrunk::BorderState &state);
  Eigen::Matrix<double, 1, 6> rowAtMiddle(const vpMbtDistanceTrunk &trunk, bole::Border side) const;
  Vector6d agree(const Matrix6d &covariance);
  Matrix6d estimatedInObject() const;
  Vector6d estimated(const Vector6d &xi) const;
  void choosePeaks(const Vector6d &twist, double sigma_px, double reach_px);
  double expectedSigma(const vpMbtDistanceTrunk &trunk, bole::Border side, const Matrix6d &covariance) const;
  void servo(const Prediction &prediction);
  void normalEquations(Matrix6d &H, Vector6d &b) const;
  double support() const;
  void judge(double agreement);
  std::string doubt() const;
  void keep(const Prediction &prediction);
  void learn(const vpImage<unsigned char> &I);
  void finish(Status status, const std::string &message);
  void drawBorders(const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam, unsigned int width,
                   unsigned int height, bool all, std::vector<std::vector<double>> &lines) const;
  double focal() const { return 0.5 * (m_cam.get_px() + m_cam.get_py()); }

  Options m_options;
  std::vector<vpMbtDistanceTrunk> m_trunks;
  std::vector<std::size_t> m_in_view; ///< indices of the trunks that the current scan uses
  bole::ImageHealth m_health;
  bole::RotationAligner m_aligner;
  bole::RotationAligner::Reference m_thumbnails; ///< of the present image, where they were needed
  bole::RotationAligner::Reference m_reference;  ///< of the last image that was tracked; empty: not yet reduced
  vpImage<unsigned char> m_reference_image;      ///< that image, where m_reference is empty
  bole::CameraMotion m_motion;                   ///< since then, without a prior
  bole::Vote m_vote;                             ///< of the first scan
  double m_agreement = kRightAgreement;          ///< over the last frames
  bool m_is_doubtful = false;                    ///< what judge() made of it
  std::optional<MotionPrior> m_prior;
  int m_frames_since_good = 0;
  Matrix6d m_posterior = Matrix6d::Zero();
  Eigen::MatrixXd m_unobserved;
  vpMatrix m_L;
  vpColVector m_error, m_w, m_piece_weight, m_by_log_radius;
  vpRobust m_robust;
  Status m_status = Status::not_initialised;
  std::string m_message;
};
