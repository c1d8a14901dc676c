// SPDX-License-Identifier: Apache-2.0
// An incremental optimiser that is held against a batch.
#pragma once

#include "core/graph/incremental_optimizer.h"

namespace loci {

// As exact as a batch.
inline IncrementalOptions ExactOptions() {
  IncrementalOptions options;
  options.relinearise_sigma = 1e-9;
  options.relinearise_m = 1e-9;
  options.relinearise_rad = 1e-9;
  options.iterations_max = 100;
  options.step_min = 0.0;
  return options;
}

}  // namespace loci
