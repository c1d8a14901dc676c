// SPDX-License-Identifier: Apache-2.0
// The public pose graphs that benchmarks measure on.
#pragma once

#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "core/graph/g2o_format.h"
#include "tests/support/datasets.h"

namespace loci {

// graphs/NAME.g2o.gz of the data sets. Where it is missing or damaged, says so and returns none.
inline std::optional<G2oGraph> ReadPublicGraph(const std::string& name) {
  const StatusOr<std::string> text = ReadDataset("graphs/" + name + ".g2o.gz");
  if (!text.ok()) {
    std::printf("skipped: %s\n", text.status().message().c_str());
    return std::nullopt;
  }
  StatusOr<G2oGraph> parsed = ParseG2o(*text);
  if (!parsed.ok()) {
    std::printf("%s: %s\n", name.c_str(), parsed.status().ToString().c_str());
    return std::nullopt;
  }
  return std::move(parsed).value();
}

}  // namespace loci
