// SPDX-License-Identifier: Apache-2.0
// Names of maps, sessions, robots and layers: [a-z0-9_-]{1,64}, so that they can stand in file
// names, addresses and logs.
#pragma once

#include <cstddef>
#include <string_view>

#include "core/base/status.h"

namespace loci {

inline constexpr std::size_t kNameSizeMax = 64;

// kInvalidArgument that begins with `field` unless `name` is one.
Status ValidateName(std::string_view name, std::string_view field);

}  // namespace loci
