// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Loops that are compiled twice: for the least machine of the architecture and for one with AVX2. The loader takes the
/// one that the machine can run. Neither contracts products and sums, so that results differ by the order of sums
/// alone.

#include <climits> // glibc's version

#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#if defined(__has_feature)
#if !__has_feature(address_sanitizer) && !__has_feature(thread_sanitizer)
#define BOLE_VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#endif
#else
#define BOLE_VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#endif
#endif
#ifndef BOLE_VECTOR_CLONES // the loader may choose only where it can, and before no sanitizer is ready
#define BOLE_VECTOR_CLONES
#endif
