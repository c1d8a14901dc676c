// SPDX-License-Identifier: Apache-2.0
// What can be set when a map is made. Settings are part of the first event and never change.
#pragma once

#include <cstdint>

#include "core/base/status.h"

namespace loci {

struct MapSettings {
  // Side of a cell of the occupancy layers, in metres; 0.01 to 1. Default: design.md section 6, one
  // pixel at zoom 8.
  double cell_size_m = 0.05;
  // A place ends after this distance driven, in metres; 1 to 100. Shorter places bend better when a
  // loop closes; longer ones make a smaller graph. Default: notes on matching, 5 m.
  double place_length_m = 5.0;
  // Readings beyond this take no part in matching and mapping, in metres; 1 to 65.
  double range_max_m = 15.0;
  // Part of every seed of the engine's random numbers.
  std::uint64_t seed = 0;

  friend bool operator==(const MapSettings&, const MapSettings&) = default;
};

// kInvalidArgument that names the field, if one is out of its bounds or not finite.
Status Validate(const MapSettings& settings);

template <typename Archive>
void Fields(Archive& archive, MapSettings& settings) {
  archive(settings.cell_size_m, settings.place_length_m, settings.range_max_m, settings.seed);
}

}  // namespace loci
