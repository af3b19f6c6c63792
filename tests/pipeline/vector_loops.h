// SPDX-License-Identifier: GPL-2.0-or-later
// No guard: included once for the loops of the library and once for those compiled for the least machine.
// Everything that the loops over pixels give on made-up images.

#include "detection/column_loops.h"
#include "detection/window_loops.h"
#include "gradient/line_loops.h"
#include "motion/epipolar_loops.h"
#include "motion/window_loops.h"
#include "saliency/saliency_loops.h"
#include "smoothing/front_loops.h"
#include "tracking/tracking_loops.h"

#include <cmath>
#include <cstddef>
#include <vector>

namespace bole
{
class LoopOutputs
{
public:
  LoopOutputs()
  {
    for (std::size_t i = 0; i < kPixels; ++i) {
      const double x = static_cast<double>(i % kWidth), y = static_cast<double>(i / kWidth);
      const double value = 0.5 + 0.2 * std::sin(0.31 * x + 0.05 * y) + 0.2 * std::cos(0.17 * y - 0.02 * x * y / kWidth);
      m_image.push_back(static_cast<float>(value));
      m_grey.push_back(static_cast<unsigned char>(255 * value));
    }
    saliency();
    points();
    front();
    lines();
    window();
    columns();
  }
  const std::vector<double> &all() const { return m_all; }

private:
  static constexpr int kWidth = 61, kHeight = 47;
  static constexpr std::size_t kPixels = static_cast<std::size_t>(kWidth) * kHeight;

  template <typename Numbers> void keep(const Numbers &numbers)
  {
    for (const auto number : numbers)
      m_all.push_back(static_cast<double>(number));
  }

  void saliency()
  {
    std::vector<float> rho, prior, is_near, flow;
    for (int k = 0; k < kInverseDepths; ++k) {
      rho.push_back(0.002f * static_cast<float>(k * k));
      prior.push_back(-2.f - 0.05f * static_cast<float>(k));
      is_near.push_back(k > 9 ? 1.f : 0.f);
      flow.push_back(0.2f + 0.01f * static_cast<float>(k * k));
    }
    const RowWarp warp{{-3.3f, 20.4f, 1.01f}, {1.01f, 0.01f, -0.0003f}, {30.f, -4.f, 0.4f}, rho.data(),
                       kWidth - 1.001f,       kHeight - 1.001f};
    const std::size_t n = static_cast<std::size_t>(kWidth) * kInverseDepths;
    std::vector<float> residuals(n), means(n), sum(n), moved(n), evidence(n * 24), odds(kWidth), squares(kWidth, 0.02f);
    squaredResidualsOfRow(warp, m_image.data(), kWidth, m_image.data() + 20 * kWidth, kWidth, 1, residuals.data());
    keep(residuals);
    slidingMeans(residuals.data(), (kWidth - 2) * kInverseDepths, kInverseDepths, 3, means.data());
    keep(means);
    std::vector<float> down(kPixels), across(kWidth);
    meansDownColumns(m_image.data(), kHeight, kWidth, 5, sum.data(), down.data());
    keep(down);
    squaresOfRow(m_image.data(), m_image.data() + 9, kWidth, across.data());
    keep(across);
    for (const bool is_relative : {false, true})
      addLikelihoods({0.005f, 6.25f, flow.data(), 2.5f, is_relative}, squares.data(), means.data(), kWidth,
                     evidence.data() + 11 * n);
    keep(evidence);
    movedEvidenceOfRow(warp, evidence.data(), 24, 0.5f, kWidth, 0.8f, moved.data());
    keep(moved);
    logOddsOfEvidence(evidence.data() + 11 * n, prior.data(), is_near.data(), kWidth, odds.data());
    keep(odds);

    ColumnsBetween columns;
    for (int j = 0; j < kWidth; ++j) {
      columns.left.push_back(j / 2);
      columns.share.push_back(j % 2 == 0 ? 0.25f : 0.75f);
    }
    std::vector<float> p(kWidth), confidence(kWidth), scratch;
    m_all.push_back(labelsOfRow(odds.data(), m_image.data(), 0.3f, columns, -0.8f, 0.7f, p.data(), confidence.data()));
    keep(p);
    keep(confidence);

    std::vector<float> half(kWidth / 2);
    halvedRow(m_grey.data(), m_grey.data() + kWidth, kWidth / 2, half.data());
    keep(half);
    halvedRow(m_image.data(), m_image.data() + kWidth, kWidth / 2, half.data());
    keep(half);

    std::vector<float> gradient_x(kWidth), gradient_y(kWidth);
    gradientsOfRow(m_image.data(), m_image.data() + kWidth, m_image.data() + 2 * kWidth, kWidth, 0.5f,
                   gradient_x.data(), gradient_y.data());
    keep(gradient_x);
    keep(gradient_y);

    std::vector<float> ratio(kWidth, 0.f);
    const float *image = m_image.data();
    const RotationRow row{{image, image + 1, image + kWidth},
                          {image + 20 * kWidth, image + 7, image + 90},
                          20,
                          kWidth,
                          kHeight - 2,
                          50.f,
                          51.f,
                          30.f,
                          -0.06f,
                          {0.4f, 20.3f, 1.f},
                          {1.01f, 0.003f, 1e-4f},
                          {0.3f, 4.f, 4e-4f, 0.8f}};
    const RotationSums sums = sumsOfRow(row, 0.01f, scratch, ratio.data());
    keep(sums.H);
    keep(sums.g);
    keep(std::vector<float>{sums.used, sums.textured});
    keep(ratio);
  }

  void front()
  {
    constexpr int kRows = 23;
    for (const int columns : {5, 6}) {
      std::vector<double> front(kRows * (kRows - 1));
      for (int c = 0; c + 1 < kRows; ++c)
        for (int r = c; r < kRows; ++r)
          front[static_cast<std::size_t>(c * kRows + r)] = r == c ? 3 : std::sin(0.7 * r + 1.3 * c) / kRows;
      m_all.push_back(factorFront(front.data(), kRows, columns));
      keep(front);
    }
  }

  void points()
  {
    CornerScratch scratch;
    std::vector<float> response(kPixels);
    m_all.push_back(cornerResponse(m_grey.data(), kWidth, kHeight, scratch, response.data()));
    std::vector<unsigned char> is_peak(kWidth, 0);
    for (int row = kCornerMargin; row < kHeight - kCornerMargin; ++row) {
      peaksOfRow(response.data() + row * kWidth, kWidth, 1e-5f, is_peak.data());
      keep(is_peak);
    }
    keep(response);
    const GreyPlane plane{m_grey.data(), kWidth, kWidth, kHeight};
    Window window;
    cutWindow(plane, 20.3f, 17.8f, window);
    keep(std::vector<float>{window.xx, window.xy, window.yy});
    float x, y;
    mismatch(plane, 20.9f, 17.1f, window, x, y);
    keep(std::vector<float>{x, y});

    motion::RayColumns rays;
    for (int i = 0; i < 37; ++i) {
      rays.ax.push_back(0.6 * std::sin(1.7 * i));
      rays.ay.push_back(0.4 * std::cos(2.9 * i));
      rays.bx.push_back(rays.ax.back() + 0.01 * std::sin(0.3 * i));
      rays.by.push_back(rays.ay.back() + 0.02 * std::cos(5.1 * i));
    }
    const motion::EpipolarTerms terms{{0.01, -0.9, 0.1, 0.88, 0.02, -0.3, -0.1, 0.31, 0.01},
                                      {1, 0.01, -0.02, -0.01, 1, 0.03, 0.02, -0.03, 1},
                                      {0.3, 0.1, 0.9, -0.9, 0.2, 0.3},
                                      0.01,
                                      3,
                                      0.04};
    m_all.push_back(costOfMatches(rays, terms));
    motion::EpipolarTerms sheared = terms;
    sheared.shear = 0.03;
    const motion::ShearSums by_shear = shearSumsOfMatches(rays, sheared);
    m_all.insert(m_all.end(), by_shear.H, by_shear.H + 21);
    m_all.insert(m_all.end(), by_shear.g, by_shear.g + 6);
    std::vector<double> residuals(rays.ax.size());
    residualsOfMatches(rays, sheared, residuals.data());
    keep(residuals);
    const double direction[] = {0.1, -0.2, 0.97};
    const motion::FlowSums flow = flowSumsOfMatches(rays, terms, direction);
    keep(std::vector<double>{flow.along, flow.across, flow.sum, flow.agreement, flow.squares});
    const double rotation[] = {1, -0.01, 0.02, 0.01, 1, -0.03, -0.02, 0.03, 1};
    std::vector<double> transfers(2 * rays.ax.size()), weights(rays.ax.size());
    transferResiduals(rays, {rotation, 3}, transfers.data());
    const motion::TransferSums by_turn = sumsOfTransfers(rays, {rotation, 3}, transfers.data(), 1e-3, weights.data());
    keep(transfers);
    keep(weights);
    keep(by_turn.H);
    keep(by_turn.g);
    const motion::EpipolarSums sums = sumsOfMatches(rays, terms);
    keep(sums.H);
    keep(sums.g);
  }

  void lines()
  {
    for (const double slope : {0.0, 0.21, -0.7}) {
      const LineSamples line{m_image.data(), kWidth, kHeight, 20.7, slope};
      const CubicSums sums = cubicSumsAlong(line);
      std::vector<float> whole(16), between(16);
      m_all.push_back(
          addAcrossRows({m_image.data(), kWidth, kHeight, 20.7, slope}, 0, 16, 7, whole.data(), between.data()));
      keep(whole);
      keep(between);
      const LinearSums beside = linearSumsBeside(line);
      keep(std::vector<double>{sums.value, sums.slope, sums.slope_by_row, linearSumAlong(line), beside.left,
                               beside.middle, beside.right});
    }
    PatchSums bark;
    addPatchRow(m_grey.data() + 3, m_image.data(), kWidth - 9, bark);
    keep(std::vector<double>{bark.sum, bark.square, bark.product});
  }

  void window()
  {
    ViewColumns views;
    for (int i = 0; i < 19; ++i) {
      const float step = static_cast<float>(i), heading = 0.01f * step;
      views.x.push_back(0.1f * step);
      views.y.push_back(0.02f * step * step);
      views.forward_x.push_back(std::cos(heading));
      views.forward_y.push_back(std::sin(heading));
      views.left_x.push_back(-std::sin(heading));
      views.left_y.push_back(std::cos(heading));
      views.q_first.push_back(-0.8f);
      views.q_last.push_back(0.8f);
      views.by_step.push_back(50);
      views.first_sample.push_back(81 * i);
      for (int k = 0; k <= 80; ++k) {
        views.rising_peak.push_back(k % 11 == 3 ? std::nanf("")
                                                : -0.8f + 0.02f * static_cast<float>(k) + 0.001f * step);
        views.falling_peak.push_back(-0.8f + 0.02f * static_cast<float>(k) - 0.002f * step);
      }
    }
    const BorderSums sums = sumsOfBorders(views, {4.1f, 0.7f, 0.21f, true, false}, 200, 30);
    keep(sums.H);
    keep(sums.g);
    keep(std::vector<float>{sums.views, sums.inliers, sums.squares});
    std::vector<float> ranges, sum(80), counts(80), scores(80);
    for (int i = 0; i < 80; ++i)
      ranges.push_back(1 / (0.08f + 0.007f * static_cast<float>(i)));
    const SweptView swept{0.3f, 0.98f, 0.1f, 0.12f, -0.5f, 30.f, m_image.data(), 31};
    addAgreement(swept, 1.4f, ranges.data(), 80, sum.data(), counts.data());
    keep(sum);
    keep(counts);
    m_all.push_back(scoresOfPair({sum.data(), counts.data()}, {sum.data(), counts.data()}, 80, 1, scores.data()));
    keep(scores);
    m_all.push_back(static_cast<double>(sumOfRow(m_image.data() + 5, 203)));
  }

  void columns()
  {
    LevelColumn column;
    OtherColumns other{-0.8f, 37.f, kWidth, {}, {}, {-0.4f, -0.1f, 0.1f, 0.4f}};
    for (std::size_t b = 0; b < kLevelBands; ++b) {
      column.value[b] = b == 2 ? std::nanf("") : 0.4f + 0.1f * static_cast<float>(b);
      column.slope[b] = 0.02f * static_cast<float>(b);
      other.value[b] = m_image.data() + 2 * b * kWidth;
      other.slope[b] = m_image.data() + (2 * b + 1) * kWidth;
    }
    const CarriedColumn carried{-0.2f, 0.98f, 0.3f, 0.18f, 0.01f, 0.05f, 0.2f, 0.22f, 4.f};
    std::vector<float> ranges, differences(11);
    for (int i = 0; i < 11; ++i)
      ranges.push_back(0.1f * std::pow(1.6f, static_cast<float>(i)));
    differencesAtRanges(column, carried, other, 9.f, 7.f, ranges.data(), 11, differences.data());
    keep(differences);
  }

  std::vector<float> m_image;
  std::vector<unsigned char> m_grey;
  std::vector<double> m_all;
};
} // namespace bole
