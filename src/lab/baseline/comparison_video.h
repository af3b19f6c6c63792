// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where each tracker of a comparison believes the model to be, side by side.

#include "lab/baseline/comparison.h"

namespace bole
{
/// Writes a video of two columns to \p path (mp4): a picture for each of \p scores that had a prior, with the model
/// \p cao_path drawn where its pose puts it and its error below: green where it is right, orange where it complained,
/// red where it is wrong in silence. Nothing is written when there is none.
///
/// \throw vpException naming the file, when it cannot be written.
void writeComparisonVideo(const std::string &path, const TestFlight &flight, const std::string &cao_path,
                          const std::vector<Score> &scores);
} // namespace bole
