// SPDX-License-Identifier: GPL-2.0-or-later
// The paper's claim: past views are kept without baking in a linearisation. A trunk of twice the
// prior's radius, so at twice the range first believed, seen while the baseline widens: summary
// factors against the same views linearised once, at the estimate of their time (Gaussian factors
// in x, y, log r). benchmark_smoothing_linearisation [curves.csv]
#include "smoothing/factors.h"
#include "support/curves.h"
#include "support/dense_reference.h"

#include <bole/smoother.h>

#include <fmt/core.h>
#include <random>

int main(int argc, char **argv)
{
  using namespace bole;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  SmootherOptions options;
  options.summary_loss.kind = LossKind::quadratic;
  options.prior_lean_sigma = 1e-3;
  Trunk truth;
  truth.xy << 8, 0;
  truth.log_radius = std::log(2 * options.prior_radius);
  const Vector4d sigma(0.003, 0.05, 0.003, 0.1);
  const Matrix6d known = 1e-10 * Matrix6d::Identity();

  Smoother smoother(options);
  Trunk once; // the linearised estimate: information H about the point `once`
  Matrix5d H;
  Vector5d gradient;
  test::Curve by_summary, by_once, by_batch, exact;
  fmt::print("baseline  range by summaries, batch, linearised once (truth 8 m)\n");
  for (int i = 0; i <= 60; ++i) {
    Pose wMb;
    wMb.t << 0, 0.05 * i, 1.5;
    if (i == 0)
      smoother.addFirstPose(wMb, known);
    else
      smoother.addPose(Pose(Eigen::Matrix3d::Identity(), {0, 0.05, 0}), known, wMb);
    SummaryFactor view;
    Vector4d noise;
    for (int k = 0; k < 4; ++k)
      noise(k) = sigma(k) * normal(random);
    view.optimum = relativeTrunk(wMb, options.bMc, truth).plus(noise);
    view.F = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    if (i == 0) {
      once = trunkFromRelative(wMb * options.bMc, view.optimum, options.prior_radius);
      smoother.addTrunk(once);
      H = Vector5d(1 / 2500., 1 / 2500., std::pow(options.prior_log_radius_sigma, -2), 1e6, 1e6).asDiagonal();
    }
    smoother.addObservation(i, 0, view);
    smoother.update();

    SquareRootSummary root;
    squareRoot(view, root);
    Matrix46d J_pose;
    Matrix45d J;
    const Vector4d r = residual(root, options.bMc, wMb, once, &J_pose, &J);
    H += J.transpose() * J;
    gradient = J.transpose() * r;
    once = once.plus(-H.llt().solve(gradient));

    test::DenseReference batch(smoother.graph());
    batch.solve();
    const double b = 0.05 * i, range = smoother.trunk(0).xy.norm(),
                 range_batch = batch.graph().trunks[0].trunk.xy.norm();
    by_summary.emplace_back(b, range);
    by_batch.emplace_back(b, range_batch);
    by_once.emplace_back(b, once.xy.norm());
    exact.emplace_back(b, 8);
    if (i % 10 == 0)
      fmt::print("{:4.1f} m    {:.3f}  {:.3f}  {:.3f} m, radius {:.3f}  {:.3f}  {:.3f} m\n", b, range, range_batch,
                 once.xy.norm(), smoother.trunk(0).radius(), batch.graph().trunks[0].trunk.radius(), once.radius());
  }
  if (argc > 1)
    test::writeCurves(
        argv[1], "A trunk at twice the range first believed", "baseline [m]", "range [m]",
        {{"truth", exact}, {"batch optimum", by_batch}, {"summary factors", by_summary}, {"linearised once", by_once}});
}
