// SPDX-License-Identifier: Apache-2.0
// The engine's pose graph: places, what ties them, and where they are. Internal to core/engine.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/geometry/eigen_fields.h"
#include "core/graph/incremental_optimizer.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

// A constraint of the map: odometry between places, or a closure.
struct MapConstraint {
  GraphConstraint constraint;
  std::optional<ClosureId> closure;
};

// Node i is place i; place 0 is fixed. Kept at its optimum by an IncrementalOptimizer, where
// closures pull less and less beyond three sigma, since they may be wrong. A place is added where
// its tie says, and moves nothing. Where closures make the cost worse than it was, or do not
// converge, the batch optimiser takes the place of the incremental one.
//
// An IncrementalOptimizer depends on how it came to where it is. So that a map that is read from
// its records goes on with the same bits, the graph is written down as a base, from which an
// optimiser can be made, and the steps since. With the first closures after so many steps the
// present graph becomes the base, in whose making the batch optimiser removes what linearisation
// has left.
class MapGraph {
 public:
  MapGraph();

  // Of closures, which are marked robust.
  static RobustKernel ClosureKernel();

  // Of places and all constraints, at the optimum that the last closures led to.
  const PoseGraph& graph() const { return present_; }
  const Pose2& map_from_place(PlaceId place) const { return present_.map_from_node[place.value]; }
  const std::vector<Pose2>& map_from_places() const { return present_.map_from_node; }
  // Of each constraint of the graph: the closure that it is, if it is one.
  const std::vector<std::optional<ClosureId>>& closures() const { return closures_; }
  std::size_t closure_count() const;
  // Of each constraint of the graph, without kernel; and their sum.
  const std::vector<double>& chi2s() const { return chi2s_; }
  double chi2() const;

  // The next place. Without a tie it must be the first one.
  void AddPlace(const Pose2& map_from_place, const std::optional<GraphConstraint>& tie);
  // In whichever order they are given.
  void AddClosures(std::vector<MapConstraint> closures);
  // Must be there.
  void RemoveClosure(ClosureId closure);

  // False where ties are so unlike that rounding has made their equations singular: places stand
  // still then, and nothing is known of how they lie to each other.
  bool is_determined() const { return is_determined_; }
  // Of from_from_to * Exp(xi), (x, y, theta).
  Eigen::Matrix3d RelativeCovariance(PlaceId from, PlaceId to) const;

  // The state. The base changes seldom, the steps with each call: they are records of their own.
  template <typename Archive>
  void BaseFields(Archive& archive) {
    archive(base_poses_, base_constraints_, base_count_);
  }
  template <typename Archive>
  void StepFields(Archive& archive) {
    archive(steps_, steps_base_);
  }
  bool is_empty() const { return base_poses_.empty() && steps_.empty(); }
  // How often the base has changed.
  std::uint64_t base_count() const { return base_count_; }
  // Makes the graph from a base and steps that were read. Errors: kDataLoss, they do not fit.
  Status Restore();

 private:
  enum class StepKind : std::uint8_t { kPlace, kClosures, kRemoval };
  struct Step {
    StepKind kind = StepKind::kPlace;
    Pose2 map_from_place;                    // of kPlace
    std::vector<MapConstraint> constraints;  // of kPlace: none or one
    ClosureId removed;                       // of kRemoval

    template <typename Archive>
    friend void Fields(Archive& archive, Step& step) {
      archive(step.kind, step.map_from_place, step.constraints, step.removed);
    }
  };

  void Take(Step step);
  void Add(const Step& step);
  bool Update();
  void MovePlaces();
  void Weigh(std::size_t constraint);
  void BeginBase();
  void LoadBase();
  double Cost() const;
  Status CheckBase() const;
  Status CheckStep(const Step& step) const;

  // State. The rest follows from it.
  std::vector<Pose2> base_poses_;
  std::vector<MapConstraint> base_constraints_;
  std::uint64_t base_count_ = 0;
  std::vector<Step> steps_;
  std::uint64_t steps_base_ = 0;  // base_count_ of the base that the steps follow

  PoseGraph present_;
  std::vector<std::optional<ClosureId>> closures_;  // per constraint
  std::vector<std::uint32_t> numbers_;              // per constraint: that of the optimiser
  std::vector<double> chi2s_;                       // per constraint
  std::vector<double> costs_;                       // per constraint: the same by the kernel
  IncrementalOptimizer optimizer_;
  bool is_determined_ = true;
};

template <typename Archive>
void Fields(Archive& archive, GraphConstraint& constraint) {
  archive(constraint.from, constraint.to, constraint.from_from_to, constraint.information);
  archive(constraint.robust);
}

template <typename Archive>
void Fields(Archive& archive, MapConstraint& constraint) {
  archive(constraint.constraint, constraint.closure);
}

}  // namespace loci
