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
constexpr int kWeightBits = 14, kGreyBits = 5; // of the weights of four pixels, and below a grey level

/// A place between four pixels: the first of them, and their weights.
struct Between
{
  Between(const GreyPlane &image, float x, float y)
      : left(static_cast<int>(std::floor(x))),
        top(static_cast<int>(std::floor(y))),
        pixel(image.pixels + top * image.stride + left)
  {
    const float a = x - static_cast<float>(left), b = y - static_cast<float>(top), unit = 1 << kWeightBits;
    w00 = static_cast<int>(std::lrint((1 - a) * (1 - b) * unit));
    w01 = static_cast<int>(std::lrint(a * (1 - b) * unit));
    w10 = static_cast<int>(std::lrint((1 - a) * b * unit));
    w11 = (1 << kWeightBits) - w00 - w01 - w10;
  }

  int left, top;
  const unsigned char *pixel;
  int w00, w01, w10, w11;
};

constexpr int rounded(int value, int bits) { return (value + (1 << (bits - 1))) >> bits; }

/// Rows of pixels, a line of lanes each, and zeros after them.
template <int kRows> inline void copyRows(const unsigned char *pixels, std::ptrdiff_t stride, int *__restrict rows)
{
  for (int i = 0; i < kRows; ++i, pixels += stride)
#pragma omp simd
    for (int k = 0; k < kLanes; ++k)
      rows[i * kLanes + k] = pixels[k];
  std::fill_n(rows + kRows * kLanes, kLanes, 0);
}
} // namespace

BOLE_VECTOR_CLONES
void cutWindow(const GreyPlane &image, float x, float y, Window &window)
{
  constexpr int kOuter = kSide + 1, kSize = kSide * kLanes, kOuterSize = kOuter * kLanes;
  const Between at(image, x, y);
  int raw[(kOuter + 3) * kLanes]; // from the pixel before the first on
  copyRows<kOuter + 2>(at.pixel - image.stride - 1, image.stride, raw);
  int down[kOuterSize + kLanes], across[kOuterSize + kLanes];
  for (int k = 0; k < kOuterSize; ++k) {
    down[k] = 3 * (raw[k] + raw[k + 2 * kLanes]) + 10 * raw[k + kLanes];
    across[k] = raw[k + 2 * kLanes] - raw[k];
  }
  std::fill_n(down + kOuterSize, kLanes, 0);
  std::fill_n(across + kOuterSize, kLanes, 0);
  int is_column[kLanes], is_lane[kLanes];
  for (int k = 0; k < kLanes; ++k) {
    is_column[k] = at.left + k >= 0 && at.left + k < image.width ? 1 : 0;
    is_lane[k] = k < kSide ? 1 : 0;
  }
  int dx[kOuterSize + kLanes], dy[kOuterSize + kLanes]; // Scharr's derivatives
  for (int i = 0; i < kOuter; ++i) {
    const int is_row = at.top + i >= 0 && at.top + i < image.height ? 1 : 0;
#pragma omp simd
    for (int k = 0; k < kLanes; ++k) {
      const int j = i * kLanes + k, is_inside = is_row * is_column[k];
      dx[j] = is_inside * (down[j + 2] - down[j]);
      dy[j] = is_inside * (3 * (across[j] + across[j + 2]) + 10 * across[j + 1]);
    }
  }
  std::fill_n(dx + kOuterSize, kLanes, 0);
  std::fill_n(dy + kOuterSize, kLanes, 0);
  for (int i = 0; i < kSide; ++i)
#pragma omp simd
    for (int k = 0; k < kLanes; ++k) {
      const int j = i * kLanes + k;
      const int *p = raw + kLanes + 1;
      window.grey[j] = rounded(p[j] * at.w00 + p[j + 1] * at.w01 + p[j + kLanes] * at.w10 + p[j + kLanes + 1] * at.w11,
                               kWeightBits - kGreyBits);
      window.gradient_x[j] = is_lane[k] * rounded(dx[j] * at.w00 + dx[j + 1] * at.w01 + dx[j + kLanes] * at.w10 +
                                                      dx[j + kLanes + 1] * at.w11,
                                                  kWeightBits);
      window.gradient_y[j] = is_lane[k] * rounded(dy[j] * at.w00 + dy[j + 1] * at.w01 + dy[j + kLanes] * at.w10 +
                                                      dy[j + kLanes + 1] * at.w11,
                                                  kWeightBits);
    }
  float xx = 0, xy = 0, yy = 0;
#pragma omp simd reduction(+ : xx, xy, yy)
  for (int k = 0; k < kSize; ++k) {
    xx += static_cast<float>(window.gradient_x[k] * window.gradient_x[k]);
    xy += static_cast<float>(window.gradient_x[k] * window.gradient_y[k]);
    yy += static_cast<float>(window.gradient_y[k] * window.gradient_y[k]);
  }
  window.xx = xx;
  window.xy = xy;
  window.yy = yy;
}

BOLE_VECTOR_CLONES
void mismatch(const GreyPlane &image, float x, float y, const Window &window, float &by_x, float &by_y)
{
  const Between at(image, x, y);
  const int w00 = at.w00, w01 = at.w01, w10 = at.w10, w11 = at.w11;
  int rows[(kSide + 2) * kLanes];
  copyRows<kSide + 1>(at.pixel, image.stride, rows);
  float sum_x = 0, sum_y = 0;
#pragma omp simd reduction(+ : sum_x, sum_y)
  for (int k = 0; k < kSide * kLanes; ++k) {
    const int difference =
        rounded(rows[k] * w00 + rows[k + 1] * w01 + rows[k + kLanes] * w10 + rows[k + kLanes + 1] * w11,
                kWeightBits - kGreyBits) -
        window.grey[k];
    sum_x += static_cast<float>(difference * window.gradient_x[k]);
    sum_y += static_cast<float>(difference * window.gradient_y[k]);
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
  const auto clear = [&](int row, int from, int to) {
    float *at = response + static_cast<std::ptrdiff_t>(row) * width;
    std::fill(at + from, at + to, 0.f);
  };
  for (int i = 0; i < height; ++i) { // what no window fits round
    const bool is_inside = i >= kCornerMargin && i < height - kCornerMargin && width > 2 * kCornerMargin;
    clear(i, 0, is_inside ? kCornerMargin : width);
    clear(i, is_inside ? width - kCornerMargin : width, width);
  }
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

BOLE_VECTOR_CLONES
void peaksOfRow(const float *row, int width, float threshold, unsigned char *__restrict is_peak)
{
  const float *above = row - width, *below = row + width;
  for (int j = 1; j < width - 1; ++j) {
    const auto larger = [](float a, float b) { return a > b ? a : b; };
    const float most_above = larger(larger(above[j - 1], above[j]), above[j + 1]);
    const float most_below = larger(larger(below[j - 1], below[j]), below[j + 1]);
    const float most = larger(larger(most_above, most_below), larger(row[j - 1], row[j + 1]));
    is_peak[j] = (row[j] > threshold) & (row[j] >= most) ? 1 : 0;
  }
}
} // namespace bole
