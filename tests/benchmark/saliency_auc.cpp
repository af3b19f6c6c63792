// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/forest_flight.h"

#include <bole/saliency/roc.h>
#include <bole/saliency/saliency.h>

#include <Eigen/LU>
#include <ctime>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>

using namespace bole;
using namespace bole::support;

int main(int argc, char **argv)
{
  std::vector<std::string> names = {"park-forward", "winter-weave", "pine-arc"};
  SaliencyOptions o;
  std::map<std::string, double> mode = {{"gyro", 1}, {"odo", 1}, {"start", 0}, {"st", 0.012}, {"sg", 0.0006}, {"dump", -1}, {"first", 10}, {"last", 110}};
  for (int a = 1; a < argc; ++a) {
    const std::string arg = argv[a];
    const auto eq = arg.find('=');
    if (arg == "paper") { o = SaliencyOptions::paper(); continue; }
    if (eq == std::string::npos) { names = {arg}; continue; }
    const std::string key = arg.substr(0, eq);
    const double value = std::atof(arg.c_str() + eq + 1);
#define OPT(n) if (key == #n) { o.n = static_cast<decltype(o.n)>(value); continue; }
    OPT(sigma_intensity) OPT(sigma_background_px) OPT(sigma_foreground_px) OPT(background_prior) OPT(foreground_mean_zero)
    OPT(linear_flow) OPT(iterations) OPT(levels) OPT(finest_level) OPT(use_rotation_prior) OPT(sample_correlation) OPT(sigma_rotation_pull)
    OPT(use_translation) OPT(near_range) OPT(min_range) OPT(inverse_depths) OPT(window_width_px) OPT(window_height_px)
    OPT(min_parallax_px) OPT(max_frames_apart) OPT(evidence_decay) OPT(near_prior) OPT(evidence_scale) OPT(unknown_below)
    if (!mode.count(key)) { std::printf("? %s\n", key.c_str()); return 1; }
    mode[key] = value;
  }
  for (const auto &name : names) {
    if (!hasFlight(name))
      continue;
    const ForestFlight flight = readForestFlight(name, 0, static_cast<std::size_t>(mode["last"]));
    SaliencyEstimator estimator(flight.camera, o);
    RocCurve roc, known_roc, rho_roc;
    double unknown = 0, n = 0, turn_error = 0, gyro_error = 0, frames = 0, ms = 0, nees = 0, apart = 0, parallax = 0;
    std::vector<double> errors;
    for (std::size_t i = 0; i < flight.size(); ++i) {
      std::optional<RotationPrior> gyro;
      std::optional<TranslationPrior> translation;
      if (i > 0) {
        if (mode["gyro"] > 1)
          gyro = RotationPrior{(flight.wMc_truth(i - 1).inverse() * flight.wMc_truth(i)).R, Eigen::Matrix3d::Identity() * 1e-10};
        else if (mode["gyro"] > 0)
          gyro = RotationPrior{flight.pRc_gyro[i], Eigen::Matrix3d::Identity() * mode["sg"] * mode["sg"]};
        const Pose odo = mode["odo"] > 1 ? flight.wMc_truth(i - 1).inverse() * flight.wMc_truth(i)
                                         : flight.wMc_odometry(i - 1).inverse() * flight.wMc_odometry(i);
        if (mode["odo"] > 0)
          translation = TranslationPrior{odo.t, Eigen::Matrix3d::Identity() * mode["st"] * mode["st"]};
      }
      timespec t0, t1; clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t0);
      const Saliency s = estimator.update(flight.images[i], gyro, translation);
      clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t1); ms += (t1.tv_sec - t0.tv_sec) * 1e3 + (t1.tv_nsec - t0.tv_nsec) * 1e-6;
      if (i < mode["first"])
        continue;
      const Eigen::Matrix3d truth = (flight.wMc_truth(i - 1).inverse() * flight.wMc_truth(i)).R;
      const Eigen::Vector3d e = logSo3(truth.transpose() * s.pRc);
      errors.push_back(e.norm() * 180 / M_PI);
      nees += e.dot(s.covariance.inverse() * e);
      turn_error += e.norm() * 180 / M_PI;
      gyro_error += logSo3(truth.transpose() * flight.pRc_gyro[i]).norm() * 180 / M_PI;
      apart += s.frames_apart;
      parallax += s.parallax_px;
      ++frames;
      if (static_cast<int>(i) == static_cast<int>(mode["dump"])) {
        cv::Mat canvas(480, 960, CV_8UC1, cv::Scalar(0));
        const auto m2 = texturedAboveHorizon(flight.images[i], flight.camera, flight.wMc_truth(i).R);
        for (int v = 0; v < 240; ++v)
          for (int u = 0; u < 320; ++u) {
            canvas.at<unsigned char>(v, u) = flight.images[i][v][u];
            canvas.at<unsigned char>(v, u + 320) = static_cast<unsigned char>(255 * (1 - s.p_background[v][u]));
            canvas.at<unsigned char>(v, u + 640) = static_cast<unsigned char>(255 * std::min(1.f, 1.5f / flight.depths_m[i][v][u]));
            if (!s.inverse_depth.getSize()) continue;
            canvas.at<unsigned char>(v + 240, u + 640) = static_cast<unsigned char>(255 * std::min(1.f, 1.5f * s.inverse_depth[v][u]));
            const bool near = flight.depths_m[i][v][u] < o.near_range;
            canvas.at<unsigned char>(v + 240, u) = m2[v][u] ? (near ? 255 : 120) : 0;
            canvas.at<unsigned char>(v + 240, u + 320) = s.isKnown(v, u) ? 255 : 0;
          }
        cv::imwrite("/tmp/wt/dump_" + name + ".png", canvas);
      }
      const auto mask = texturedAboveHorizon(flight.images[i], flight.camera, flight.wMc_truth(i).R);
      for (unsigned v = 0; v < mask.getHeight(); ++v)
        for (unsigned u = 0; u < mask.getWidth(); ++u)
          if (mask[v][u]) {
            const bool near = flight.depths_m[i][v][u] < o.near_range;
            roc.add(1 - s.p_background[v][u], near);
            ++n;
            if (s.inverse_depth.getSize()) rho_roc.add(s.inverse_depth[v][u] * 1.2f, near);
            if (s.isKnown(v, u))
              known_roc.add(1 - s.p_background[v][u], near);
            else
              ++unknown;
          }
    }
    std::sort(errors.begin(), errors.end());
    std::printf("%-13s AUC %.3f known %.3f rho %.3f unknown %.2f | rot mean %.3f med %.3f p90 %.3f gyro %.3f nees/3 %.2f | apart %.1f par %.1f | %.2f ms\n", name.c_str(),
                roc.area(), known_roc.area(), rho_roc.area(), unknown / n, turn_error / frames, errors[errors.size() / 2], errors[errors.size() * 9 / 10], gyro_error / frames, nees / frames / 3,
                apart / frames, parallax / frames, ms / static_cast<double>(flight.size()));
  }
}
