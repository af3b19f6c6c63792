// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The three columns of V (Eq. 14) as arrows over the image: the paper's Fig. 5.

#include <bole/camera.h>

#include <string>

namespace bole::apps
{
/// One panel an axis, as SVG.
std::string basisFlowsSvg(const PinholeCamera &camera);
} // namespace bole::apps
