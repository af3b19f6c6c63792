// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/window_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kLanes = kWindowLanes, kSide = kWindow_px;
constexpr int kGreyBits = 7;     // below a grey level while it is interpolated: what 16 bits leave
constexpr int kGradientBits = 2; // the same of a gradient
constexpr int kWindowBits = 5;   // of a grey level in a window, as OpenCV has it

/// A place between four pixels: the first of them, and how far it is on to the next, of 2^15 - 1.
struct Between
{
  Between(const GreyPlane &image, float x, float y)
      : left(static_cast<int>(std::floor(x))),
        top(static_cast<int>(std::floor(y))),
        pixel(image.pixels + top * image.stride + left),
        right_share(shareOf(x - static_cast<float>(left))),
        lower_share(shareOf(y - static_cast<float>(top)))
  {
  }
  static short shareOf(float part) { return static_cast<short>(32767.f * part + 0.5f); }

  int left, top;
  const unsigned char *pixel;
  short right_share, lower_share;
};

/// a + share (b - a), which has 16 bits. Rounded as the one instruction does that AVX2 has for it.
inline short mixed(short a, short b, short share)
{
  const short apart = static_cast<short>(b - a), part = static_cast<short>((((apart * share) >> 14) + 1) >> 1);
  return static_cast<short>(a + part);
}

inline short rounded(short value, int bits)
{
  const short raised = static_cast<short>(value + (1 << (bits - 1)));
  return static_cast<short>(raised >> bits);
}

/// All bits of the lanes that are of a window, none of the others.
constexpr auto kIsOfWindow = [] {
  std::array<short, kSide * kLanes> lanes{};
  for (std::size_t k = 0; k < lanes.size(); ++k)
    lanes[k] = k % kLanes < kSide ? -1 : 0;
  return lanes;
}();

/// Rows of pixels, each mixed with the one to its right, a line of lanes each.
template <int kRows>
inline void mixAcross(const unsigned char *pixels, std::ptrdiff_t stride, short share, short *__restrict rows)
{
  for (int i = 0; i < kRows; ++i, pixels += stride)
    for (int k = 0; k < kLanes; ++k)
      rows[i * kLanes + k] =
          mixed(static_cast<short>(pixels[k] << kGreyBits), static_cast<short>(pixels[k + 1] << kGreyBits), share);
}
/// Beyond the image there is no gradient.
void clearOutside(const GreyPlane &image, const Between &at, short *dx, short *dy)
{
  for (int i = 0; i <= kSide; ++i)
    for (int k = 0; k < kLanes; ++k)
      if (at.top + i < 0 || at.top + i >= image.height || at.left + k < 0 || at.left + k >= image.width)
        dx[i * kLanes + k] = dy[i * kLanes + k] = 0;
}
} // namespace

BOLE_VECTOR_CLONES
void cutWindow(const GreyPlane &image, float x, float y, Window &window)
{
  constexpr int kOuter = kSide + 1, kSize = kSide * kLanes, kOuterSize = kOuter * kLanes;
  const Between at(image, x, y);
  const short right_share = at.right_share, lower_share = at.lower_share;
  short grey[kOuterSize];
  mixAcross<kOuter>(at.pixel, image.stride, right_share, grey);
  short raw[(kOuter + 2) * kLanes]; // from the pixel before the first on
  const unsigned char *pixels = at.pixel - image.stride - 1;
  for (int i = 0; i < kOuter + 2; ++i, pixels += image.stride)
    for (int k = 0; k < kLanes; ++k)
      raw[i * kLanes + k] = pixels[k];
  short down[kOuterSize + kLanes], along[kOuterSize + kLanes];
  for (int k = 0; k < kOuterSize; ++k) {
    down[k] = static_cast<short>(3 * (raw[k] + raw[k + 2 * kLanes]) + 10 * raw[k + kLanes]);
    along[k] = static_cast<short>(raw[k + 2 * kLanes] - raw[k]);
  }
  std::fill_n(down + kOuterSize, kLanes, short(0));
  std::fill_n(along + kOuterSize, kLanes, short(0));
  short dx[kOuterSize + kLanes], dy[kOuterSize + kLanes]; // Scharr's derivatives
  for (int k = 0; k < kOuterSize; ++k) {
    const short across = static_cast<short>(down[k + 2] - down[k]);
    const short below = static_cast<short>(3 * (along[k] + along[k + 2]) + 10 * along[k + 1]);
    dx[k] = static_cast<short>(across * (1 << kGradientBits));
    dy[k] = static_cast<short>(below * (1 << kGradientBits));
  }
  const bool is_whole =
      at.left >= 0 && at.top >= 0 && at.left + kOuter <= image.width && at.top + kOuter <= image.height;
  if (!is_whole)
    clearOutside(image, at, dx, dy);
  std::fill_n(dx + kOuterSize, kLanes, short(0));
  std::fill_n(dy + kOuterSize, kLanes, short(0));
  short mixed_x[kOuterSize], mixed_y[kOuterSize];
  for (int k = 0; k < kOuterSize; ++k) {
    mixed_x[k] = mixed(dx[k], dx[k + 1], right_share);
    mixed_y[k] = mixed(dy[k], dy[k + 1], right_share);
  }
  for (int k = 0; k < kSize; ++k) {
    window.grey[k] = rounded(mixed(grey[k], grey[k + kLanes], lower_share), kGreyBits - kWindowBits);
    const short x_there = mixed(mixed_x[k], mixed_x[k + kLanes], lower_share);
    const short y_there = mixed(mixed_y[k], mixed_y[k + kLanes], lower_share);
    window.gradient_x[k] = static_cast<short>(rounded(x_there, kGradientBits) & kIsOfWindow[k]);
    window.gradient_y[k] = static_cast<short>(rounded(y_there, kGradientBits) & kIsOfWindow[k]);
  }
  int xx = 0, xy = 0, yy = 0; // 121 x 4080^2 at most: below 2^31
  for (int k = 0; k < kSize; ++k) {
    xx += window.gradient_x[k] * window.gradient_x[k];
    xy += window.gradient_x[k] * window.gradient_y[k];
    yy += window.gradient_y[k] * window.gradient_y[k];
  }
  window.xx = static_cast<float>(xx);
  window.xy = static_cast<float>(xy);
  window.yy = static_cast<float>(yy);
}

BOLE_VECTOR_CLONES
void mismatch(const GreyPlane &image, float x, float y, const Window &window, float &by_x, float &by_y)
{
  constexpr int kSize = kSide * kLanes;
  constexpr short kMostApart = 135 << kWindowBits; // of more than half of all grey levels no sum may overflow
  const Between at(image, x, y);
  const short lower_share = at.lower_share;
  short rows[kSize + kLanes];
  mixAcross<kSide + 1>(at.pixel, image.stride, at.right_share, rows);
  int sum_x = 0, sum_y = 0;
  for (int k = 0; k < kSize; ++k) {
    const short here = rounded(mixed(rows[k], rows[k + kLanes], lower_share), kGreyBits - kWindowBits);
    const short apart = static_cast<short>(here - window.grey[k]);
    const short difference = std::min(kMostApart, std::max(static_cast<short>(-kMostApart), apart));
    sum_x += difference * window.gradient_x[k];
    sum_y += difference * window.gradient_y[k];
  }
  by_x = static_cast<float>(sum_x);
  by_y = static_cast<float>(sum_y);
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
