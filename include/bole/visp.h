// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What differs between ViSP 3.5 and 3.7, in one place: since 3.7 its classes may stand in a namespace, as they do in
/// Debian's packages. It is opened here, so that vpImage is vpImage with all of them.

#include <visp3/core/vpConfig.h>

#ifdef ENABLE_VISP_NAMESPACE
using namespace VISP_NAMESPACE_NAME;
#endif
