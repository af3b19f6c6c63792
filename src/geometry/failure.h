// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A user's mistake, or a file or device that fails: vpException with a formatted message.

#include <bole/visp.h>
#include <fmt/format.h>
#include <utility>
#include <visp3/core/vpException.h>

namespace bole
{
/// Makes what is to be thrown: `throw badValue("{} = {}, must be above 0", name, value);`
template <int kCode> struct Failure
{
  template <typename... Arguments>
  vpException operator()(fmt::format_string<Arguments...> text, Arguments &&...arguments) const
  {
    return vpException(kCode, fmt::format(text, std::forward<Arguments>(arguments)...));
  }
};

inline constexpr Failure<vpException::badValue> badValue;
inline constexpr Failure<vpException::dimensionError> dimensionError;
inline constexpr Failure<vpException::fatalError> fatalError;
inline constexpr Failure<vpException::ioError> ioError;
inline constexpr Failure<vpException::memoryAllocationError> memoryAllocationError;
inline constexpr Failure<vpException::notImplementedError> notImplementedError;
inline constexpr Failure<vpException::notInitialized> notInitialized;

/// One line of an Options::validate(): throws "name = value, must be in [low, high]", also where \p value is NaN.
inline void requireRange(const char *name, double value, double low, double high)
{
  if (!(value >= low && value <= high))
    throw badValue("{} = {:g}, must be in [{:g}, {:g}]", name, value, low, high);
}
} // namespace bole
