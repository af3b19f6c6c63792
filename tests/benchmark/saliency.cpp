// SPDX-License-Identifier: GPL-2.0-or-later
// Cost of a frame, and area under the ROC curve of "nearer than 6 m" on the rendered flights (as counters), for what
// may be known of the motion.
#include "support/forest_flight.h"
#include "support/roc.h"

#include "geometry/so3.h"
#include "saliency/saliency.h"

#include <benchmark/benchmark.h>
#include <string>

namespace
{
using namespace bole;

const char *const kFlights[] = {"park-forward", "winter-weave", "pine-arc"};
enum Mode
{
  odometry_and_gyro,
  gyro_alone,
  images_alone
};

/// One whole pass over frames 0 to 110 an iteration; figures are of frames 10 to 110.
void fly(benchmark::State &state, const char *name, Mode mode, SaliencyOptions options, const std::string &label)
{
  if (!support::hasFlight(name)) {
    state.SkipWithError("the rendered flights are not here");
    return;
  }
  const support::ForestFlight flight = support::readForestFlight(name, 111);
  options.near_range = 6;
  support::RocCurve roc, known_roc;
  double turn_error = 0, frames = 0;
  for (auto _ : state) {
    SaliencyEstimator estimator(flight.camera, options);
    for (std::size_t i = 0; i < flight.size(); ++i) {
      std::optional<RotationPrior> gyro;
      std::optional<TranslationPrior> translation;
      if (i > 0 && mode != images_alone)
        gyro = RotationPrior{flight.pRc_gyro[i], Eigen::Matrix3d::Identity() * 3.6e-7};
      if (i > 0 && mode == odometry_and_gyro)
        translation = TranslationPrior{(flight.wMc_odometry(i - 1).inverse() * flight.wMc_odometry(i)).t,
                                       Eigen::Matrix3d::Identity() * 2.9e-4};
      const Saliency saliency = estimator.update(flight.images[i], gyro, translation);
      state.PauseTiming();
      if (i >= 10) {
        const Eigen::Matrix3d truth = (flight.wMc_truth(i - 1).inverse() * flight.wMc_truth(i)).R;
        turn_error += logSo3(truth.transpose() * saliency.pRc).norm() * 180 / M_PI;
        ++frames;
        const auto mask = support::texturedAboveHorizon(flight.images[i], flight.camera, flight.wMc_truth(i).R);
        for (unsigned p = 0; p < mask.getSize(); ++p) {
          if (!mask.bitmap[p])
            continue;
          const bool near = flight.depths_m[i].bitmap[p] < 6;
          roc.add(1 - saliency.p_background.bitmap[p], near);
          if (saliency.confidence.bitmap[p] >= kUnknownBelow)
            known_roc.add(1 - saliency.p_background.bitmap[p], near);
        }
      }
      state.ResumeTiming();
    }
  }
  state.SetLabel(std::string(name) + ", " + label);
  state.counters["auc"] = roc.area();
  state.counters["auc_known"] = known_roc.area();
  state.counters["unknown"] = 1 - static_cast<double>(known_roc.count()) / static_cast<double>(roc.count());
  state.counters["turn_error_deg"] = turn_error / frames;
  state.counters["frames/s"] = benchmark::Counter(
      static_cast<double>(state.iterations()) * static_cast<double>(flight.size()), benchmark::Counter::kIsRate);
}

void flySaliency(benchmark::State &state)
{
  const char *const modes[] = {"odometry and gyro", "gyro alone", "images alone"};
  const auto mode = static_cast<Mode>(state.range(1));
  fly(state, kFlights[state.range(0)], mode, SaliencyOptions(), modes[mode]);
}
BENCHMARK(flySaliency)
    ->ArgsProduct({{0, 1, 2}, {odometry_and_gyro, gyro_alone, images_alone}})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);
} // namespace

BENCHMARK_MAIN();
