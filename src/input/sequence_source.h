// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Numbered images as a video.

#include "input/recorded_source.h"

namespace bole
{
/// Reads `folder/image%04d.png`, named as vpVideoReader does, or a folder whose images differ in one number.
///
/// Every number between the first and the last image is a frame (where all are 5 apart, every fifth): one that is not
/// there is `missing`, one that cannot be decoded `corrupt`, one of another size `resized`, one with the
/// pixels of the frame before `stale`. Stamps are (number - first) / SourceOptions::frame_rate_hz.
///
/// vpVideoReader itself is not used for the pixels: it leaves out images it cannot read without a word, so that every
/// later frame would get the time of an earlier one. Its parser of names (vpIoTools::getIndex) is.
///
/// Errors: vpException when there is no such image, none can be read, or the camera is of another size.
class SequenceSource : public ImageFilesSource
{
public:
  explicit SequenceSource(const std::string &pattern, const SourceOptions &options = {});

  /// The pattern of a folder of numbered images, or empty.
  static std::string patternOf(const std::string &folder);
  /// Whether \p path has the name of a picture.
  static bool isImage(const std::string &path);
};
} // namespace bole
