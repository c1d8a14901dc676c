// SPDX-License-Identifier: Apache-2.0
#include "server/service/trajectory_merge.h"

#include <algorithm>
#include <utility>

namespace loci {

StatusOr<TrajectoryMerge> TrajectoryMerge::Create(std::shared_ptr<const Snapshot> snapshot,
                                                  const std::string& session) {
  TrajectoryMerge merge(std::move(snapshot));
  bool found = session.empty();
  for (const SessionSnapshot& candidate : merge.snapshot_->sessions) {
    if (!session.empty() && candidate.session != session) {
      continue;
    }
    found = true;
    Cursor cursor{&candidate, 0, 0};
    if (cursor.SkipToPose()) {
      merge.cursors_.push_back(cursor);
    }
  }
  if (!found) {
    return NotFoundError("session: \"" + session + "\" was never opened in this map");
  }
  std::make_heap(merge.cursors_.begin(), merge.cursors_.end(), IsLater);
  return merge;
}

void TrajectoryMerge::Advance() {
  std::pop_heap(cursors_.begin(), cursors_.end(), IsLater);
  Cursor& earliest = cursors_.back();
  ++earliest.index;
  if (earliest.SkipToPose()) {
    std::push_heap(cursors_.begin(), cursors_.end(), IsLater);
  } else {
    cursors_.pop_back();
  }
}

bool TrajectoryMerge::Cursor::SkipToPose() {
  while (piece < session->trajectory.size() && index >= session->trajectory[piece]->size()) {
    ++piece;
    index = 0;
  }
  return piece < session->trajectory.size();
}

bool TrajectoryMerge::IsLater(const Cursor& a, const Cursor& b) {
  const std::int64_t a_ns = a.pose().stamp_ns;
  const std::int64_t b_ns = b.pose().stamp_ns;
  return a_ns != b_ns ? a_ns > b_ns : a.session->id > b.session->id;
}

}  // namespace loci
