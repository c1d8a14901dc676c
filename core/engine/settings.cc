// SPDX-License-Identifier: Apache-2.0
#include "core/engine/settings.h"

#include <string>

namespace loci {
namespace {

Status CheckBounds(const char* field, double value, double low, double high) {
  if (value >= low && value <= high) {  // false for NaN
    return {};
  }
  return InvalidArgumentError(std::string("settings.") + field + ": " + std::to_string(value) +
                              ", must be from " + std::to_string(low) + " to " +
                              std::to_string(high));
}

}  // namespace

Status Validate(const MapSettings& settings) {
  LOCI_RETURN_IF_ERROR(CheckBounds("cell_size_m", settings.cell_size_m, 0.01, 1.0));
  LOCI_RETURN_IF_ERROR(CheckBounds("place_length_m", settings.place_length_m, 1.0, 100.0));
  return CheckBounds("range_max_m", settings.range_max_m, 1.0, 65.0);
}

}  // namespace loci
