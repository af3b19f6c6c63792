// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/window_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kLanes = kWindowLanes, kSide = kWindow_px;

/// Rows of an image from pixel (x, y) on, linear between columns; returns how far y is from its row.
template <int kRows> inline float rowsAt(const GreyPlane &image, float x, float y, float *__restrict rows)
{
  const float left = std::floor(x), top = std::floor(y), a = x - left;
  const unsigned char *p =
      image.pixels + static_cast<std::ptrdiff_t>(top) * image.stride + static_cast<std::ptrdiff_t>(left);
  for (int i = 0; i < kRows; ++i, p += image.stride)
#pragma omp simd
    for (int k = 0; k < kLanes; ++k) {
      const float here = static_cast<float>(p[k]), next = static_cast<float>(p[k + 1]);
      rows[i * kLanes + k] = here + a * (next - here);
    }
  return y - top;
}
} // namespace

BOLE_VECTOR_CLONES
void cutWindow(const GreyPlane &image, float x, float y, Window &window)
{
  constexpr int kOuter = kSide + 2, kSize = kSide * kLanes;
  float rows[(kOuter + 1) * kLanes], grey[(kOuter + 1) * kLanes];
  const float b = rowsAt<kOuter + 1>(image, x - 1, y - 1, rows);
  for (int k = 0; k < kOuter * kLanes; ++k)
    grey[k] = rows[k] + b * (rows[k + kLanes] - rows[k]);
  std::fill_n(grey + kOuter * kLanes, kLanes, 0.f);
  // Scharr's derivative, a grey level a pixel
  constexpr float kMiddle = 10.f / 32, kSideways = 3.f / 32;
  float down[kSize + kLanes], across[kSize + kLanes];
  for (int k = 0; k < kSize; ++k) {
    down[k] = kMiddle * grey[k + kLanes] + kSideways * (grey[k] + grey[k + 2 * kLanes]);
    across[k] = grey[k + 2 * kLanes] - grey[k];
  }
  std::fill_n(down + kSize, kLanes, 0.f);
  std::fill_n(across + kSize, kLanes, 0.f);
  float is_inside[kLanes];
#pragma omp simd
  for (int k = 0; k < kLanes; ++k)
    is_inside[k] = k < kSide ? 1.f : 0.f;
  for (int i = 0; i < kSide; ++i)
#pragma omp simd
    for (int k = 0; k < kLanes; ++k) {
      const int at = i * kLanes + k;
      window.grey[at] = grey[at + kLanes + 1];
      window.gradient_x[at] = is_inside[k] * (down[at + 2] - down[at]);
      window.gradient_y[at] = is_inside[k] * (kMiddle * across[at + 1] + kSideways * (across[at] + across[at + 2]));
    }
  float xx = 0, xy = 0, yy = 0;
#pragma omp simd reduction(+ : xx, xy, yy)
  for (int k = 0; k < kSize; ++k) {
    xx += window.gradient_x[k] * window.gradient_x[k];
    xy += window.gradient_x[k] * window.gradient_y[k];
    yy += window.gradient_y[k] * window.gradient_y[k];
  }
  window.xx = xx;
  window.xy = xy;
  window.yy = yy;
}

BOLE_VECTOR_CLONES
void mismatch(const GreyPlane &image, float x, float y, const Window &window, float &by_x, float &by_y)
{
  float rows[(kSide + 1) * kLanes];
  const float b = rowsAt<kSide + 1>(image, x, y, rows);
  float sum_x = 0, sum_y = 0;
#pragma omp simd reduction(+ : sum_x, sum_y)
  for (int k = 0; k < kSide * kLanes; ++k) {
    const float difference = rows[k] + b * (rows[k + kLanes] - rows[k]) - window.grey[k];
    sum_x += difference * window.gradient_x[k];
    sum_y += difference * window.gradient_y[k];
  }
  by_x = sum_x;
  by_y = sum_y;
}

namespace
{
constexpr int kMomentRows = 5;

/// Puts products of Sobel's derivative of one row into the place of those of an older one, in their sums too; each of
/// xx, xy and yy for the columns from 1 to width - 2.
BOLE_VECTOR_CLONES
void replaceRow(const unsigned char *above, const unsigned char *row, const unsigned char *below, int width,
                int *__restrict products, int *__restrict sums)
{
  const auto put = [](int value, int &product, int &sum) {
    sum += value - product;
    product = value;
  };
  for (int j = 1; j < width - 1; ++j) {
    const short x =
        static_cast<short>(above[j + 1] - above[j - 1] + 2 * (row[j + 1] - row[j - 1]) + below[j + 1] - below[j - 1]);
    const short y =
        static_cast<short>(below[j - 1] - above[j - 1] + 2 * (below[j] - above[j]) + below[j + 1] - above[j + 1]);
    put(x * x, products[j], sums[j]);
    put(x * y, products[width + j], sums[width + j]);
    put(y * y, products[2 * width + j], sums[2 * width + j]);
  }
}

/// The smaller eigenvalues of a row from the sums of its columns; \p most: of each column so far.
BOLE_VECTOR_CLONES
void eigenvaluesOfRow(const int *xx, const int *xy, const int *yy, int width, float scale, float *__restrict response,
                      float *__restrict most)
{
  for (int j = kCornerMargin; j < width - kCornerMargin; ++j) {
    const int a = xx[j - 2] + xx[j - 1] + xx[j] + xx[j + 1] + xx[j + 2];
    const int b = xy[j - 2] + xy[j - 1] + xy[j] + xy[j + 1] + xy[j + 2];
    const int c = yy[j - 2] + yy[j - 1] + yy[j] + yy[j + 1] + yy[j + 2];
    const float half_sum = 0.5f * static_cast<float>(a + c), half_difference = 0.5f * static_cast<float>(a - c);
    const float mixed = static_cast<float>(b);
    const float value = scale * (half_sum - std::sqrt(half_difference * half_difference + mixed * mixed));
    response[j] = value;
    most[j] = most[j] > value ? most[j] : value;
  }
}
} // namespace

float cornerResponse(const unsigned char *image, int width, int height, CornerScratch &scratch, float *response)
{
  // Sobel's weights add up to 4 a side, and moments are means over the window's side, as OpenCV has them.
  const double unit = 1.0 / (4 * kMomentRows * 255.0);
  const float scale = static_cast<float>(unit * unit);
  const std::size_t n = 3 * static_cast<std::size_t>(width);
  scratch.products.assign(kMomentRows * n, 0);
  scratch.sums.assign(n, 0);
  scratch.most.assign(static_cast<std::size_t>(width), 0.f);
  const int *sums = scratch.sums.data();
  std::fill_n(response, static_cast<std::ptrdiff_t>(width) * height, 0.f);
  for (int i = 1; i + 1 < height; ++i) {
    const unsigned char *row = image + static_cast<std::ptrdiff_t>(i) * width;
    replaceRow(row - width, row, row + width, width, &scratch.products[static_cast<std::size_t>(i % kMomentRows) * n],
               scratch.sums.data());
    if (i >= kMomentRows) // rows 1 to 5 give row 3
      eigenvaluesOfRow(sums, sums + width, sums + 2 * width, width, scale,
                       response + static_cast<std::ptrdiff_t>(i - 2) * width, scratch.most.data());
  }
  return *std::max_element(scratch.most.begin(), scratch.most.end());
}
} // namespace bole
