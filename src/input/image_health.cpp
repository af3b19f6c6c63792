// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/image_health.h"
#include "geometry/median.h"
#include "geometry/names.h"
#include "input/gyro_agreement.h"
#include "input/image_measures.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace bole
{
namespace
{
constexpr std::size_t kMemory = 8;      // accepted images that tell what is usual
constexpr double kMinDeviation = 3;     // grey levels: below, an image is blank
constexpr int kDarkLevel = 24;          // 99 % of the pixels below: no more than the camera's own noise
constexpr double kBrightShare = 0.65;   // of the pixels: beyond, no trunk is left between the flares
constexpr double kMaxRoughness = 0.75;  // difference of neighbours over deviation; white noise has 1.1
constexpr double kNoiseFactor = 1.8;    // times the usual noise, and
constexpr double kNoiseAdded = 8;       // grey levels above it: more than a codec adds at a low bit rate
constexpr double kBlurFactor = 0.4;     // of the usual sharpness
constexpr double kRepeatedShare = 0.15; // of the rows or columns, beyond the last good image's
constexpr double kSamePixels = 0.999;   // a clock in the corner may go on
constexpr double kFrozenChange = 1.3;   // grey levels of the thumb: noise of 5 grey levels, averaged
constexpr double kFrozenShare = 0.12;   // of the least of the last three changes: no flight stops so fast
constexpr double kStillRotation = 2e-3; // rad: by the gyro the camera may stand still
constexpr double kSureMatch = 0.75;     // correlation of two images that show the same
constexpr double kSureMargin = 0.05;    // of it over the correlation at the shift that the gyro says
constexpr double kFlipGain = 0.3;       // correlation that an exchange of sides must add
constexpr double kFlipLeast = 0.6;      // correlation that it must reach; frames of a flight reach it with each other
constexpr double kElsewhere = 0.5;  // of the usual correlation with the frame before, below which it is another place
constexpr double kNewShare = 0.2;   // of a frame in it
constexpr double kSoon_s = 0.35;    // in which a flight does not leave what it sees
constexpr double kWhole = 0.75;     // correlation of the half that follows the frame before
constexpr double kTorn = 0.45;      // and most of the other
constexpr double kBackGain = 0.1;   // correlation by which an image follows the last good one better
constexpr double kBackLeast = 0.35; // and that it must reach
constexpr double kZooms[] = {1.15, 1.3, 1.5, 1.75, 2};
constexpr int kLastsMost = 30;   // frames that a fault of the picture is refused before it counts as usual
constexpr int kJumpsMost = 5;    // frames out of order or torn before they are believed
constexpr int kTornSpacing = 30; // frames: what tears more often is in the view, as a propeller

double middleOf(const std::deque<double> &values) { return medianOf({values.begin(), values.end()}); }

void remember(std::deque<double> &values, double value)
{
  values.push_back(value);
  if (values.size() > kMemory)
    values.pop_front();
}

/// Shift of a distant image over the focal length when the camera rotates by \p rotation.
Eigen::Vector2d shiftOf(const Eigen::Vector3d &rotation) { return {rotation.y(), -rotation.x()}; }

/// \p image as it would be had the camera not rolled: \p rotation, about its own axes [rad].
cv::Mat unrolled(const cv::Mat &image, const std::optional<Eigen::Vector3d> &rotation)
{
  constexpr double kLeast_rad = 0.01; // half a pixel at the border of a thumb
  const double roll = rotation ? rotation->z() : 0;
  if (std::abs(roll) < kLeast_rad)
    return image;
  const cv::Point2f centre(0.5F * static_cast<float>(image.cols - 1), 0.5F * static_cast<float>(image.rows - 1));
  cv::Mat out;
  cv::warpAffine(image, out, cv::getRotationMatrix2D(centre, -roll * 180 / CV_PI, 1), image.size(), cv::INTER_LINEAR,
                 cv::BORDER_REPLICATE);
  return out;
}

/// The middle of \p image, enlarged to its size.
cv::Mat enlarged(const cv::Mat &image, double zoom)
{
  const cv::Size size(static_cast<int>(std::lround(image.cols / zoom)),
                      static_cast<int>(std::lround(image.rows / zoom)));
  cv::Mat out;
  cv::resize(image({(image.cols - size.width) / 2, (image.rows - size.height) / 2, size.width, size.height}), out,
             image.size(), 0, 0, cv::INTER_LINEAR);
  return out;
}

struct Suspicion
{
  ImageFault fault = ImageFault::none;
  std::string text = {};
};

/// What else of the frame \p before \p now may show, where that fits far better than \p as_it_is.
Suspicion otherwise(const cv::Mat &before, const cv::Mat &now, const ImageMatch &as_it_is)
{
  const auto fits = [&as_it_is](double correlation) {
    return correlation > kFlipLeast && correlation > as_it_is.correlation + kFlipGain;
  };
  cv::Mat flipped;
  cv::flip(now, flipped, -1);
  if (fits(matchImages(before, flipped).correlation))
    return {ImageFault::upside_down, "upside down against the frame before"};
  cv::flip(now, flipped, 1);
  if (fits(matchImages(before, flipped).correlation))
    return {ImageFault::mirrored, "mirrored against the frame before"};
  double least = 0;
  cv::minMaxLoc(as_it_is.correlations, &least);
  if (fits(-least))
    return {ImageFault::negative, "negative of the frame before"};
  for (const double zoom : kZooms) {
    if (fits(matchImages(enlarged(before, zoom), now).correlation))
      return {ImageFault::cropped, fmt::format("cropped: {:g} times as large as in the frame before", zoom)};
    if (fits(matchImages(before, enlarged(now, zoom)).correlation))
      return {ImageFault::cropped, fmt::format("cropped: {:g} times as small as in the frame before", zoom)};
  }
  const int middle = now.rows / 2;
  const double top = matchImages(before.rowRange(0, middle), now.rowRange(0, middle)).correlation;
  const double bottom = matchImages(before.rowRange(middle, now.rows), now.rowRange(middle, now.rows)).correlation;
  if (std::max(top, bottom) > kWhole && std::min(top, bottom) < kTorn)
    return {ImageFault::torn, "torn: one half does not follow the frame before"};
  return {};
}
} // namespace

const char *toString(ImageFault fault)
{
  return nameOf(fault, {"none", "wrong size", "black", "saturated", "noise", "blurred", "smeared", "frozen", "mirrored",
                        "upside down", "negative", "cropped", "torn", "out of order", "late"});
}

struct ImageHealth::State
{
  bool detects_frozen = true;
  cv::Mat last;     ///< the last accepted image
  cv::Mat thumb;    ///< of it
  cv::Mat previous; ///< thumb of the last image that had a picture in it, accepted or not
  bool may_repeat = true;
  double good_repeated = 0;
  std::deque<double> noises, sharpnesses, changes; ///< of accepted images; noise over deviation
  int bad_quality = 0;
  Suspicion odd;                           ///< how the images have stood to the last accepted one since it
  int odd_count = 0;                       ///< of them
  int since_torn = kTornSpacing;           ///< frames
  std::optional<double> usual_correlation; ///< of a frame with the one before: a fast flight leaves much of it
  std::optional<Eigen::Vector3d> gyro = Eigen::Vector3d::Zero(),
                                 odometry = Eigen::Vector3d::Zero();       ///< since `previous`
  std::optional<Eigen::Vector3d> gyro_from_last = Eigen::Vector3d::Zero(); ///< since the last accepted image
  double elapsed_s = 0;                                                    ///< since `previous`
  double gyro_since_good = 0; ///< angle [rad], negative where it is not known
  GyroAgreement agreement;
  std::string reason;

  ImageFault report(ImageFault fault, std::string text)
  {
    reason = std::move(text);
    return fault;
  }
  void addMotion(const MeasuredRotation &motion);
  ImageFault judgeAlone(const ImageNumbers &numbers);
  ImageFault judgeQuality(const ImageNumbers &numbers);
  ImageFault judgeFrozen(const cv::Mat &image, const cv::Mat &small);
  ImageFault judgeOrder(const cv::Mat &picture, const MeasuredRotation &motion);
  ImageFault judgeOdd(const cv::Mat &picture, const cv::Mat &small, const ImageMatch &moved, double focal);
  GyroAgreement::Interval intervalOf(const ImageMatch &moved, double focal) const;
  bool movedAsOne(const cv::Mat &small, const GyroAgreement::Interval &interval, double focal) const;
  ImageFault named(GyroAgreement::Verdict verdict);
  bool isBack(const cv::Mat &picture, const cv::Mat &small, const ImageMatch &moved, double focal) const;
  ImageFault begin(Suspicion suspicion)
  {
    odd = std::move(suspicion);
    odd_count = 1;
    return report(odd.fault, odd.text);
  }
  void accept(const cv::Mat &image, const cv::Mat &small, const ImageNumbers &numbers);
};

void ImageHealth::State::addMotion(const MeasuredRotation &motion)
{
  const auto add = [](std::optional<Eigen::Vector3d> &sum, const std::optional<Eigen::Vector3d> &part) {
    if (sum && part)
      *sum += *part;
    else
      sum.reset();
  };
  add(gyro, motion.gyro);
  add(gyro_from_last, motion.gyro);
  elapsed_s += motion.elapsed_s;
  add(odometry, motion.odometry);
  gyro_since_good = motion.gyro && gyro_since_good >= 0 ? gyro_since_good + motion.gyro->norm() : -1;
}

/// What an image shows by itself.
ImageFault ImageHealth::State::judgeAlone(const ImageNumbers &numbers)
{
  if (numbers.bright_share > kBrightShare)
    return report(ImageFault::saturated, fmt::format("saturated: {:.0f} % of the pixels", 100 * numbers.bright_share));
  if (numbers.deviation < kMinDeviation)
    return report(ImageFault::black, fmt::format("no contrast: deviation of {:.1f} grey levels", numbers.deviation));
  if (numbers.level_99 < kDarkLevel)
    return report(ImageFault::black, fmt::format("dark: 99 % of the pixels below grey level {}", numbers.level_99));
  if (numbers.roughness > kMaxRoughness)
    return report(ImageFault::noise, "nothing but noise");
  return ImageFault::none;
}

/// Noise, sharpness and repeated rows against what is usual.
ImageFault ImageHealth::State::judgeQuality(const ImageNumbers &numbers)
{
  ImageFault fault = ImageFault::none;
  if (numbers.repeated > good_repeated + kRepeatedShare)
    fault = report(ImageFault::smeared,
                   fmt::format("smeared: {:.0f} % of the rows or columns repeat each other", 100 * numbers.repeated));
  else if (noises.size() >= 2) {
    const double usual = middleOf(noises) * numbers.deviation, usual_sharpness = middleOf(sharpnesses);
    if (numbers.noise > kNoiseFactor * usual && numbers.noise > usual + kNoiseAdded)
      fault = report(ImageFault::noise, fmt::format("noise of {:.0f} grey levels after {:.0f}", numbers.noise, usual));
    else if (numbers.sharpness < kBlurFactor * usual_sharpness)
      fault = report(ImageFault::blurred, fmt::format("blurred: {:.0f} % of the usual sharpness",
                                                      100 * numbers.sharpness / usual_sharpness));
  }
  bad_quality = fault == ImageFault::none ? 0 : bad_quality + 1;
  if (bad_quality <= kLastsMost)
    return fault;
  good_repeated = numbers.repeated; // the camera is another one now
  noises.clear();
  sharpnesses.clear();
  bad_quality = 0;
  return ImageFault::none;
}

/// The last accepted image again, pixel by pixel or under fresh noise.
ImageFault ImageHealth::State::judgeFrozen(const cv::Mat &image, const cv::Mat &small)
{
  if (!detects_frozen || may_repeat)
    return ImageFault::none;
  const int changed = cv::countNonZero(image != last);
  if (changed <= (1 - kSamePixels) * static_cast<double>(image.total()))
    return report(ImageFault::frozen, changed == 0
                                          ? "the same image as before"
                                          : fmt::format("the same image as before but for {} pixels", changed));
  if (changes.size() < 3)
    return ImageFault::none;
  const double least = *std::min_element(changes.end() - 3, changes.end());
  const double change = changeBetween(thumb, small);
  const bool may_stand = gyro_since_good >= 0 && gyro_since_good < kStillRotation;
  if (change < kFrozenChange && change < kFrozenShare * least && !may_stand)
    return report(ImageFault::frozen, "the image before under fresh noise");
  return ImageFault::none;
}

/// Whether an image follows the last accepted one again, after others that did not.
bool ImageHealth::State::isBack(const cv::Mat &picture, const cv::Mat &small, const ImageMatch &moved,
                                double focal) const
{
  const ImageMatch with_last = matchImages(thumb, unrolled(picture, gyro_from_last));
  if (with_last.correlation > std::max(kBackLeast, moved.correlation + kBackGain))
    return true;
  if (odd.fault != ImageFault::out_of_order) // what was done to the image before is undone
    return moved.correlation < kFlipLeast && otherwise(previous, small, moved).fault == odd.fault;
  if (with_last.correlation < kFlipLeast || !gyro_from_last || focal <= 0)
    return false;
  const Eigen::Vector2d seen(with_last.x / focal, with_last.y / focal);
  return agreement.follows(seen, shiftOf(*gyro_from_last), odd_count + 1);
}

/// Against the images before and the gyro.
ImageFault ImageHealth::State::judgeOrder(const cv::Mat &picture, const MeasuredRotation &motion)
{
  const double focal = motion.focal_px * picture.cols / last.cols;
  const cv::Mat small = unrolled(picture, gyro);
  const ImageMatch moved = matchImages(previous, small);
  if (odd.fault != ImageFault::none)
    return judgeOdd(picture, small, moved, focal);
  ++since_torn;
  if (moved.correlation < kFlipLeast)
    if (Suspicion other = otherwise(previous, small, moved);
        other.fault != ImageFault::none && (other.fault != ImageFault::torn || since_torn > kTornSpacing)) {
      since_torn = other.fault == ImageFault::torn ? 0 : since_torn;
      agreement.reset();
      return begin(std::move(other));
    }
  if (!gyro || focal <= 0) {
    agreement.reset();
    return ImageFault::none;
  }
  const GyroAgreement::Interval interval = intervalOf(moved, focal);
  const double usual = usual_correlation.value_or(moved.correlation);
  if (interval.is_seen && moved.correlation < kElsewhere * usual && elapsed_s < kSoon_s) {
    agreement.add(interval, false);
    return begin({ImageFault::out_of_order, "out of order: it shows another place than the frame before"});
  }
  usual_correlation = usual + kNewShare * (moved.correlation - usual);
  const ImageFault fault = named(agreement.add(interval, true));
  if (fault == ImageFault::out_of_order && !movedAsOne(small, interval, focal))
    return ImageFault::none;
  if (fault == ImageFault::out_of_order)
    return begin({fault, "out of order: it does not follow the frame before as the gyro says"});
  return fault;
}

/// After an image that stood otherwise to those before it.
ImageFault ImageHealth::State::judgeOdd(const cv::Mat &picture, const cv::Mat &small, const ImageMatch &moved,
                                        double focal)
{
  const bool is_out_of_order = odd.fault == ImageFault::out_of_order;
  const bool is_back = isBack(picture, small, moved, focal);
  if (is_out_of_order && gyro && focal > 0) {
    const ImageFault fault = named(agreement.add(intervalOf(moved, focal), false));
    if (!is_back && fault != ImageFault::none) { // they follow each other, at another time
      odd = {};
      return fault;
    }
  }
  const bool is_short = is_out_of_order || odd.fault == ImageFault::torn;
  if (!is_back && ++odd_count <= (is_short ? kJumpsMost : kLastsMost))
    return report(odd.fault, odd.text);
  odd = {};
  return ImageFault::none;
}

/// Whether the parts of the image all moved as the whole did, and not as the gyro says: a flight past something near
/// moves that alone.
bool ImageHealth::State::movedAsOne(const cv::Mat &small, const GyroAgreement::Interval &interval, double focal) const
{
  constexpr double kMost = 0.5; // of the way of the whole
  constexpr int kLeastParts = 2;
  const Eigen::Vector2d expected = focal * (interval.gyro + agreement.usualOffset());
  const Eigen::Vector2d whole = focal * interval.image - expected;
  int parts = 0;
  for (const ImageMatch &strip : matchStrips(previous, small)) {
    if (strip.correlation < kSureMatch)
      continue;
    ++parts;
    const bool may_follow = strip.bestNear(expected.x(), expected.y()) > strip.correlation - kSureMargin;
    if (may_follow || (Eigen::Vector2d(strip.x, strip.y) - expected).dot(whole) < kMost * whole.squaredNorm())
      return false;
  }
  return parts >= kLeastParts;
}

/// What the images and the gyro say of the time since the image before.
GyroAgreement::Interval ImageHealth::State::intervalOf(const ImageMatch &moved, double focal) const
{
  constexpr double kAlike_px = 2; // of the thumb: that near, it cannot be the trunk beside
  GyroAgreement::Interval interval;
  interval.image = Eigen::Vector2d(moved.x, moved.y) / focal;
  interval.gyro = shiftOf(*gyro);
  // Rows of trunks look alike one trunk farther: then the place that the gyro says is nearly as good.
  const Eigen::Vector2d expected = focal * interval.gyro;
  interval.is_seen = expected.cwiseAbs().maxCoeff() < 0.4 * kSearchShare * thumb.cols;
  interval.is_sure =
      moved.correlation > kSureMatch && (focal * (interval.image - interval.gyro).norm() < kAlike_px ||
                                         moved.bestNear(expected.x(), expected.y()) < moved.correlation - kSureMargin);
  if (odometry)
    interval.odometry = shiftOf(*odometry);
  return interval;
}

/// The fault that \p verdict is, said unless it is a jump.
ImageFault ImageHealth::State::named(GyroAgreement::Verdict verdict)
{
  switch (verdict) {
  case GyroAgreement::Verdict::agrees:
    return ImageFault::none;
  case GyroAgreement::Verdict::jumped:
    return ImageFault::out_of_order;
  case GyroAgreement::Verdict::late:
    return report(ImageFault::late, fmt::format("{} by {} frames against the gyro",
                                                agreement.lag() > 0 ? "late" : "early", std::abs(agreement.lag())));
  case GyroAgreement::Verdict::mirrored:
    return report(ImageFault::mirrored, "mirrored against the gyro");
  case GyroAgreement::Verdict::upside_down:
    return report(ImageFault::upside_down, "upside down against the gyro");
  }
  return ImageFault::none;
}

void ImageHealth::State::accept(const cv::Mat &image, const cv::Mat &small, const ImageNumbers &numbers)
{
  if (!thumb.empty())
    remember(changes, changeBetween(thumb, small));
  remember(noises, numbers.noise / std::max(numbers.deviation, kMinDeviation)); // the same at any brightness
  remember(sharpnesses, numbers.sharpness);
  good_repeated = numbers.repeated;
  image.copyTo(last);
  thumb = small;
  gyro_since_good = 0;
  gyro_from_last = Eigen::Vector3d::Zero();
}

ImageHealth::ImageHealth(bool detects_frozen) : m_state(std::make_unique<State>())
{
  m_state->detects_frozen = detects_frozen;
}
ImageHealth::~ImageHealth() = default;
ImageHealth::ImageHealth(ImageHealth &&) noexcept = default;
ImageHealth &ImageHealth::operator=(ImageHealth &&) noexcept = default;

const std::string &ImageHealth::reason() const { return m_state->reason; }

void ImageHealth::start(const vpImage<unsigned char> &I)
{
  const bool detects_frozen = m_state->detects_frozen;
  *m_state = State();
  m_state->detects_frozen = detects_frozen;
  const cv::Mat image(static_cast<int>(I.getHeight()), static_cast<int>(I.getWidth()), CV_8UC1, I.bitmap);
  const cv::Mat small = thumbOf(image);
  m_state->accept(image, small, measureImage(image));
  m_state->previous = small;
}

void ImageHealth::skip(const MeasuredRotation &motion) { m_state->addMotion(motion); }

ImageFault ImageHealth::check(const vpImage<unsigned char> &I, const MeasuredRotation &motion)
{
  constexpr unsigned kSmallest_px = 24;
  State &s = *m_state;
  s.reason.clear();
  s.addMotion(motion);
  const cv::Mat image(static_cast<int>(I.getHeight()), static_cast<int>(I.getWidth()), CV_8UC1, I.bitmap);
  if (!s.last.empty() && image.size() != s.last.size())
    return s.report(ImageFault::wrong_size,
                    fmt::format("image of {}x{} px, must be {}x{}", image.cols, image.rows, s.last.cols, s.last.rows));
  if (I.getWidth() < kSmallest_px || I.getHeight() < kSmallest_px)
    return ImageFault::none;
  const ImageNumbers numbers = measureImage(image);
  ImageFault fault = s.judgeAlone(numbers);
  if (fault == ImageFault::none && !s.last.empty())
    fault = s.judgeQuality(numbers);
  const bool has_picture = fault == ImageFault::none || fault == ImageFault::blurred;
  if (!has_picture)
    return fault;
  const cv::Mat small = thumbOf(image);
  if (fault == ImageFault::none && !s.last.empty()) {
    fault = s.judgeFrozen(image, small);
    if (fault == ImageFault::frozen)
      return fault;
    fault = s.judgeOrder(small, motion);
    s.previous = small;
    s.gyro = s.odometry = Eigen::Vector3d::Zero();
    s.elapsed_s = 0;
  }
  s.may_repeat = false;
  if (fault == ImageFault::none)
    s.accept(image, small, numbers);
  if (s.previous.empty())
    s.previous = small;
  return fault;
}
} // namespace bole
