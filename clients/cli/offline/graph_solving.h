// SPDX-License-Identifier: Apache-2.0
// The ways in which `loci graph optimize` solves a graph, with what they cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/graph/best_start.h"
#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci::cli {

struct SolveRequest {
  std::string method = "auto";  // one of SolveMethods()
  std::string start = "auto";   // one of SolveStarts()
  std::uint64_t sweeps = 100;   // of the method toro
  bool incremental = false;
  std::string robust = "none";  // one of SolveRobustMethods()
};

std::vector<std::string> SolveMethods();
std::vector<std::string> SolveStarts();
std::vector<std::string> SolveRobustMethods();

// Times of the steps of an incremental run, one per node.
struct StepTimes {
  std::size_t count = 0;
  double mean_ms = 0.0;
  double median_ms = 0.0;
  double p95_ms = 0.0;
  double max_ms = 0.0;
};
StepTimes SummariseSteps(std::vector<double> seconds);

// What a robust method made of the closures: the constraints between nodes that do not follow each
// other in the file.
struct RefusedClosure {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  double chi2 = 0.0;  // at the result
};
struct ClosureReport {
  std::uint64_t accepted_count = 0;
  std::vector<RefusedClosure> refused;
};

struct SolveReport {
  OptimizationSummary summary;  // "before" is at the poses of the file
  std::string start;            // from which the result comes
  double chi2_start = 0.0;      // there; of an incremental run after the last step
  double start_s = 0.0;         // spent on starts, or on the steps
  double solve_s = 0.0;
  std::vector<StartAttempt> attempts;     // if several were tried
  std::optional<StepTimes> steps;         // of an incremental run
  std::optional<ClosureReport> closures;  // of a robust method
};

// A robust method takes the closures that it refuses out of the graph.
// Errors: kUnimplemented for what there is not for such a graph or in this program,
// kInvalidArgument for options that exclude each other.
StatusOr<SolveReport> Solve(const SolveRequest& request, PoseGraph& graph);
StatusOr<SolveReport> Solve(const SolveRequest& request, SpaceGraph& graph);

}  // namespace loci::cli
