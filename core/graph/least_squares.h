// SPDX-License-Identifier: Apache-2.0
// Minimisation of a sum of squares over small blocks: Gauss-Newton, damped where it must be.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/graph/normal_equations.h"

namespace loci {

// What the minimiser needs to know of a problem; held variables are not among its blocks.
class LeastSquaresProblem {
 public:
  virtual ~LeastSquaresProblem() = default;

  virtual std::vector<int> BlockSizes() const = 0;
  virtual std::vector<BlockPair> Pairs() const = 0;
  virtual std::vector<BlockGroup> Groups() const { return {}; }

  // The sum of rho(e^T Omega e) at the present state.
  virtual double Cost() const = 0;
  // Adds H and g of half the cost to `equations`, which are clear.
  virtual void Linearise(NormalEquations& equations) const = 0;
  // Moves the state by `step`.
  virtual void Move(const Eigen::VectorXd& step, const NormalEquations& equations) = 0;
  // Remembers the state.
  virtual void Mark() = 0;
  // Returns to the state of the last Mark.
  virtual void MoveBack() = 0;

 protected:
  LeastSquaresProblem() = default;
  LeastSquaresProblem(const LeastSquaresProblem&) = default;
  LeastSquaresProblem& operator=(const LeastSquaresProblem&) = default;
};

struct LeastSquaresOptions {
  bool damped_from_start = false;
  int iterations_max = 100;
  double relative_gain_min = 1e-10;  // converged below this part of the cost
  double step_min = 1e-10;           // converged when no entry of a step is larger
};

struct LeastSquaresSummary {
  int iterations = 0;
  double cost_before = 0.0;
  double cost_after = 0.0;
  bool converged = false;
};

// Moves the problem to a local minimum; never to a higher cost than it had.
LeastSquaresSummary Minimise(LeastSquaresProblem& problem, const LeastSquaresOptions& options);
// The same with equations that there are already, of the problem's blocks and pairs.
LeastSquaresSummary Minimise(LeastSquaresProblem& problem,
                             NormalEquations& equations,
                             const LeastSquaresOptions& options);

}  // namespace loci
