// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/frame_check.h"

#include "geometry/failure.h"
#include "geometry/names.h"
#include "geometry/so3.h"

#include <cmath>

namespace bole
{
namespace
{
constexpr double kFarthestPlace_m = 1e7; // of a body from the origin: grids of a country begin far away
constexpr double kFarthest_s = 1e-9 * static_cast<double>(kFarthestStamp_ns);

std::string inSeconds(std::int64_t stamp_ns) { return fmt::format("{} s", secondsOfStamp(stamp_ns)); }

std::string shown(const Eigen::Vector3d &v) { return fmt::format("({:g}, {:g}, {:g})", v.x(), v.y(), v.z()); }

bool isInRange(std::int64_t stamp_ns) { return stamp_ns >= -kFarthestStamp_ns && stamp_ns <= kFarthestStamp_ns; }

std::string faultOf(const Pose &wMb)
{
  if (!wMb.t.allFinite() || wMb.t.norm() > kFarthestPlace_m)
    return fmt::format("position of the odometry = {} m, must be finite and at most {:g} m from the origin",
                       shown(wMb.t), kFarthestPlace_m);
  if (!isRotation(wMb.R))
    return fmt::format("rotation of the odometry = {}, {}, {} by rows, must be a rotation", shown(wMb.R.row(0)),
                       shown(wMb.R.row(1)), shown(wMb.R.row(2)));
  return {};
}

/// \p last_ns: stamp of the sample before.
std::string faultOf(const GyroSample &sample, std::int64_t last_ns)
{
  if (!isInRange(sample.stamp_ns))
    return fmt::format("must be at most {:g} s from zero", kFarthest_s);
  if (sample.stamp_ns < last_ns)
    return fmt::format("must not be earlier than the sample before, at {}", inSeconds(last_ns));
  if (!sample.rate.allFinite())
    return fmt::format("angular rate = {} rad/s, must be finite", shown(sample.rate));
  if (sample.force && !sample.force->allFinite())
    return fmt::format("specific force = {} m/s^2, must be finite", shown(*sample.force));
  return {};
}

std::string faultOf(const std::vector<GyroSample> &gyro)
{
  for (std::size_t i = 0; i < gyro.size(); ++i)
    if (const std::string fault = faultOf(gyro[i], gyro[i > 0 ? i - 1 : 0].stamp_ns); !fault.empty())
      return fmt::format("sample {} of the gyro, at {}: {}", i, inSeconds(gyro[i].stamp_ns), fault);
  return {};
}

std::string faultOf(const Frame &frame, const std::optional<std::int64_t> &last_stamp_ns)
{
  if (!isInRange(frame.stamp_ns))
    return fmt::format("its stamp must be at most {:g} s from zero", kFarthest_s);
  if (last_stamp_ns && frame.stamp_ns <= *last_stamp_ns)
    return fmt::format("its stamp must be later than {}, that of the frame before", inSeconds(*last_stamp_ns));
  if (frame.wMb_odometry)
    if (std::string fault = faultOf(*frame.wMb_odometry); !fault.empty())
      return fault;
  return faultOf(frame.gyro);
}
} // namespace

const char *toString(FrameStatus status)
{
  return nameOf(status, {"ok", "stale", "corrupt", "missing", "resized", "doubtful"});
}

void requireSound(const Frame &frame, std::optional<std::size_t> index, std::optional<std::int64_t> last_stamp_ns)
{
  const std::string fault = faultOf(frame, last_stamp_ns);
  if (!fault.empty())
    throw badValue("frame {}at {}: {}", index ? fmt::format("{} ", *index) : "", inSeconds(frame.stamp_ns), fault);
}

std::int64_t stampOf(double seconds, const std::string &name)
{
  if (!(std::abs(seconds) <= kFarthest_s))
    throw badValue("{} = {:g} s, must be at most {:g} s from zero", name, seconds, kFarthest_s);
  const double whole = std::floor(seconds); // apart: all nine digits of the rest count
  return std::llround(whole) * 1'000'000'000 + std::llround((seconds - whole) * 1e9);
}

double secondsOfStamp(std::int64_t stamp_ns)
{
  return static_cast<double>(stamp_ns / 1'000'000'000) + static_cast<double>(stamp_ns % 1'000'000'000) / 1e9;
}

void judgePicture(Frame &frame, int width, int height)
{
  const int has_width = static_cast<int>(frame.image.getWidth()),
            has_height = static_cast<int>(frame.image.getHeight());
  if (frame.image.getSize() > 0 && has_width == width && has_height == height)
    return;
  if (frame.image.getSize() > 0) {
    frame.status = FrameStatus::resized;
    frame.message = fmt::format("image of {}x{} px, must be {}x{}", has_width, has_height, width, height);
  }
  else if (frame.status == FrameStatus::ok) {
    frame.status = FrameStatus::missing;
    frame.message = "the image is empty";
  }
  frame.image.resize(0, 0);
}
} // namespace bole
