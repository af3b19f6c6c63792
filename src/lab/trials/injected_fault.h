// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A fault of the camera during a servo trial: which, when and for how long.

#include "lab/faults/image_fault.h"
#include "lab/simulation/random.h"
#include <bole/frame.h>

namespace bole
{
struct FaultOptions
{
  FaultKind kind = FaultKind::none;
  double start_s = 5;    ///< after the task began to servo, 0 to 3600
  double duration_s = 3; ///< 0.05 to 3600

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// Spoils the pixels of frames and nothing else: no stage is told.
class FaultInjector
{
public:
  explicit FaultInjector(const FaultOptions &options, std::uint64_t seed = 1);
  /// \param servoing_s time since the task began to servo, negative before. Whether \p frame was spoilt.
  bool apply(Frame &frame, double servoing_s);

private:
  FaultOptions m_options;
  Random m_random;
  vpImage<unsigned char> m_last;
};
} // namespace bole
