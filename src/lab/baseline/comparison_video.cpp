// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/comparison.h"

#include "support/video.h"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
constexpr int kWidth = 480; ///< of one tracker's picture [px]
constexpr int kBar = 28;    ///< of the text below it [px]
const cv::Scalar kRight(0, 158, 115, 255), kComplained(230, 159, 0, 255), kSilent(213, 40, 40, 255); // RGBA

cv::Scalar colourOf(const FrameError &error) { return error.complained ? kComplained : error.wrong ? kSilent : kRight; }

/// The picture of one tracker: image, model, name and error.
void drawTracker(cv::Mat tile, const TestFlight &flight, std::size_t k, const Score &score, vpMbTrunkTracker &model)
{
  const vpImage<unsigned char> &image = flight.frames[k].image;
  const cv::Mat grey(int(image.getHeight()), int(image.getWidth()), CV_8UC1, image.bitmap);
  cv::Mat picture = tile.rowRange(0, tile.rows - kBar), large;
  cv::resize(grey, large, picture.size(), 0, 0, cv::INTER_LINEAR);
  cv::cvtColor(large, picture, cv::COLOR_GRAY2RGBA);
  const FrameError &error = score.errors[k - 1]; // of frame k: the first frame is the start
  const double fu = double(picture.cols) / image.getWidth(), fv = double(picture.rows) / image.getHeight();
  if (error.cMo.isFinite())
    for (const std::vector<double> &l :
         model.getModelForDisplay(image.getWidth(), image.getHeight(), error.cMo.toVisp(), flight.camera.toVisp()))
      cv::line(picture, cv::Point2d(fu * l[2], fv * l[1]), cv::Point2d(fu * l[4], fv * l[3]), colourOf(error), 2,
               cv::LINE_AA);
  const std::string text = fmt::format("{}: {:.2f} m{}", score.name, error.position_m,
                                       error.complained ? ", says lost"
                                       : error.wrong    ? ", wrong in silence"
                                                        : "");
  cv::putText(tile, text, {6, tile.rows - 9}, cv::FONT_HERSHEY_SIMPLEX, 0.45, colourOf(error), 1, cv::LINE_AA);
}
} // namespace

void writeComparisonVideo(const std::string &path, const TestFlight &flight, const std::string &cao_path,
                          const std::vector<Score> &scores)
{
  std::vector<const Score *> shown;
  for (const Score &score : scores)
    if (score.help == Help::prior && score.errors.size() + 1 == flight.frames.size())
      shown.push_back(&score);
  if (shown.empty())
    return;
  vpMbTrunkTracker model;
  model.setCameraParameters(flight.camera.toVisp());
  model.loadModel(cao_path);

  const int height = kWidth * flight.camera.height / flight.camera.width + kBar;
  vpImage<vpRGBa> picture(unsigned(height * int((shown.size() + 1) / 2)), 2 * kWidth);
  cv::Mat canvas(int(picture.getHeight()), int(picture.getWidth()), CV_8UC4, picture.bitmap);
  Video video(path, 10); // whatever the flight's rate
  for (std::size_t k = 1; k < flight.frames.size(); ++k) {
    canvas.setTo(cv::Scalar(20, 20, 20, 255));
    for (std::size_t i = 0; i < shown.size(); ++i)
      drawTracker(canvas(cv::Rect(int(i % 2) * kWidth, int(i / 2) * height, kWidth, height)), flight, k, *shown[i],
                  model);
    video.write(picture);
  }
  video.finish();
}
} // namespace bole
