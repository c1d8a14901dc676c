// SPDX-License-Identifier: Apache-2.0
#include "server/http/map_routes.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/hash.h"
#include "core/base/name.h"
#include "core/tile/tile_renderer.h"
#include "server/http/revision_events.h"

namespace loci {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kTileSuffix = ".png";
// Beyond 0.0125 m to a pixel even the smallest cells only grow.
constexpr int kViewerZoomMax = 10;

HttpResponse JsonResponse(unsigned status, const Json& json) {
  // A problem may quote bytes of a damaged file: what is no UTF-8 is replaced.
  HttpResponse response =
      TextResponse(status, json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n");
  response.content_type = "application/json";
  return response;
}

std::string ContentEtag(std::string_view content) {
  Hasher hasher;
  hasher.AddBytes(std::as_bytes(std::span(content)));
  return '"' + hasher.Finish().ToHex() + '"';
}

// All of `text` as a number; the message names the field and what is allowed.
template <typename Integer>
StatusOr<Integer> ParseInteger(std::string_view text, const std::string& field) {
  Integer value = 0;
  const char* const end = text.data() + text.size();
  const std::from_chars_result parsed = std::from_chars(text.data(), end, value);
  if (text.empty() || parsed.ec != std::errc() || parsed.ptr != end) {
    return InvalidArgumentError(field + ": must be a whole number within its type's bounds");
  }
  return value;
}

StatusOr<TileAddress> ParseTileAddress(std::span<const std::string> segments) {
  std::string_view last = segments[2];
  if (!last.ends_with(kTileSuffix)) {
    return InvalidArgumentError("y: must end in .png");
  }
  last.remove_suffix(kTileSuffix.size());
  TileAddress address;
  LOCI_ASSIGN_OR_RETURN(address.zoom, ParseInteger<int>(segments[0], "z"));
  LOCI_ASSIGN_OR_RETURN(address.x, ParseInteger<std::int32_t>(segments[1], "x"));
  LOCI_ASSIGN_OR_RETURN(address.y, ParseInteger<std::int32_t>(last, "y"));
  LOCI_RETURN_IF_ERROR(Validate(address));
  return address;
}

// The revision that the query pins; a default one if it pins none.
StatusOr<Revision> ParseRevision(const HttpRequest& request) {
  for (const auto& [key, value] : request.query) {
    if (key != "revision") {
      return InvalidArgumentError("query: unknown parameter, must be revision");
    }
  }
  const auto found = request.query.find("revision");
  if (found == request.query.end()) {
    return Revision();
  }
  LOCI_ASSIGN_OR_RETURN(const std::uint64_t number,
                        ParseInteger<std::uint64_t>(found->second, "revision"));
  return Revision{number};
}

const char* StateName(MapState state) {
  switch (state) {
    case MapState::kRecovering:
      return "recovering";
    case MapState::kServing:
      return "serving";
    case MapState::kRefused:
      return "refused";
  }
  return "unknown";
}

// [x_min, y_min, x_max, y_max] in metres; null while nothing was observed.
Json BoundsJson(const Snapshot& snapshot) {
  const BoxInMap box = MapBounds(snapshot, Layer::kOccupancy);
  if (box.Empty()) {
    return nullptr;
  }
  return {box.min.x(), box.min.y(), box.max.x(), box.max.y()};
}

HttpResponse DescribeMap(const std::string& map, const Snapshot& snapshot) {
  Json layers = Json::array();
  for (const Layer layer : kLayers) {
    layers.push_back(std::string(LayerName(layer)));
  }
  // The finest zoom worth asking for: one pixel is at most half a cell there.
  const double levels = std::log2(PixelSideM(0) / snapshot.settings.cell_size_m);
  const int zoom_max = std::clamp(static_cast<int>(std::ceil(levels)) + 1, 0, kViewerZoomMax);
  return JsonResponse(200,
                      {{"map", map},
                       {"revision", snapshot.revision.value},
                       {"bounds_m", BoundsJson(snapshot)},
                       {"layers", layers},
                       {"tile_side_pixels", kTileSide},
                       {"tile_side_at_zoom_0_m", kTileSideAtZoom0M},
                       {"zoom_max", zoom_max},
                       {"cell_size_m", snapshot.settings.cell_size_m},
                       {"places", snapshot.places.size()},
                       {"sessions", snapshot.sessions.size()},
                       {"closures", snapshot.closures_accepted}});
}

HttpResponse NothingHere() {
  return ErrorResponse(
      NotFoundError("path: nothing is served here; see /maps, /metrics, /healthz"));
}

}  // namespace

MapRoutes::MapRoutes(SnapshotSource& maps,
                     const MetricRegistry& metrics,
                     TilePainter painter,
                     std::span<const StaticFile> files)
    : maps_(maps), metrics_(metrics), painter_(std::move(painter)), files_(files) {}

HttpAnswer MapRoutes::Answer(const HttpRequest& request) const {
  const std::vector<std::string>& path = request.path;
  if (path.size() <= 1) {
    const std::string name = path.empty() ? "" : path[0];
    if (name == "healthz") {
      return TextResponse(200, "alive\n");
    }
    if (name == "readyz") {
      return Readiness();
    }
    if (name == "metrics") {
      return HttpWork([this] {
        HttpResponse response = TextResponse(200, metrics_.Text());
        response.content_type = "text/plain; version=0.0.4; charset=utf-8";
        return response;
      });
    }
    if (name == "maps") {
      return MapList();
    }
    for (const StaticFile& file : files_) {
      if (file.path == name) {
        HttpResponse response = TextResponse(200, std::string(file.content));
        response.content_type = file.content_type;
        response.etag = ContentEtag(file.content);
        // The page needs nothing from elsewhere, and may run nothing from elsewhere.
        response.headers.emplace_back("Content-Security-Policy",
                                      "default-src 'self'; img-src 'self' data:");
        return response;
      }
    }
    return NothingHere();
  }
  if (path[0] != "maps") {
    return NothingHere();
  }
  if (const Status status = ValidateName(path[1], "map"); !status.ok()) {
    return ErrorResponse(status);
  }
  if (path.size() == 2) {
    return AnswerMap(path[1]);
  }
  if (path.size() == 3 && path[2] == "events") {
    return AnswerEvents(path[1]);
  }
  if (path.size() == 7 && path[2] == "tiles") {
    return AnswerTile(request);
  }
  return NothingHere();
}

HttpAnswer MapRoutes::AnswerTile(const HttpRequest& request) const {
  const std::vector<std::string>& path = request.path;
  const std::optional<Layer> layer = LayerFromName(path[3]);
  if (!layer) {
    return ErrorResponse(NotFoundError("layer: no such layer, must be occupancy or moving"));
  }
  const StatusOr<TileAddress> address = ParseTileAddress(std::span(path).subspan(4));
  if (!address.ok()) {
    return ErrorResponse(address.status());
  }
  const StatusOr<Revision> revision = ParseRevision(request);
  if (!revision.ok()) {
    return ErrorResponse(revision.status());
  }
  StatusOr<std::shared_ptr<const Snapshot>> snapshot = maps_.FindSnapshot(path[1], *revision);
  if (!snapshot.ok()) {
    return ErrorResponse(snapshot.status());
  }
  return HttpWork(
      [this, snapshot = std::move(snapshot).value(), layer = *layer, address = *address] {
        HttpResponse response;
        response.body = painter_(snapshot, layer, address);
        response.content_type = "image/png";
        response.etag = ContentEtag(*response.body);
        response.headers.emplace_back("Loci-Revision", std::to_string(snapshot->revision.value));
        return response;
      });
}

HttpAnswer MapRoutes::AnswerMap(const std::string& map) const {
  StatusOr<std::shared_ptr<const Snapshot>> snapshot = maps_.FindSnapshot(map, Revision());
  if (!snapshot.ok()) {
    return ErrorResponse(snapshot.status());
  }
  return HttpWork(
      [map, snapshot = std::move(snapshot).value()] { return DescribeMap(map, *snapshot); });
}

HttpAnswer MapRoutes::AnswerEvents(const std::string& map) const {
  return HttpEventsStart([this, map](std::function<void()> wake) {
    return OpenRevisionEvents(maps_, map, std::move(wake));
  });
}

HttpResponse MapRoutes::MapList() const {
  Json maps = Json::array();
  for (const MapStatus& status : maps_.Maps()) {
    maps.push_back({{"map", status.map},
                    {"state", StateName(status.state)},
                    {"problem", status.problem},
                    {"revision", status.newest ? status.newest->revision.value : 0}});
  }
  return JsonResponse(200, {{"maps", maps}});
}

HttpResponse MapRoutes::Readiness() const {
  std::string waiting;
  for (const MapStatus& status : maps_.Maps()) {
    if (status.state == MapState::kRecovering) {
      waiting += " " + status.map;
    }
  }
  if (waiting.empty()) {
    return TextResponse(200, "ready\n");
  }
  return ErrorResponse(UnavailableError("recovering:" + waiting));
}

}  // namespace loci
