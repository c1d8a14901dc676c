// SPDX-License-Identifier: Apache-2.0
// A place: a short local map, rigid in its frame (a FSH node, a SCRIM local grid).
#pragma once

#include <cstdint>

#include "core/base/archive.h"
#include "core/base/ids.h"
#include "core/grid/log_odds_grid.h"
#include "core/place/coverage.h"
#include "core/place/patch.h"

namespace loci {

// Where the place is, the pose graph knows; this is what it holds, in its own frame.
struct Place {
  PlaceId id;
  SessionId session;
  std::uint32_t number = 0;  // of the session's places, from 0
  Patch patch;
  LogOddsGrid stationary;  // until it is consolidated
  LogOddsGrid moving;      // the same
  Coverage coverage;       // made when the place is finished
  std::int64_t last_stamp_ns = 0;
  bool finished = false;
  bool consolidated = false;
  // Event that changed it last: for checkpoints, not state.
  EventNumber changed_by;
};

template <typename Archive>
void Fields(Archive& archive, Place& place) {
  archive(place.id, place.session, place.number, place.patch, place.stationary, place.moving);
  archive(place.coverage, place.last_stamp_ns, place.finished, place.consolidated);
}

}  // namespace loci
