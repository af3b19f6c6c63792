// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/forest_flight.h"
#include "support/roc.h"

#include "saliency/saliency.h"

#include <gtest/gtest.h>

namespace bole
{
namespace
{
TEST(Saliency, TellsNearFromFarOnARenderedFlight)
{
  if (!support::hasFlight("park-forward"))
    GTEST_SKIP() << "the rendered flights are not here: " << BOLE_SHARED_DATA_DIR;
  const support::ForestFlight flight = support::readForestFlight("park-forward", 0, 110);
  SaliencyEstimator estimator(flight.camera);
  support::RocCurve roc;
  double worst_turn = 0;
  for (std::size_t i = 0; i < flight.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0;
    const Eigen::Vector3d pt = (flight.wMc_odometry(before).inverse() * flight.wMc_odometry(i)).t;
    const Saliency saliency =
        estimator.update(flight.images[i], RotationPrior{flight.pRc_gyro[i], Eigen::Matrix3d::Identity() * 3.6e-7},
                         TranslationPrior{pt, Eigen::Matrix3d::Identity() * 2.9e-4});
    if (i < 10)
      continue;
    const Eigen::Matrix3d pRc = (flight.wMc_truth(before).inverse() * flight.wMc_truth(i)).R;
    worst_turn = std::max(worst_turn, logSo3(pRc.transpose() * saliency.pRc).norm());
    const auto mask = support::texturedAboveHorizon(flight.images[i], flight.camera, flight.wMc_truth(i).R);
    for (unsigned p = 0; p < mask.getSize(); ++p)
      if (mask.bitmap[p])
        roc.add(1 - saliency.p_background.bitmap[p], flight.depths_m[i].bitmap[p] < 6);
  }
  EXPECT_GT(roc.area(), 0.88);
  EXPECT_LT(worst_turn, 0.003); // 0.17 degrees
}
} // namespace
} // namespace bole
