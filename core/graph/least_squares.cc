// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton with Levenberg's and Marquardt's damping.
#include "core/graph/least_squares.h"

#include <algorithm>
#include <cmath>

namespace loci {
namespace {

// Damping, as a part of H's diagonal. The first is small, since a step that goes too far in one
// bent direction needs little to be held back, and much would cripple all others (on MIT's graph,
// 1e-4 does not converge within 100 steps where 1e-6 takes 29). Below the smallest, a step is an
// undamped one up to rounding; above the largest, a step moves nothing any more.
constexpr double kDampingFirst = 1e-6;
constexpr double kDampingMin = 1e-12;
constexpr double kDampingMax = 1e12;
constexpr double kDampingRise = 10.0;
constexpr double kDampingFall = 0.1;

// The damping after a step that made it better.
double Lowered(double damping) {
  const double lowered = damping * kDampingFall;
  return lowered < kDampingMin ? 0.0 : lowered;
}

double Raised(double damping) {
  return std::max(kDampingFirst, damping * kDampingRise);
}

}  // namespace

LeastSquaresSummary Minimise(LeastSquaresProblem& problem, const LeastSquaresOptions& options) {
  NormalEquations equations(problem.BlockSizes(), problem.Pairs(), problem.Groups());
  return Minimise(problem, equations, options);
}

LeastSquaresSummary Minimise(LeastSquaresProblem& problem,
                             NormalEquations& equations,
                             const LeastSquaresOptions& options) {
  LeastSquaresSummary summary;
  summary.cost_before = problem.Cost();
  summary.cost_after = summary.cost_before;
  if (equations.size() == 0) {
    summary.converged = true;
    return summary;
  }
  double damping = options.damped_from_start ? kDampingFirst : 0.0;
  bool linearised = false;
  bool on_trial = false;  // the state is the one after a step that made it worse
  problem.Mark();
  const auto go_back = [&] {
    problem.MoveBack();
    linearised = linearised && !on_trial;
    on_trial = false;
  };
  for (int i = 0; i < options.iterations_max && damping <= kDampingMax; ++i) {
    if (!linearised) {
      equations.Clear();
      problem.Linearise(equations);
      linearised = true;
    }
    ++summary.iterations;
    if (!equations.Factor(damping)) {
      go_back();
      damping = Raised(damping);
      continue;
    }
    const Eigen::VectorXd step = equations.Step();
    problem.Move(step, equations);
    const double cost = problem.Cost();
    const double gain = summary.cost_after - cost;
    // After a trial it says nothing: the gain is that of two steps, from two places.
    const bool is_small =
        !on_trial && (step.cwiseAbs().maxCoeff() <= options.step_min ||
                      std::abs(gain) <= options.relative_gain_min * summary.cost_after);
    // A cost that is not a number fails this comparison too.
    if (gain >= 0.0) {
      summary.cost_after = cost;
      problem.Mark();
      linearised = false;
      on_trial = false;
    } else if (damping == 0.0 && !on_trial && !is_small && std::isfinite(cost)) {
      // One more undamped step from there: in a bent valley the first one leaves the floor, and the
      // second one comes down on it again far ahead, where damped ones creep (the watchdog of
      // Chamberlain et al. 1982; parking-garage from the chordal start: 4 steps instead of 142).
      linearised = false;
      on_trial = true;
      continue;
    } else {
      go_back();
    }
    if (is_small) {
      summary.converged = true;
      break;
    }
    damping = gain >= 0.0 ? Lowered(damping) : Raised(damping);
  }
  if (on_trial) {
    go_back();
  }
  return summary;
}

}  // namespace loci
