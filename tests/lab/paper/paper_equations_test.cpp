// SPDX-License-Identifier: GPL-2.0-or-later
// The equations of the paper, each against what it says, worked out by brute force: whole images, sums and integrals,
// no short cuts.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "paper/paper_mapper.h"
#include "paper/tree_energy.h"
#include "support/units.h"
#include <bole/smoother.h>

namespace
{
using namespace bole;
using namespace bole::paper;

const PinholeCamera kCamera;
constexpr int kRows = 240, kColumns = 320;

/// A camera with some roll, its nose down, before the trunks of smallWood().
Pose viewpoint() { return Pose(expSo3({0.05, 0.03, 0.1}), {0, 0, 1.2}) * SmootherOptions::forwardCamera(); }

SplitGradient gradientAt(const Pose &wMc)
{
  return splitGradient(test::drawTrunks(kCamera, wMc.inverse(), test::smallWood()));
}

Trunk trunkOf(const Cylinder &cylinder) { return {cylinder.foot.head<2>(), std::log(cylinder.radius)}; }

/// min(0, dI/dx) and max(0, dI/dx) by Sobel, in full scale a pixel, each convolved with a Gaussian of 3 px.
struct BlurredParts
{
  std::vector<double> negative, positive;

  explicit BlurredParts(const vpImage<unsigned char> &image) : negative(kRows * kColumns), positive(negative)
  {
    const auto grey = [&](int v, int u) {
      return image[std::clamp(v, 0, kRows - 1)][std::clamp(u, 0, kColumns - 1)] / 255.0;
    };
    std::vector<double> slope(kRows * kColumns);
    for (int v = 0; v < kRows; ++v)
      for (int u = 0; u < kColumns; ++u)
        for (int k = -1; k <= 1; ++k)
          slope[v * kColumns + u] += (k == 0 ? 2 : 1) * (grey(v + k, u + 1) - grey(v + k, u - 1)) / 8;
    std::array<double, 25> weight;
    double sum = 0;
    for (int k = -12; k <= 12; ++k)
      sum += weight[k + 12] = std::exp(-0.5 * k * k / 9.0);
    for (int v = 0; v < kRows; ++v)
      for (int u = 0; u < kColumns; ++u)
        for (int i = -12; i <= 12; ++i)
          for (int j = -12; j <= 12; ++j) {
            const double there = slope[std::clamp(v + i, 0, kRows - 1) * kColumns + std::clamp(u + j, 0, kColumns - 1)];
            const double w = weight[i + 12] * weight[j + 12] / (sum * sum);
            negative[v * kColumns + u] += w * std::min(0.0, there);
            positive[v * kColumns + u] += w * std::max(0.0, there);
          }
  }
};

/// Sum of \p field over the rows 1 to 238 along the image of the plane through the camera's centre, the vertical and
/// the horizontal direction \p bearing.
double sumAlong(const std::vector<double> &field, const Pose &wMc, double bearing)
{
  const Eigen::Vector3d normal =
      wMc.R.transpose() * Eigen::Vector3d::UnitZ().cross(Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0));
  double sum = 0;
  for (int v = 1; v <= kRows - 2; ++v) {
    const double y = (v - kCamera.cy) / kCamera.fy;
    const double u = kCamera.cx - kCamera.fx * (normal.y() * y + normal.z()) / normal.x();
    const int column = static_cast<int>(u);
    const double *at = &field[v * kColumns + column], t = u - column; // cubic through four pixels
    sum += -t * (t - 1) * (t - 2) / 6 * at[-1] + (t + 1) * (t - 1) * (t - 2) / 2 * at[0] -
           (t + 1) * t * (t - 2) / 2 * at[1] + (t + 1) * t * (t - 1) / 6 * at[2];
  }
  return sum;
}

TEST(PaperEquation3, IsTheSumOfTheBlurredPartsAlongBothBordersTimesAlpha)
{
  const Pose wMc = viewpoint();
  const vpImage<unsigned char> image = test::drawTrunks(kCamera, wMc.inverse(), test::smallWood());
  const SplitGradient gradient = splitGradient(image);
  const BlurredParts parts(image);
  const TreeEnergy energy(gradient, kCamera, kPrintedAlpha);
  for (const std::size_t k : {0, 1, 2}) {
    const Cylinder tree = test::smallWood()[k];
    const Eigen::Vector2d to = tree.foot.head<2>() - wMc.t.head<2>(); // Eq. 6
    const double bearing = std::atan2(to.y(), to.x()), half = std::asin(tree.radius / to.norm());
    const double expected =
        1000 * (sumAlong(parts.negative, wMc, bearing + half) - sumAlong(parts.positive, wMc, bearing - half));
    const double e = energy.evaluate(relativeTrunk(wMc, Pose(), trunkOf(tree)));
    EXPECT_LT(e, 0) << "both borders of a dark tree lower it";
    EXPECT_NEAR(e / expected, 1, 0.005) << k;
  }
}

TEST(PaperEquation9, GradientAndHessianAreTheDifferencesOfTheEnergyItself)
{
  const Pose wMc = viewpoint();
  const SplitGradient gradient = gradientAt(wMc);
  const TreeEnergy energy(gradient, kCamera, kPrintedAlpha);
  const RelativeTrunk centre = relativeTrunk(wMc, Pose(), trunkOf(test::smallWood()[1])).plus({0.002, 0, 0.003, 0.04});
  const Vector4d h = pixelSteps(kCamera, centre);
  const SummaryFactor summary = energy.expand(centre);
  const auto at = [&](double i, int a, double j, int b) {
    return energy.evaluate(centre.plus(0.4 * (i * h(a) * Vector4d::Unit(a) + j * h(b) * Vector4d::Unit(b))));
  };
  const Matrix4d scaled = h.asDiagonal() * summary.F * h.asDiagonal();
  for (int a = 0; a < 4; ++a) {
    EXPECT_NEAR(summary.f(a) * h(a), (at(1, a, 0, a) - at(-1, a, 0, a)) / 0.8,
                0.02 * (h.cwiseProduct(summary.f)).norm());
    for (int b = 0; b < 4; ++b)
      EXPECT_NEAR(scaled(a, b), (at(1, a, 1, b) - at(1, a, -1, b) - at(-1, a, 1, b) + at(-1, a, -1, b)) / 0.64,
                  0.04 * scaled.norm())
          << a << b;
  }
  EXPECT_DOUBLE_EQ(summary.energyAt(centre), energy.evaluate(centre));
}

/// Trees that two images showed differently, by far more than alpha allows, and that a third shows again: the joint
/// problem of a frame as bark and leaves make it.
struct Joint
{
  Graph graph;
  std::vector<std::size_t> trees = {0, 1, 2};
  SplitGradient gradient;
  TreeEnergy energy{gradient, kCamera, kPrintedAlpha};

  /// \p error: of the first guesses and of the earlier views, in parts of what the tests call far.
  Joint(unsigned seed, double error)
  {
    graph.bMc = SmootherOptions::forwardCamera();
    gradient = gradientAt(Pose(Eigen::Matrix3d::Identity(), {0, 0.1, 1.2}) * graph.bMc);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, error);
    const Pose start(Eigen::Matrix3d::Identity(), {-0.3, 0, 1.2});
    graph.poses = {{0, start}};
    graph.pose_priors = {{0, {start, 1e-6 * Matrix6d::Identity()}}};
    if (error > 0.1)
      addPose(Pose(Eigen::Matrix3d::Identity(), {0.1, 0.05, 0}));
    for (const std::size_t k : trees) {
      const Trunk truth = trunkOf(test::smallWood()[k]);
      const Trunk guess =
          truth.plus((Vector5d() << 1.5 * normal(random), normal(random), 0.4 * normal(random), 0, 0).finished());
      graph.trunks.push_back({0, guess, {guess, (Vector5d() << 50, 50, 0.5, 1e-4, 1e-4).finished()}});
      for (std::size_t pose = 0; pose < 2 && error > 0.1; ++pose) {
        SummaryFactor view;
        view.optimum = relativeTrunk(graph.poses[pose].wMb, graph.bMc, truth)
                           .plus(0.02 * Vector4d(normal(random), normal(random), normal(random), 10 * normal(random)));
        view.F = Vector4d(1e4, 1e2, 2.5e7, 2.5e5).asDiagonal(); // 0.04 px
        graph.observations.push_back({pose, k, view});
      }
    }
    addPose(Pose(expSo3({0.003, -0.002, 0.004}), Eigen::Vector3d(-0.02, 0.11, 1.21) - graph.poses.back().wMb.t));
  }

  void addPose(const Pose &aMb)
  {
    const std::size_t next = graph.poses.size();
    graph.poses.push_back({static_cast<std::int64_t>(next), graph.poses.back().wMb * aMb});
    graph.odometry.push_back({next - 1, next, {aMb, 1e-4 * Matrix6d::Identity()}});
  }

  /// Eq. 2 and 4: odometry, priors and summaries are a sum of squares, the current image the energies of its trees.
  double total(const Graph &at) const
  {
    double sum = cost(at);
    for (const std::size_t tree : trees)
      sum += energy.evaluate(relativeTrunk(at.poses.back().wMb, at.bMc, at.trunks[tree].trunk));
    return sum;
  }
};

/// By how much a number lowers the total at best, to second order, where it moves alone: g^2 / 2c.
template <typename Move> double decrement(const Joint &joint, const Graph &graph, const Move &move)
{
  const auto at = [&](double d) {
    Graph moved = graph;
    move(moved, d);
    return joint.total(moved);
  };
  const double here = at(0);
  double h = 1e-7, plus = 0, minus = 0;
  do { // a standard deviation given all others
    h *= 1.5;
    plus = at(h) - here;
    minus = at(-h) - here;
  } while (plus + minus < 1 && h < 1);
  const double slope = (plus - minus) / 2, curvature = plus + minus;
  return 0.5 * slope * slope / curvature;
}

TEST(PaperEquation2, TheEnergiesOfTheNewestImageAndTheGraphOfTheRestAreOptimalTogether)
{
  constexpr double kMost = 0.02; // a fifth of a standard deviation
  for (const double error : {0.05, 0.3}) {
    Joint joint(3, error);
    optimiseJointly(joint.graph, &joint.energy, joint.trees);
    const Graph &graph = joint.graph;
    for (std::size_t i = 0; i < graph.poses.size(); ++i)
      for (int k = 0; k < 6; ++k)
        EXPECT_LT(decrement(joint, graph,
                            [&](Graph &g, double d) { g.poses[i].wMb = g.poses[i].wMb.plus(d * Vector6d::Unit(k)); }),
                  kMost)
            << "pose " << i << ", " << k;
    for (std::size_t j = 0; j < graph.trunks.size(); ++j)
      for (int k = 0; k < 3; ++k)
        EXPECT_LT(
            decrement(joint, graph,
                      [&](Graph &g, double d) { g.trunks[j].trunk = g.trunks[j].trunk.plus(d * Vector5d::Unit(k)); }),
            kMost)
            << "tree " << j << ", " << k;
  }
}

TEST(PaperEquation2, TheJointOptimisationNeverRaisesTheEnergyHoweverFarItStarts)
{
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Joint joint(seed, 1);
    const double before = joint.total(joint.graph);
    optimiseJointly(joint.graph, &joint.energy, joint.trees);
    EXPECT_LE(joint.total(joint.graph), before) << seed;
    EXPECT_EQ(joint.graph.observations.size(), 6u) << "the current image is no summary yet";
    optimiseJointly(joint.graph);
    const Graph &graph = joint.graph;
    for (const Graph::PoseVertex &pose : graph.poses)
      EXPECT_LT(pose.wMb.t.norm(), 100) << seed;
    for (const Graph::TrunkVertex &tree : graph.trunks)
      EXPECT_LT(tree.trunk.xy.norm(), 1000) << seed; // the prior alone holds it within 50 m
  }
}

/// Two images of a texture, the camera turned between them by a little more than what is known at the start.
struct Pair
{
  Eigen::Vector3d start{0.003, 0.0055, 0.0008};
  GreyImage previous, current;

  Pair()
  {
    const auto texture = [](double x, double y) {
      return 128 + 35 * std::sin(0.21 * x + 0.05 * y) + 30 * std::sin(0.17 * y - 0.09 * x) + 25 * std::sin(0.3 * x);
    };
    vpImage<unsigned char> before(kRows, kColumns), now(kRows, kColumns);
    for (int v = 0; v < kRows; ++v)
      for (int u = 0; u < kColumns; ++u) {
        before[v][u] = static_cast<unsigned char>(std::lround(texture(u, v)));
        const double aside = u > 100 && u < 140 ? 2.5 : 0; // something near
        now[v][u] = static_cast<unsigned char>(std::lround(texture(u + 1.4 + aside, v - 0.7)));
      }
    previous = GreyImage(before);
    current = GreyImage(now);
  }

  TurnAndLabels afterOneStep() const { return estimateTurn(previous, current, kCamera, expSo3(start), 1); }
};

double sampled(const vpImage<float> &image, double x, double y)
{
  const int u = static_cast<int>(x), v = static_cast<int>(y);
  const double a = x - u, b = y - v;
  return (1 - b) * ((1 - a) * image[v][u] + a * image[v][u + 1]) +
         b * ((1 - a) * image[v + 1][u] + a * image[v + 1][u + 1]);
}

/// Eq. 14.
Eigen::Matrix<double, 2, 3> flowMatrixAt(int u, int v)
{
  const double x = u - kCamera.cx, y = v - kCamera.cy, f = kCamera.fx;
  Eigen::Matrix<double, 2, 3> V;
  V << x * y, -f * f - x * x, f * y, f * f + y * y, -x * y, -f * x;
  return V / f;
}

/// Residual, gradient and V of a pixel at the turn \p omega: I(t) at u against I(t-1) at u - V omega.
struct Pixel
{
  double residual = 0;
  Eigen::Vector2d gradient, flow;
  Eigen::Matrix<double, 2, 3> V;

  Pixel(const Pair &pair, int u, int v, const Eigen::Vector3d &omega) : V(flowMatrixAt(u, v))
  {
    flow = V * omega;
    const GreyImage &p = pair.previous, &c = pair.current;
    residual = c.grey[v][u] - sampled(p.grey, u - flow.x(), v - flow.y());
    gradient.x() = 0.5 * (sampled(p.by_x, u - flow.x(), v - flow.y()) + c.by_x[v][u]);
    gradient.y() = 0.5 * (sampled(p.by_y, u - flow.x(), v - flow.y()) + c.by_y[v][u]);
  }
};

double normal(double x, double sigma) { return std::exp(-0.5 * x * x / (sigma * sigma)) / sigma; }

/// Eq. 11 by a sum over a grid of image velocities: Eq. 15 times a Gaussian about \p mean.
double integrated(const Pixel &pixel, const Eigen::Vector2d &mean, double sigma, double sigma_intensity)
{
  constexpr int kSteps = 120;
  double sum = 0;
  const double step = 12 * sigma / kSteps;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const Eigen::Vector2d d((i + 0.5) * step - 6 * sigma, (j + 0.5) * step - 6 * sigma);
      const double difference = pixel.residual + pixel.gradient.dot(mean + d - pixel.flow); // Eq. 15
      sum += normal(difference, sigma_intensity) * normal(d.x(), sigma) * normal(d.y(), sigma);
    }
  return sum * step * step;
}

TEST(PaperEquations10To15, LabelsAreTheIntegralsOverAllImageVelocities)
{
  const Pair pair;
  const TurnAndLabels em = pair.afterOneStep();
  const Eigen::Vector3d omega = logSo3(em.pRc);
  int looked = 0, near = 0;
  for (int v = 20; v < 220; v += 23)
    for (int u = 20; u < 300; u += 13) {
      const Pixel pixel(pair, u, v, omega);
      const double b = integrated(pixel, pixel.flow, kBackground_px, kIntensity);
      const double f = integrated(pixel, Eigen::Vector2d::Zero(), kForeground_px, kIntensity);
      if (b < 1e-12 || f < 1e-12)
        continue;
      EXPECT_NEAR(em.log_ratio[v][u], std::log(b / f), 0.02 + 0.01 * std::abs(std::log(b / f))) << u << " " << v;
      ++looked;
      near += b < f;
    }
  EXPECT_GT(looked, 150);
  EXPECT_GT(near, 10) << "both labels must occur";
}

TEST(PaperEquations16And17, TheMStepIsWhereTheExpectedNegativeLogLikelihoodIsLeast)
{
  const Pair pair;
  const TurnAndLabels em = pair.afterOneStep();
  const double intensity2 = kIntensity * kIntensity;
  const auto variance = [&](const Pixel &p, double sigma) {
    return intensity2 + sigma * sigma * p.gradient.squaredNorm();
  };
  std::vector<std::pair<Pixel, double>> pixels; // with their labels at the start
  for (int v = 1; v + 1 < kRows; ++v)
    for (int u = 1; u + 1 < kColumns; ++u) {
      const Eigen::Vector2d from = Eigen::Vector2d(u, v) - flowMatrixAt(u, v) * pair.start;
      if (from.x() < 0 || from.y() < 0 || from.x() >= kColumns - 1 || from.y() >= kRows - 1)
        continue;
      const Pixel p(pair, u, v, pair.start);
      const double sb = std::sqrt(variance(p, kBackground_px));
      const double sf = std::sqrt(variance(p, kForeground_px));
      const double b = normal(p.residual, sb), f = normal(p.residual - p.gradient.dot(p.flow), sf);
      pixels.emplace_back(p, b / std::max(b + f, 1e-300));
    }
  const auto expected = [&](const Eigen::Vector3d &omega) {
    double sum = 0;
    for (const auto &[p, label] : pixels) {
      const double r = p.residual + p.gradient.dot(p.V * (omega - pair.start));
      sum += label * 0.5 * r * r / variance(p, kBackground_px);
    }
    return sum; // a foreground of mean 0 does not depend on omega
  };
  const Eigen::Vector3d found = logSo3(em.pRc);
  EXPECT_GT((found - pair.start).norm(), 5e-4) << "there was something to find";
  for (int k = 0; k < 3; ++k)
    for (const double aside : {-2e-5, 2e-5}) // a hundredth of a pixel is 5e-5
      EXPECT_LT(expected(found), expected(found + aside * Eigen::Vector3d::Unit(k))) << k;
}

TEST(PaperEquations18To21, AreTheProductOfThreeProbabilitiesOfEachLine)
{
  const LineQuartiles quartiles;
  std::mt19937 random(4);
  std::uniform_real_distribution<float> uniform(0, 1);
  SplitGradient gradient; // stripes: every column one value
  gradient.negative.resize(kRows, kColumns);
  gradient.positive.resize(kRows, kColumns);
  vpImage<float> p_background(kRows, kColumns);
  for (int u = 0; u < kColumns; ++u) {
    const float fall = 0.1f * uniform(random), rise = 0.1f * uniform(random), background = 0.3f * uniform(random);
    for (int v = 0; v < kRows; ++v) {
      gradient.negative[v][u] = -fall;
      gradient.positive[v][u] = rise;
      p_background[v][u] = background;
    }
  }
  const Pose level(SmootherOptions::forwardCamera().R, {0, 0, 1.2});
  const std::vector<TakenRange> known = {{-0.2, -0.1}, {0.3, 0.35}};
  const auto found = detectTrees(gradient, p_background, kCamera, level.R, known, quartiles);

  const auto Q = [](double x, double half) { // and nine tenths at 1.2 times of it
    const double a = -std::log(9.0) / (0.2 * half), b = -a * half;
    return 1 / (1 + std::exp(a * x + b));
  };
  const auto probability = [&](const vpImage<float> &part, double q) {
    const double u = kCamera.cx - kCamera.fx * q;
    const int column = static_cast<int>(std::floor(u + 1e-6));
    const double t = std::max(0.0, u - column);
    const auto mean = [&](const vpImage<float> &field) {
      return (1 - t) * field[100][column] + t * field[100][std::min(column + 1, kColumns - 1)];
    };
    double inhibited = 0;
    for (const TakenRange &tree : known) {
      const double d = kCamera.fx * std::max({0.0, q - tree.q_high, tree.q_low - q});
      inhibited += std::exp(-0.5 * d * d / 36); // sigma_R = 6 px
    }
    return Q(std::abs(mean(part)), quartiles.gradient) *     // Eq. 19
           Q(1 - mean(p_background), quartiles.foreground) * // Eq. 20
           (1 - std::min(1.0, inhibited));                   // Eq. 21
  };
  ASSERT_FALSE(found.empty());
  std::vector<TakenRange> taken;
  for (const NewTree &pair : found) {
    const Eigen::Vector3d axis = level.R * pair.relative.cRt.col(0);
    const double bearing = std::atan2(axis.y(), axis.x()), half = std::asin(pair.relative.ratio());
    const double q_left = std::tan(bearing + half), q_right = std::tan(bearing - half);
    EXPECT_NEAR(pair.p_left, probability(gradient.negative, q_left), 1e-3);
    EXPECT_NEAR(pair.p_right, probability(gradient.positive, q_right), 1e-3);
    EXPECT_GE(std::min(pair.p_left, pair.p_right), 0.75); // the threshold of the paper
    for (const TakenRange &other : taken)
      EXPECT_FALSE(q_left > other.q_low + 1e-6 && q_right < other.q_high - 1e-6) << "two trees in one place";
    taken.push_back({q_right, q_left});
  }
}
} // namespace
