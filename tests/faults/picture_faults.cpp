// SPDX-License-Identifier: GPL-2.0-or-later
// What cameras, their drivers and their links do to pictures.
#include "fault_list.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace bole::faults
{
namespace
{
using Change = std::function<cv::Mat(const cv::Mat &, std::size_t)>;

Fault changed(const std::string &name, const std::string &what, std::size_t count, const Change &change)
{
  return {"pictures", name, what, Duty::survive, [=](SpoiltFlight &flight) { flight.change(kAt, count, change); }};
}

Fault reordered(const std::string &name, const std::string &what, std::size_t count,
                const std::function<std::size_t(std::size_t)> &frame_of)
{
  return {"pictures", name, what, Duty::survive, [=](SpoiltFlight &flight) { flight.reorder(kAt, count, frame_of); }};
}

cv::Mat scaled(const cv::Mat &image, double factor, double offset = 0)
{
  cv::Mat out;
  image.convertTo(out, CV_8U, factor, offset);
  return out;
}

cv::Mat flipped(const cv::Mat &image, int code)
{
  cv::Mat out;
  cv::flip(image, out, code);
  return out;
}

/// The part of the picture that a frame \p zoom times smaller sees, \p shift_px beside the middle.
cv::Mat cropped(const cv::Mat &image, double zoom, double shift_px)
{
  const cv::Mat A = (cv::Mat_<double>(2, 3) << zoom, 0, (1 - zoom) * 0.5 * (image.cols - 1) - zoom * shift_px, 0, zoom,
                     (1 - zoom) * 0.5 * (image.rows - 1));
  cv::Mat out;
  cv::warpAffine(image, out, A, image.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return out;
}

/// Rows exposed one after the other by a camera that turns sideways: the last one \p pixels beside the first.
cv::Mat rolled(const cv::Mat &image, double pixels)
{
  const cv::Mat A = (cv::Mat_<double>(2, 3) << 1, pixels / image.rows, -0.5 * pixels, 0, 1, 0);
  cv::Mat out;
  cv::warpAffine(image, out, A, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

cv::Mat smeared(cv::Mat image)
{
  for (int u = image.cols / 2; u < image.cols; ++u)
    image.col(image.cols / 2).copyTo(image.col(u));
  return image;
}

cv::Mat withBlades(cv::Mat image, std::size_t k)
{
  const double angles[] = {2.4 * static_cast<double>(k), 1.3 + 2.4 * static_cast<double>(k)};
  for (int side = 0; side < 2; ++side) {
    const cv::Point2d hub((side == 0 ? 0.1 : 0.9) * image.cols, -0.05 * image.rows);
    const cv::Point2d tip =
        hub + 0.55 * image.cols * cv::Point2d(std::cos(angles[side]), std::abs(std::sin(angles[side])));
    cv::line(image, hub, tip, 12, 22);
  }
  return image;
}

cv::Mat withDrop(const cv::Mat &image)
{
  cv::Mat blurred, out = image.clone();
  cv::GaussianBlur(image, blurred, {}, 12);
  cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
  cv::ellipse(mask, {190, 120}, {28, 34}, 0, 0, 360, 255, cv::FILLED);
  blurred.copyTo(out, mask);
  return out;
}

cv::Mat withBand(cv::Mat image, std::size_t k)
{
  const int top = static_cast<int>(17 * k) % image.rows;
  cv::Mat band = image.rowRange(top, std::min(image.rows, top + 40));
  scaled(band, 0.25).copyTo(band);
  return image;
}

/// \p image with normal noise of \p sigma grey levels.
cv::Mat noisy(const cv::Mat &image, double sigma, std::mt19937 &random)
{
  std::normal_distribution<double> noise(0, sigma);
  cv::Mat out = image.clone();
  for (int v = 0; v < out.rows; ++v)
    for (int u = 0; u < out.cols; ++u)
      out.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(out.at<unsigned char>(v, u) + noise(random));
  return out;
}

Fault noised(const std::string &name, const std::string &what, std::size_t count, double sigma)
{
  return {"pictures", name, what, Duty::survive, [=](SpoiltFlight &flight) {
            flight.change(kAt, count,
                          [&](const cv::Mat &image, std::size_t) { return noisy(image, sigma, flight.random); });
          }};
}

/// Stamps of all frames off by a normal error of \p sigma_s.
Fault jittered(const std::string &name, const std::string &what, double sigma_s)
{
  return fromTheFirst({"pictures", name, what, Duty::survive, [sigma_s](SpoiltFlight &flight) {
                         constexpr double kMost_s = 0.045; // the order is kept
                         std::normal_distribution<double> error(0, sigma_s);
                         for (std::size_t i = 1; i + 1 < flight.frames(); ++i) {
                           const double off = std::clamp(error(flight.random), -kMost_s, kMost_s);
                           flight.camera.rows[i][0] =
                               std::to_string(flight.camera.stamp(i) + static_cast<std::int64_t>(1e9 * off));
                         }
                       }});
}

std::vector<Fault> lightFaults()
{
  return {
      changed("black_5", "", 5, [](const cv::Mat &I, std::size_t) { return scaled(I, 0); }),
      changed("white_5", "", 5, [](const cv::Mat &I, std::size_t) { return scaled(I, 0, 255); }),
      changed("dim_10", "to a tenth", 10, [](const cv::Mat &I, std::size_t) { return scaled(I, 0.1); }),
      changed("overexposed_10", "fourfold", 10, [](const cv::Mat &I, std::size_t) { return scaled(I, 4, 60); }),
      changed("half_light", "", kToTheEnd, [](const cv::Mat &I, std::size_t) { return scaled(I, 0.5); }),
      changed("double_light", "", kToTheEnd, [](const cv::Mat &I, std::size_t) { return scaled(I, 2); }),
      changed("flicker", "to half the light", kToTheEnd,
              [](const cv::Mat &I, std::size_t k) { return scaled(I, k % 2 ? 1 : 0.5); }),
      changed("dark_band", "that runs down", kToTheEnd, [](const cv::Mat &I, std::size_t k) { return withBand(I, k); }),
      changed("inverted_5", "", 5, [](const cv::Mat &I, std::size_t) { return scaled(I, -1, 255); }),
      noised("noise_10", "of 40 grey levels", 10, 40),
      changed("static_5", "of nothing but noise", 5,
              [](const cv::Mat &I, std::size_t k) {
                std::mt19937 random(static_cast<unsigned>(k));
                return noisy(scaled(I, 0, 128), 80, random);
              }),
  };
}

std::vector<Fault> lensFaults()
{
  const auto blurred = [](double sigma) {
    return [sigma](const cv::Mat &I, std::size_t) {
      cv::Mat out;
      cv::GaussianBlur(I, out, {}, sigma);
      return out;
    };
  };
  return {
      changed("blur_20", "by 5 px", 20, blurred(5)),
      changed("motion_blur_10", "of 25 px", 10,
              [](const cv::Mat &I, std::size_t) {
                cv::Mat out;
                cv::blur(I, out, {25, 1});
                return out;
              }),
      changed("drop", "of water", kToTheEnd, [](const cv::Mat &I, std::size_t) { return withDrop(I); }),
      changed("dirt", "in an upright stripe", kToTheEnd,
              [](const cv::Mat &I, std::size_t) {
                cv::Mat out = I.clone();
                out.colRange(150, 172) = 25;
                return out;
              }),
      changed("propeller", "of two blades", kToTheEnd,
              [](const cv::Mat &I, std::size_t k) { return withBlades(I, k); }),
      changed("rolling_20", "shutter of 10 px", 20,
              [](const cv::Mat &I, std::size_t k) { return rolled(I, 10 * std::sin(2 * M_PI * k / 7.3)); }),
      changed("rolling", "shutter of 10 px", kToTheEnd,
              [](const cv::Mat &I, std::size_t k) { return rolled(I, 10 * std::sin(2 * M_PI * k / 7.3)); }),
  };
}

std::vector<Fault> readoutFaults()
{
  return {
      changed("mirrored_5", "", 5, [](const cv::Mat &I, std::size_t) { return flipped(I, 1); }),
      changed("mirrored", "", kToTheEnd, [](const cv::Mat &I, std::size_t) { return flipped(I, 1); }),
      changed("upside_down_5", "", 5, [](const cv::Mat &I, std::size_t) { return flipped(I, -1); }),
      changed("upside_down", "", kToTheEnd, [](const cv::Mat &I, std::size_t) { return flipped(I, -1); }),
      changed("cropped_5", "by 1.3", 5, [](const cv::Mat &I, std::size_t) { return cropped(I, 1.3, 0); }),
      changed("cropped", "by 1.3", kToTheEnd, [](const cv::Mat &I, std::size_t) { return cropped(I, 1.3, 0); }),
      changed("shifted_5", "by 30 px", 5, [](const cv::Mat &I, std::size_t) { return cropped(I, 1, 30); }),
      changed("smear_1", "over the right half", 1, [](const cv::Mat &I, std::size_t) { return smeared(I.clone()); }),
      changed("smear_20", "", 20, [](const cv::Mat &I, std::size_t) { return smeared(I.clone()); }),
      changed("torn_10", "in the lower half", 10,
              [](const cv::Mat &I, std::size_t) {
                cv::Mat out = I.clone();
                flipped(I, -1).rowRange(I.rows / 2, I.rows).copyTo(out.rowRange(I.rows / 2, I.rows));
                return out;
              }),
      changed("blocks_10", "of 16 px", 10,
              [](const cv::Mat &I, std::size_t) {
                cv::Mat small, out;
                cv::resize(I, small, {}, 1 / 16.0, 1 / 16.0, cv::INTER_AREA);
                cv::resize(small, out, I.size(), 0, 0, cv::INTER_NEAREST);
                return out;
              }),
  };
}

std::vector<Fault> orderFaults()
{
  const auto frozen = [](const std::string &name, const std::string &what, double sigma) {
    return Fault{"pictures", name, what, Duty::survive, [=](SpoiltFlight &flight) {
                   const cv::Mat last = flight.image(kAt - 1);
                   flight.change(kAt, 10, [&](const cv::Mat &, std::size_t k) {
                     cv::Mat I = sigma > 0 ? noisy(last, sigma, flight.random) : last.clone();
                     I.at<unsigned char>(0, static_cast<int>(k)) ^= 1; // a counter in the corner
                     return I;
                   });
                 }};
  };
  const auto kept = [](const std::string &name, const std::string &what,
                       const std::function<bool(std::size_t)> &is_kept) {
    return Fault{"pictures", name, what, Duty::survive, [=](SpoiltFlight &flight) {
                   std::vector<SpoiltFlight::Row> rows;
                   for (std::size_t i = 0; i < flight.frames(); ++i)
                     if (i < kAt || is_kept(i - kAt))
                       rows.push_back(flight.camera.rows[i]);
                   flight.camera.rows = std::move(rows);
                 }};
  };
  return {
      reordered("frozen_10", "", 10, [](std::size_t) { return kAt - 1; }),
      frozen("frozen_counter_10", "", 0),
      frozen("frozen_noise_10", "", 2),
      {"pictures", "stutter", "of every third picture", Duty::survive,
       [](SpoiltFlight &flight) {
         for (std::size_t i = kAt; i < flight.frames(); i += 3)
           flight.set(i, noisy(flight.image(i - 1), 1, flight.random));
       }},
      reordered("swapped_2", "", 2, [](std::size_t i) { return i == kAt ? kAt + 1 : kAt; }),
      reordered("reversed_5", "", 5, [](std::size_t i) { return 2 * kAt + 4 - i; }),
      reordered("reversed_20", "", 20, [](std::size_t i) { return 2 * kAt + 19 - i; }),
      reordered("elsewhere_5", "", 5, [](std::size_t i) { return i - 40; }),
      reordered("late_by_one", "frame", kToTheEnd, [](std::size_t i) { return i - 1; }),
      reordered("late_by_three", "frames", kToTheEnd, [](std::size_t i) { return i - 3; }),
      jittered("stamps_15ms", "sigma", 0.015),
      jittered("stamps_30ms", "sigma", 0.03),
      {"pictures", "stamps_ahead", "by 0.5 s", Duty::survive,
       [](SpoiltFlight &flight) {
         for (std::size_t i = kAt; i < flight.frames(); ++i)
           flight.camera.rows[i][0] = std::to_string(flight.camera.stamp(i) + 500'000'000);
       }},
      kept("gap_1s", "", [](std::size_t i) { return i >= 10; }),
      kept("gap_2s", "", [](std::size_t i) { return i >= 20; }),
      kept("half_rate", "", [](std::size_t i) { return i % 2 == 0; }),
      kept("bursts", "of a second", [](std::size_t i) { return i / 10 % 2 == 0; }),
      fromTheFirst({"pictures", "rows_twice", "50 ms apart", Duty::survive,
                    [](SpoiltFlight &flight) {
                      std::vector<SpoiltFlight::Row> rows;
                      for (const SpoiltFlight::Row &row : flight.camera.rows)
                        for (const std::int64_t later_ns : {0, 50'000'000})
                          rows.push_back({std::to_string(std::stoll(row[0]) + later_ns), row[1]});
                      flight.camera.rows = std::move(rows);
                    }}),
      fromTheFirst({"pictures", "stamps_drift", "by 1 %", Duty::survive,
                    [](SpoiltFlight &flight) {
                      for (std::size_t i = 0; i < flight.frames(); ++i)
                        flight.camera.rows[i][0] = std::to_string(flight.camera.stamp(i) / 100 * 101);
                    }}),
  };
}
} // namespace

std::vector<Fault> pictureFaults() { return joined({lightFaults(), lensFaults(), readoutFaults(), orderFaults()}); }
} // namespace bole::faults
