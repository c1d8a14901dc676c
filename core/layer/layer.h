// SPDX-License-Identifier: Apache-2.0
// The dense properties that a map keeps.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace loci {

// The numbers are those of the protocol's style and never change.
enum class Layer : std::uint8_t {
  kOccupancy = 0,  // log-odds that something stands there
  kMoving = 1,     // log-odds that something moved there
};

inline constexpr std::array<Layer, 2> kLayers = {Layer::kOccupancy, Layer::kMoving};

// The name that users write: "occupancy", "moving".
constexpr std::string_view LayerName(Layer layer) {
  return layer == Layer::kOccupancy ? "occupancy" : "moving";
}

// Nothing if no layer has this name.
constexpr std::optional<Layer> LayerFromName(std::string_view name) {
  for (const Layer layer : kLayers) {
    if (LayerName(layer) == name) {
      return layer;
    }
  }
  return std::nullopt;
}

}  // namespace loci
