// SPDX-License-Identifier: Apache-2.0
// What the HTTP server says: maps, tiles, events of revisions, metrics, health, and the viewer.
//
//   /                                            the viewer page
//   /maps                                        all maps (JSON)
//   /maps/MAP                                    revision, bounds, layers (JSON)
//   /maps/MAP/tiles/LAYER/Z/X/Y.png?revision=N   one tile; without a revision, of the newest
//   /maps/MAP/events                             server-sent events, one for each revision
//   /metrics /healthz /readyz                    for operators
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/layer/layer.h"
#include "core/tile/zoom.h"
#include "server/http/http_message.h"
#include "server/metrics/metrics.h"
#include "server/snapshot_source.h"

namespace loci {

// The PNG of a tile; `address` is valid. Runs on several threads at a time.
using TilePainter = std::function<std::shared_ptr<const std::string>(
    const std::shared_ptr<const Snapshot>& snapshot, Layer layer, const TileAddress& address)>;

// A file that is compiled into the program.
struct StaticFile {
  std::string_view path;  // without the leading slash; empty for the front page
  std::string_view content_type;
  std::string_view content;
};

// Answers requests from `maps`. Thread-safe; all that is handed over must outlive it.
class MapRoutes {
 public:
  MapRoutes(SnapshotSource& maps,
            const MetricRegistry& metrics,
            TilePainter painter,
            std::span<const StaticFile> files);

  HttpAnswer Answer(const HttpRequest& request) const;

 private:
  HttpAnswer AnswerTile(const HttpRequest& request) const;
  HttpAnswer AnswerMap(const std::string& map) const;
  HttpAnswer AnswerEvents(const std::string& map) const;
  HttpResponse MapList() const;
  HttpResponse Readiness() const;

  SnapshotSource& maps_;
  const MetricRegistry& metrics_;
  const TilePainter painter_;
  const std::span<const StaticFile> files_;
};

}  // namespace loci
