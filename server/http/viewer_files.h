// SPDX-License-Identifier: Apache-2.0
// The viewer page (clients/web), compiled into the program.
#pragma once

#include <span>

#include "server/http/map_routes.h"

namespace loci {

std::span<const StaticFile> ViewerFiles();

}  // namespace loci
