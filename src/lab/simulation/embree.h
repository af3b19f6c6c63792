// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What differs between Embree 3 and 4, in one place. Where both are installed, the build and this header take the
/// newer.

#if __has_include(<embree4/rtcore.h>)
#define BOLE_HAS_EMBREE_4 1
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace bole::embree
{
/// Sets \p ray.tfar to minus infinity where anything is hit.
inline void occluded(RTCScene scene, RTCRay &ray)
{
#if BOLE_HAS_EMBREE_4
  rtcOccluded1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
#endif
}

/// The nearest hits of sixteen rays that lie side by side; those with -1 in \p valid are traced.
inline void intersectCoherent(const int *valid, RTCScene scene, RTCRayHit16 &rays)
{
#if BOLE_HAS_EMBREE_4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect16(valid, scene, &rays, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid, scene, &context, &rays);
#endif
}
} // namespace bole::embree
