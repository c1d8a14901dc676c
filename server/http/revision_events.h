// SPDX-License-Identifier: Apache-2.0
// The revisions of one map as server-sent events, merged for a viewer that reads slowly.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "server/http/http_message.h"
#include "server/snapshot_source.h"

namespace loci {

// Events of `map` from now on. The first one names the newest revision and says that everything
// moved, so that a viewer that comes back after a pause is right again.
//
//   id: 41
//   event: revision
//   data: {"dirty_tiles":[[0,-1]],"everything_moved":false,"revision":41,"tile_zoom":8}
//
// `event: ended`, without more, is the last one: the map was deleted, or the server stops.
// Errors: those of SnapshotSource::Subscribe. `maps` must outlive the source.
StatusOr<std::unique_ptr<HttpEventSource>> OpenRevisionEvents(SnapshotSource& maps,
                                                              const std::string& map,
                                                              std::function<void()> wake);

}  // namespace loci
