// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/gradient.h"

#include "gradient/gradient_loops.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace bole
{
namespace
{
constexpr double kSplitSigma_px = 3; ///< blur of the parts of Eq. 3: the value of the paper

/// A cv::Mat header over the pixels of a vpImage: no copy.
cv::Mat view(vpImage<float> &I)
{
  return cv::Mat(static_cast<int>(I.getRows()), static_cast<int>(I.getCols()), CV_32F, I.bitmap);
}

/// exp(-i^2 / 2 sigma^2) for i from 0 to three sigmas.
std::vector<float> bell(double sigma)
{
  std::vector<float> weights;
  for (int i = 0; i <= static_cast<int>(std::ceil(3 * sigma)); ++i)
    weights.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma))));
  return weights;
}

/// The derivative of \p I along its rows, blurred with \p sigma; a ramp of slope 1 gives \p scale. The edge repeats.
void differentiate(const vpImage<unsigned char> &I, double sigma, double scale, vpImage<float> &out)
{
  const std::vector<float> weights = bell(sigma);
  const int rows = static_cast<int>(I.getRows()), cols = static_cast<int>(I.getCols());
  const int radius = static_cast<int>(weights.size()) - 1;
  double area = weights[0], ramp = 0;
  for (int i = 1; i <= radius; ++i) {
    const double weight = weights[static_cast<std::size_t>(i)];
    area += 2 * weight;
    ramp += 2 * i * i * weight;
  }
  std::vector<float> line(static_cast<std::size_t>(cols + 2 * radius));
  float *blurred = line.data() + radius;
  const auto row = [&](int i) { return I[std::clamp(i, 0, rows - 1)]; };
  for (int i = 0; i < rows; ++i) {
    addPairOfRows(row(i), row(i), static_cast<float>(0.5 * weights[0] / area), true, cols, blurred);
    for (int k = 1; k <= radius; ++k)
      addPairOfRows(row(i - k), row(i + k), static_cast<float>(weights[static_cast<std::size_t>(k)] / area), false,
                    cols, blurred);
    std::fill_n(line.data(), radius, blurred[0]);
    std::fill_n(blurred + cols, radius, blurred[cols - 1]);
    for (int k = 1; k <= radius; ++k)
      addDifferenceAcross(blurred, k, static_cast<float>(scale * k * weights[static_cast<std::size_t>(k)] / ramp),
                          k == 1, cols, out[i]);
  }
}
} // namespace

Gradient computeGradient(const vpImage<unsigned char> &I, const GradientOptions &options)
{
  Gradient gradient;
  gradient.signed_x.resize(I.getRows(), I.getCols());
  differentiate(I, options.sigma_px, 1 / 255.0, gradient.signed_x);

  if (options.split) { // Eq. 3: split first, then blur each part
    const cv::Mat image(static_cast<int>(I.getRows()), static_cast<int>(I.getCols()), CV_8U,
                        const_cast<unsigned char *>(I.bitmap));
    cv::Mat sobel;
    cv::Sobel(image, sobel, CV_32F, 1, 0, 3, 1.0 / (8 * 255.0), 0, cv::BORDER_REPLICATE);
    gradient.negative.resize(I.getRows(), I.getCols());
    gradient.positive.resize(I.getRows(), I.getCols());
    cv::Mat negative = view(gradient.negative), positive = view(gradient.positive);
    cv::GaussianBlur(cv::min(sobel, 0.f), negative, {}, kSplitSigma_px, 0, cv::BORDER_REPLICATE);
    cv::GaussianBlur(cv::max(sobel, 0.f), positive, {}, kSplitSigma_px, 0, cv::BORDER_REPLICATE);
  }
  return gradient;
}
} // namespace bole
