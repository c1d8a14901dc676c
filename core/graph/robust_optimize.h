// SPDX-License-Identifier: Apache-2.0
// Optimisation of a pose graph in which constraints marked `robust` may be wrong.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/status.h"
#include "core/graph/graph_selection.h"
#include "core/graph/pose_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

// Kernels find the map if they start near it, and carry every false closure in their equations all
// the way, which costs time; kConsistent starts from nothing but the constraints that are not
// robust, and is what to take where closures are many and some are wrong.
enum class RobustMethod : std::uint8_t {
  kNone,               // all are right
  kHuber,              // core/graph/robust_kernel.h
  kCauchy,             // the same
  kGemanMcClure,       // the same, with graduated non-convexity
  kDynamicCovariance,  // the same
  kConsistent,         // core/graph/closure_growth.h
};

inline constexpr std::array kRobustMethods = {RobustMethod::kNone,
                                              RobustMethod::kHuber,
                                              RobustMethod::kCauchy,
                                              RobustMethod::kGemanMcClure,
                                              RobustMethod::kDynamicCovariance,
                                              RobustMethod::kConsistent};

// "none", "huber", "cauchy", "geman-mcclure", "dcs", "consistent".
std::string_view RobustMethodName(RobustMethod method);
std::optional<RobustMethod> RobustMethodFromName(std::string_view name);

struct RobustOptions {
  RobustMethod method = RobustMethod::kConsistent;
  // Of the last optimisation, over what is accepted; its kernel is not used. Kernels take as many
  // steps as this too.
  SparseOptions sparse;
};

struct RobustSummary {
  // "before": at the given poses, of all constraints. "after", `converged` and `iterations`: of the
  // last optimisation, over the accepted constraints only.
  OptimizationSummary optimization;
  bool began_at_trusted = false;  // at the poses that follow from the trusted constraints
  double chi2_start = 0.0;        // where it began, of all constraints
  GraphSelection accepted;        // with all that is not robust
  // The part of the stated covariances that kConsistent found the errors to have; 1 elsewhere.
  double covariance_scale = 1.0;
};

// Marks the constraints between nodes that do not follow each other as robust, and no others: where
// nodes are numbered along the robot's path, all but its odometry.
void MarkClosures(PoseGraph& graph);

// Moves `graph` to the optimum over the constraints that it accepts: those that are not robust, and
// those whose chi2 there passes its gate. Fixed order throughout: the same graph gives the same
// bits.
//
// What passes is looked for at one optimum after the other until nothing changes. From the sixth on
// constraints are only refused, so that it ends; some that would fit the last one may be missing
// then. The twentieth is the last in any case, and only there something that does not pass may be
// left among what is accepted.
//
// Kernels begin at the given poses or, where the kernel's cost is lower there, at the poses that
// follow from the trusted constraints alone. kConsistent begins at those always. It leaves robust
// point constraints and priors to Geman and McClure's kernel, when the poses are found, and accepts
// no robust constraint between components that core/graph/closure_growth.h did not join, however
// well the given poses fit it; all that hold a fixed node are one component there.
// Errors: those of ValidateGraph, and kFailedPrecondition for kConsistent where there is a joint
// constraint, since its paths lead over pairs only. The graph is unchanged then.
StatusOr<RobustSummary> OptimizeRobustly(PoseGraph& graph, const RobustOptions& options);

}  // namespace loci
