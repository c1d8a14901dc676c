// SPDX-License-Identifier: Apache-2.0
// A term of one variable, linearised: absolute priors.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "core/graph/normal_equations.h"

namespace loci {

template <int kError, int kSize>
struct LinearisedPrior {
  Eigen::Matrix<double, kError, 1> error;
  Eigen::Matrix<double, kError, kSize> jacobian;
};

// Adds J^T W J and J^T W e to a block; to none, if the block is kHeldBlock.
template <int kError, int kSize>
void AddPrior(const LinearisedPrior<kError, kSize>& linearised,
              const Eigen::Matrix<double, kError, kError>& weight,
              std::uint32_t block,
              NormalEquations& equations) {
  AddSingle(linearised.error, linearised.jacobian, weight, block, equations);
}

}  // namespace loci
