// SPDX-License-Identifier: GPL-2.0-or-later
// Pictures are read as OpenCV reads them.
#include "support/test.h"

#include "input/codec.h"
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

using namespace bole;

namespace
{
/// Smooth, with colours and some grain. \p type: CV_8UC1, CV_8UC3, CV_8UC4 or CV_16UC1.
cv::Mat picture(int type)
{
  cv::Mat image(61, 83, type); // odd: not a whole number of blocks
  const int channels = image.channels();
  std::mt19937 random(3);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      for (int c = 0; c < channels; ++c) {
        const double level = 120 + 90 * std::sin(0.11 * u + c) * std::cos(0.07 * v - 2 * c) + double(random() % 16);
        if (image.depth() == CV_16U)
          image.ptr<std::uint16_t>(v)[u] = static_cast<std::uint16_t>(257 * level);
        else
          image.ptr(v)[u * channels + c] = static_cast<unsigned char>(level);
      }
  return image;
}

cv::Mat decoded(const std::vector<unsigned char> &bytes)
{
  vpImage<unsigned char> grey;
  if (!decodeGrey(bytes, grey))
    return {};
  return cv::Mat(static_cast<int>(grey.getHeight()), static_cast<int>(grey.getWidth()), CV_8UC1, grey.bitmap).clone();
}

double largestDifference(const cv::Mat &a, const cv::Mat &b) { return cv::norm(a, b, cv::NORM_INF); }

std::vector<unsigned char> bytesOf(const std::string &text) { return {text.begin(), text.end()}; }
} // namespace

TEST(PictureCodec, ReadsEveryFormatAsOpenCVDoes)
{
  struct Case
  {
    const char *kind;
    int type;
    double most; ///< levels: those that are lossless are grey to the bit, colours and JPEG to rounding
    std::vector<int> parameters;
  };
  const std::vector<Case> cases = {
      {".png", CV_8UC1, 0, {}},
      {".png", CV_8UC3, 1, {}},
      {".png", CV_8UC4, 1, {}},
      {".png", CV_16UC1, 0, {}},
      {".png", CV_8UC1, 0, {cv::IMWRITE_PNG_BILEVEL, 1}},
      {".jpg", CV_8UC1, 1, {}},
      {".jpg", CV_8UC3, 1, {}},
      {".jpg", CV_8UC3, 1, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}},
      {".jpg", CV_8UC3, 1, {cv::IMWRITE_JPEG_QUALITY, 35, cv::IMWRITE_JPEG_RST_INTERVAL, 3}},
      {".bmp", CV_8UC1, 1, {}},
      {".bmp", CV_8UC3, 1, {}},
      {".tiff", CV_8UC1, 0, {}},
      {".tiff", CV_8UC3, 1, {}},
      {".tiff", CV_16UC1, 0, {}},
      {".pgm", CV_8UC1, 0, {}},
      {".pgm", CV_8UC1, 0, {cv::IMWRITE_PXM_BINARY, 0}},
      {".pgm", CV_16UC1, 0, {}},
      {".ppm", CV_8UC3, 1, {}},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Case &one = cases[i];
    SCOPED_TRACE(cv::format("%zu: %s of type %d", i, one.kind, one.type));
    std::vector<unsigned char> bytes;
    ASSERT_TRUE(cv::imencode(one.kind, picture(one.type), bytes, one.parameters));
    const cv::Mat expected = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    const cv::Mat found = decoded(bytes);
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_LE(largestDifference(found, expected), one.most);
  }
}

TEST(PictureCodec, RefusesWhatIsNoPicture)
{
  vpImage<unsigned char> grey;
  for (const std::string text : {"", "P", "P5", "BM", "GIF89a", "no picture at all"})
    EXPECT_FALSE(decodeGrey(bytesOf(text), grey)) << text;
}

TEST(PictureCodec, WritesWhatOthersRead)
{
  cv::Mat grey = picture(CV_8UC1), colour;
  const vpImage<unsigned char> image(grey.data, 61, 83);
  EXPECT_EQ(largestDifference(cv::imdecode(bytesOf(encodePng(image)), cv::IMREAD_UNCHANGED), grey), 0);

  const cv::Mat rgb = picture(CV_8UC3);
  vpImage<vpRGBa> coloured(61, 83);
  cv::Mat target(61, 83, CV_8UC4, coloured.bitmap);
  cv::cvtColor(rgb, target, cv::COLOR_BGR2RGBA);
  const cv::Mat read = cv::imdecode(bytesOf(encodeJpeg(coloured)), cv::IMREAD_COLOR);
  ASSERT_EQ(read.size(), rgb.size());
  EXPECT_LT(cv::norm(read, rgb, cv::NORM_L1) / double(3 * rgb.total()), 6); // levels, of grain that JPEG smooths
}
