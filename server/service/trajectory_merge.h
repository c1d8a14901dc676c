// SPDX-License-Identifier: Apache-2.0
// The trajectories of a map's sessions in one order of stamps.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/engine/snapshot.h"

namespace loci {

// Steps through poses from the earliest to the latest; poses of the same stamp in order of session.
// Within a session stamps only grow, so that it merges and never sorts: memory follows the number
// of sessions. Not thread-safe.
class TrajectoryMerge {
 public:
  // All sessions, or the one with this name; kNotFound if there is none.
  static StatusOr<TrajectoryMerge> Create(std::shared_ptr<const Snapshot> snapshot,
                                          const std::string& session);

  bool Done() const { return cursors_.empty(); }
  // Of the current pose; not Done().
  const SessionSnapshot& session() const { return *cursors_.front().session; }
  const TrajectoryPose& pose() const { return cursors_.front().pose(); }
  void Advance();

 private:
  // Where the merge is in one session.
  struct Cursor {
    const SessionSnapshot* session = nullptr;
    std::size_t piece = 0;
    std::size_t index = 0;

    const TrajectoryPose& pose() const { return (*session->trajectory[piece])[index]; }
    // Goes over empty pieces. False at the end.
    bool SkipToPose();
  };
  static bool IsLater(const Cursor& a, const Cursor& b);

  explicit TrajectoryMerge(std::shared_ptr<const Snapshot> snapshot)
      : snapshot_(std::move(snapshot)) {}

  std::shared_ptr<const Snapshot> snapshot_;
  std::vector<Cursor> cursors_;  // a heap: the earliest first
};

}  // namespace loci
