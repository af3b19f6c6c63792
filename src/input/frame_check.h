// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a frame may hold, asked before anything takes it in: a frame is taken whole or not at all.

#include <bole/frame.h>

#include <cstdint>
#include <optional>
#include <string>

namespace bole
{
/// Of a stamp from zero, in 2096 by the usual epoch: differences of stamps fit as well.
constexpr std::int64_t kFarthestStamp_ns = 4'000'000'000'000'000'000;

/// Throws for what no camera, gyro or pose filter tells, a mistake of whoever filled the frame: a stamp that is out of
/// range or not later than that of the frame before, an odometry that is not finite or turns by no rotation, samples of
/// gyro or accelerometer that are not finite or not in the order of time. The picture is a matter of the status: see
/// judgePicture().
/// \param index of the frame in its flight, for the message; nothing where it is in none yet
/// \param last_stamp_ns of the frame before it
void requireSound(const Frame &frame, std::optional<std::size_t> index = {},
                  std::optional<std::int64_t> last_stamp_ns = {});

/// A time in seconds as a stamp [ns]. Throws "NAME = ... s, must be ..." where it is not finite or out of range.
std::int64_t stampOf(double seconds, const std::string &name);

/// The number that stampOf() makes the same stamp of: seconds of the usual epoch keep all nine digits that fit.
double secondsOfStamp(std::int64_t stamp_ns);

/// A frame without a picture that was `ok` becomes `missing`, one with a picture of another size `resized`, and loses
/// it.
void judgePicture(Frame &frame, int width, int height);
} // namespace bole
