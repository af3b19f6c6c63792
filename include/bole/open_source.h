// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One door to every kind of recording.

#include <bole/frame.h>
#include <bole/source_options.h>

namespace bole
{
/// Opens \p input: an ASL folder (AslSource), a pattern such as `image%04d.png` or a folder of
/// numbered images (SequenceSource), or else a video file (VideoSource). Errors: vpException, one
/// line that names the input and what is wrong with it.
///
/// \code
/// const auto source = openSource("data/park-forward");
/// for (Frame frame; source->next(frame);)
///   use(frame);
/// \endcode
std::unique_ptr<FrameSource> openSource(const std::string &input, const SourceOptions &options = {});
} // namespace bole
