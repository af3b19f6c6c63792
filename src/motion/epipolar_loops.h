// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: sums of Sampson's residual over all matches.

#include <vector>

namespace bole::motion
{
constexpr double kKernel = 3;     ///< residuals lose half their weight near this many sigmas
constexpr double kEpipole = 0.04; ///< angle from the epipole within which a match has little say [rad]: 4 px of a small
                                  ///< camera

/// Matches as (x, y, 1) of both frames, number by number.
struct RayColumns
{
  std::vector<double> ax, ay, bx, by;
};

/// What all matches share: the essential matrix, the rotation (row by row) and the tangents of the direction (a column
/// after the other); and the noise.
struct EpipolarTerms
{
  double E[9], R[9], B[6];
  double sigma;
  double shear = 0; ///< of the rows of b: x is less by so much of y
};

/// Sum of the robust costs.
double costOfMatches(const RayColumns &rays, const EpipolarTerms &terms);

/// Sums of the weighted products of the derivatives by (phi, tau), the upper triangle by rows, and of derivative and
/// residual; both in sigmas.
struct EpipolarSums
{
  double H[15], g[5];
};
EpipolarSums sumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms);

/// The same by (phi, tau, shear).
struct ShearSums
{
  double H[21], g[6];
};
ShearSums shearSumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms);

/// Sampson's residual of each match.
void residualsOfMatches(const RayColumns &rays, const EpipolarTerms &terms, double *residuals);

/// Sums over the matches before the camera of what their flow, the rotation taken out, is along the epipolar lines and
/// across, in sigmas: weighted squares, weights, and votes for the sign of the direction \p t.
struct FlowSums
{
  double along, across, sum, agreement, squares;
};
FlowSums flowSumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms, const double *t);

/// Flow of each match that a rotation leaves, in the image of a: all x, then all y. \p R: takes b to a, column by
/// column.
void transferResiduals(const RayColumns &rays, const double *R, double *residuals);

/// Sums of the weighted products of the derivatives of those residuals by the rotation, upper triangle by rows, and of
/// derivative and residual. \p variance: of the length of a residual.
struct TransferSums
{
  double H[6], g[3];
};
TransferSums sumsOfTransfers(const RayColumns &rays, const double *R, const double *residuals, double variance);
} // namespace bole::motion
