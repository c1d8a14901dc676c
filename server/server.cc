// SPDX-License-Identifier: Apache-2.0
#include "server/server.h"

#include <memory>
#include <string>
#include <utility>

#include <spdlog/spdlog.h>

#include "server/base/clock.h"
#include "server/http/http_server.h"
#include "server/http/map_routes.h"
#include "server/http/viewer_files.h"
#include "server/map_directory.h"
#include "server/metrics/map_metrics.h"
#include "server/metrics/metrics.h"
#include "server/metrics/rpc_metrics.h"
#include "server/rpc/dispatcher.h"
#include "server/service/health_service.h"
#include "server/service/map_admin_service.h"
#include "server/service/map_query_service.h"
#include "server/service/mapping_service.h"
#include "server/service/reflection_service.h"
#include "server/service/tile_cache.h"
#include "server/service/watch_service.h"
#include "server/transport/zmq_transport.h"
#include "storage/sqlite/sqlite_store.h"

namespace loci {
namespace {

Status CheckHttpEndpoint(const ServerOptions& options) {
  if (options.http.empty()) {
    return {};
  }
  LOCI_ASSIGN_OR_RETURN(const HttpEndpoint endpoint, ParseHttpEndpoint(options.http));
  if (!endpoint.loopback && !options.insecure) {
    return InvalidArgumentError(
        "http: other machines can reach " + options.http +
        ", and nothing is encrypted or authenticated; --insecure allows it");
  }
  return {};
}

}  // namespace

Status CheckEndpoints(const ServerOptions& options) {
  LOCI_RETURN_IF_ERROR(CheckListenEndpoint(options.listen, true));
  return options.http.empty() ? Status() : ParseHttpEndpoint(options.http).status();
}

// In the order in which they are made; each may use those before it.
class Server::Parts {
 public:
  Parts(const ServerOptions& options, std::unique_ptr<MapDirectory> directory)
      : maps(std::move(directory)),
        tiles(options.limits.tile_cache_bytes),
        dispatcher(DispatcherOptions{}, clock()),
        map_admin(options.limits, clock(), *maps, options.version),
        mapping(*maps),
        map_query(options.limits, *maps, tiles),
        watch(options.limits, *maps),
        routes(
            *maps,
            metrics,
            [this](const std::shared_ptr<const Snapshot>& snapshot,
                   Layer layer,
                   const TileAddress& address) {
              return tiles.FindOrRender(snapshot, layer, address);
            },
            ViewerFiles()) {
    map_admin.AddTo(dispatcher);
    mapping.AddTo(dispatcher);
    map_query.AddTo(dispatcher);
    watch.AddTo(dispatcher);
    RegisterReflection(dispatcher);
    health.Register(dispatcher);
    metrics.AddCollector([this](MetricsText& text) {
      CollectMapMetrics(*maps, text);
      CollectRpcMetrics(dispatcher.counters(), text);
      CollectProcessMetrics(text);
    });
  }

  static const Clock& clock() {
    static const SteadyClock the_clock;
    return the_clock;
  }

  // Begins to answer calls.
  Status Listen(const ServerOptions& options) {
    ZmqTransportOptions transport_options;
    transport_options.endpoint = options.listen;
    LOCI_ASSIGN_OR_RETURN(transport, ZmqTransport::Listen(transport_options));
    rpc_endpoint = transport->endpoint();
    LOCI_RETURN_IF_ERROR(dispatcher.Start(*transport));
    if (!options.http.empty()) {
      HttpServerOptions http_options;
      LOCI_ASSIGN_OR_RETURN(http_options.endpoint, ParseHttpEndpoint(options.http));
      LOCI_ASSIGN_OR_RETURN(
          http,
          HttpServer::Start(
              http_options,
              [this](const HttpRequest& request) { return routes.Answer(request); },
              metrics));
      const std::string host = options.http.substr(0, options.http.rfind(':'));
      http_endpoint = host + ":" + std::to_string(http->port());
    }
    health.SetServing(true);
    return {};
  }

  void Stop() {
    health.SetServing(false);
    if (http != nullptr) {
      http->Stop();
    }
    if (transport != nullptr) {
      dispatcher.Stop();
    }
    maps->Stop(StopMode::kCheckpoint);
  }

  const std::unique_ptr<MapDirectory> maps;
  TileCache tiles;
  MetricRegistry metrics;
  std::unique_ptr<ZmqTransport> transport;
  HealthService health;
  Dispatcher dispatcher;
  MapAdminService map_admin;
  MappingService mapping;
  MapQueryService map_query;
  WatchService watch;
  const MapRoutes routes;
  std::unique_ptr<HttpServer> http;
  std::string rpc_endpoint;
  std::string http_endpoint;
};

StatusOr<std::unique_ptr<Server>> Server::Start(const ServerOptions& options) {
  LOCI_RETURN_IF_ERROR(CheckListenEndpoint(options.listen, options.insecure));
  LOCI_RETURN_IF_ERROR(CheckHttpEndpoint(options));
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<StoreDirectory> store, OpenSqliteDirectory(options.data));
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<MapDirectory> maps,
                        MapDirectory::Open(std::move(store), options.limits, Parts::clock()));
  auto parts = std::make_unique<Parts>(options, std::move(maps));
  const Status status = parts->Listen(options);
  if (!status.ok()) {
    parts->Stop();
    return status;
  }
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Server::~Server() {
  Stop();
}

const std::string& Server::rpc_endpoint() const {
  return parts_->rpc_endpoint;
}

const std::string& Server::http_endpoint() const {
  return parts_->http_endpoint;
}

void Server::Stop() {
  if (parts_ != nullptr) {
    parts_->Stop();
    parts_.reset();
  }
}

}  // namespace loci
