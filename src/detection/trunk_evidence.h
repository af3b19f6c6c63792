// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What all frames of a flight say of a trunk that may stand somewhere.
///
/// Idea: a trunk is nearer than what is seen on both sides of it. Its columns agree with other frames at its own range
/// and not farther off, those beside it do so farther off and not at its range, and between them brightness steps, at
/// each border in the same direction from wherever it is seen. A gap between trunks, the edge of a shadow on the bark
/// and borders of different trunks fail in one or another.

#include "detection/column_depth.h"
#include <bole/trunk.h>

namespace bole
{
/// A frame that is asked.
struct EvidenceView
{
  LevelImage image;
  ColumnDepth depth;
};

/// Every third of \p images, matched with those before and after it that are \p baseline away [m].
std::vector<EvidenceView> evidenceViews(const std::vector<LevelImage> &images, double baseline,
                                        const DepthSweep &sweep);

/// Where a trunk is looked at.
struct EvidencePart
{
  double low = 0.25, high = 2.6; ///< heights over the ground [m]
  double ground_z = 0;           ///< [m]
  double range_max = 12;         ///< [m]
};

/// Means over the views. Differences are those of ColumnDepth::cost.
struct TrunkEvidence
{
  int views = 0;
  double inside = 0;          ///< by how much its columns agree better at its range than farther off
  double covered = 0;         ///< ... than nearer
  double left = 0, right = 0; ///< by how much the columns beside it agree better farther off than at its range
  double border = 0;          ///< step of brightness along the weaker border, in that of all columns
  double constant = 0;        ///< how constant the weaker border's step is, 0 to 1
  double width_px = 0;
  double range = 0;    ///< [m]
  double parallax = 0; ///< angle between the lines of sight [rad]
};

TrunkEvidence evidenceOf(const Trunk &trunk, const std::vector<EvidenceView> &views, const DepthSweep &sweep,
                         const EvidencePart &part);

/// What the log-odds are a weighted sum of; the last is 1.
using EvidenceTerms = Eigen::Matrix<double, 11, 1>;
EvidenceTerms termsOf(const TrunkEvidence &evidence);
extern const char *const kEvidenceTermNames[EvidenceTerms::RowsAtCompileTime];

/// Log-odds to be a trunk.
double logOdds(const TrunkEvidence &evidence);
} // namespace bole
