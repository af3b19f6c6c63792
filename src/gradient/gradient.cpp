// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/gradient.h"

#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
/// A cv::Mat header over the pixels of a vpImage: no copy.
cv::Mat view(vpImage<float> &I)
{
  return cv::Mat(static_cast<int>(I.getRows()), static_cast<int>(I.getCols()), CV_32F, I.bitmap);
}

/// Kernel of the derivative of a Gaussian whose response to a ramp of slope 1 is 1.
cv::Mat derivativeKernel(double sigma, int radius)
{
  cv::Mat kernel(1, 2 * radius + 1, CV_32F);
  double ramp = 0;
  for (int i = -radius; i <= radius; ++i) {
    kernel.at<float>(i + radius) = static_cast<float>(i * std::exp(-0.5 * i * i / (sigma * sigma)));
    ramp += i * kernel.at<float>(i + radius);
  }
  return kernel / ramp;
}

} // namespace

Gradient computeGradient(const vpImage<unsigned char> &I, const GradientOptions &options)
{
  const int rows = static_cast<int>(I.getRows()), cols = static_cast<int>(I.getCols());
  const cv::Mat image(rows, cols, CV_8U, const_cast<unsigned char *>(I.bitmap));

  Gradient gradient;
  gradient.signed_x.resize(I.getRows(), I.getCols());
  cv::Mat signed_x = view(gradient.signed_x);
  const int radius = static_cast<int>(std::ceil(3 * options.sigma_px));
  cv::sepFilter2D(image, signed_x, CV_32F, derivativeKernel(options.sigma_px, radius) / 255.0,
                  cv::getGaussianKernel(2 * radius + 1, options.sigma_px, CV_32F), {-1, -1}, 0, cv::BORDER_REPLICATE);
  return gradient;
}
} // namespace bole
