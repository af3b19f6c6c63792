// SPDX-License-Identifier: GPL-2.0-or-later
// The loops over pixels as the least machine runs them, under a name of their own.
#include "geometry/vector_clones.h"
#undef BOLE_VECTOR_CLONES
#define BOLE_VECTOR_CLONES
#define bole bole_plain

#include "detection/column_loops.cpp"
#include "detection/window_loops.cpp"
#include "gradient/line_loops.cpp"
#include "motion/epipolar_loops.cpp"
#include "motion/window_loops.cpp"
#include "saliency/saliency_loops.cpp"
#include "smoothing/front_loops.cpp"
#include "tracking/tracking_loops.cpp"
#include "vector_loops.h"

std::vector<double> outputsOfPlainLoops() { return bole_plain::LoopOutputs().all(); }
