// SPDX-License-Identifier: Apache-2.0
#include "server/map_directory.h"

#include <array>
#include <thread>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/name.h"
#include "core/engine/event.h"

namespace loci {
namespace {

Status Stopping() {
  return UnavailableError("the server is stopping");
}

Status NoSuchMap(const std::string& map) {
  return NotFoundError("map: there is no \"" + map + "\"");
}

// Whether the map's recovery found that its creation was cut short before anyone was told of it.
bool WasNeverCreated(const MapHost& host) {
  return host.FindSnapshot(Revision{}).status().code() == StatusCode::kNotFound;
}

}  // namespace

StatusOr<std::unique_ptr<MapDirectory>> MapDirectory::Open(std::unique_ptr<StoreDirectory> store,
                                                           const ServerLimits& limits,
                                                           const Clock& clock) {
  LOCI_ASSIGN_OR_RETURN(const std::vector<std::string> maps, store->List());
  spdlog::info("event=maps_found count={}", maps.size());
  std::unique_ptr<MapDirectory> directory(new MapDirectory(std::move(store), limits, clock));
  const MutexLock lock(directory->mutex_);
  for (const std::string& map : maps) {
    directory->hosts_[map] = directory->StartHost(map);
  }
  return directory;
}

MapDirectory::MapDirectory(std::unique_ptr<StoreDirectory> store,
                           const ServerLimits& limits,
                           const Clock& clock)
    : store_(std::move(store)), limits_(limits), clock_(clock), gate_(limits.recoveries_at_once) {}

MapDirectory::~MapDirectory() {
  Stop(StopMode::kAbandon);
}

Status MapDirectory::Create(const std::string& map, const MapSettings& settings) {
  LOCI_RETURN_IF_ERROR(ValidateName(map, "map"));
  LOCI_RETURN_IF_ERROR(Validate(settings));
  if (const StatusOr<std::shared_ptr<MapHost>> rest = Find(map);
      rest.ok() && WasNeverCreated(**rest)) {
    LOCI_RETURN_IF_ERROR(Delete(map));
  }
  {
    const MutexLock lock(mutex_);
    if (stopped_) {
      return Stopping();
    }
    if (hosts_.contains(map)) {
      return AlreadyExistsError("map: \"" + map + "\" exists already");
    }
    if (hosts_.size() >= limits_.maps_max) {
      return ResourceExhaustedError("maps: there are " + std::to_string(hosts_.size()) +
                                    ", which is the limit");
    }
    hosts_[map] = nullptr;
  }
  const Status made = MakeStore(map, settings);
  std::shared_ptr<MapHost> host;
  {
    const MutexLock lock(mutex_);
    if (!made.ok() || stopped_) {
      hosts_.erase(map);
      return made.ok() ? Stopping() : made;
    }
    host = StartHost(map);
    hosts_[map] = host;
  }
  spdlog::info("event=map_created map={}", map);
  return host->WaitUntilServing();
}

Status MapDirectory::Delete(const std::string& map) {
  LOCI_RETURN_IF_ERROR(ValidateName(map, "map"));
  std::shared_ptr<MapHost> host;
  {
    const MutexLock lock(mutex_);
    const auto found = hosts_.find(map);
    if (found == hosts_.end() || found->second == nullptr) {
      return NoSuchMap(map);
    }
    host = std::exchange(found->second, nullptr);
  }
  host->Stop(StopMode::kAbandon);
  const Status status = store_->Delete(map);
  const MutexLock lock(mutex_);
  if (status.ok() || stopped_) {
    hosts_.erase(map);
  } else {
    hosts_[map] = StartHost(map);
  }
  spdlog::info("event=map_deleted map={} status=\"{}\"", map, status.ToString());
  return status;
}

StatusOr<std::shared_ptr<MapHost>> MapDirectory::Find(const std::string& map) const {
  LOCI_RETURN_IF_ERROR(ValidateName(map, "map"));
  const MutexLock lock(mutex_);
  if (stopped_) {
    return Stopping();
  }
  const auto found = hosts_.find(map);
  if (found == hosts_.end() || found->second == nullptr) {
    return NoSuchMap(map);
  }
  return found->second;
}

StatusOr<std::shared_ptr<const Snapshot>> MapDirectory::FindSnapshot(const std::string& map,
                                                                     Revision revision) const {
  LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<MapHost> host, Find(map));
  return host->FindSnapshot(revision);
}

std::vector<MapStatus> MapDirectory::Maps() const {
  std::vector<std::shared_ptr<MapHost>> hosts;
  {
    const MutexLock lock(mutex_);
    for (const auto& [map, host] : hosts_) {
      if (host != nullptr) {
        hosts.push_back(host);
      }
    }
  }
  std::vector<MapStatus> maps;
  for (const std::shared_ptr<MapHost>& host : hosts) {
    maps.push_back(host->CurrentStatus());
  }
  return maps;
}

StatusOr<std::unique_ptr<Subscription>> MapDirectory::Subscribe(const std::string& map,
                                                                RevisionCallback callback) {
  LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<MapHost> host, Find(map));
  return host->Subscribe(std::move(callback));
}

void MapDirectory::Stop(StopMode mode) {
  std::map<std::string, std::shared_ptr<MapHost>> hosts;
  {
    const MutexLock lock(mutex_);
    stopped_ = true;
    hosts.swap(hosts_);
  }
  // One thread each: a final checkpoint takes time, and all must be done within seconds.
  std::vector<std::thread> stopping;
  for (const auto& [map, host] : hosts) {
    if (host != nullptr) {
      stopping.emplace_back([stopped = host, mode] { stopped->Stop(mode); });
    }
  }
  for (std::thread& thread : stopping) {
    thread.join();
  }
}

// Opening happens on the host's thread.
std::shared_ptr<MapHost> MapDirectory::StartHost(const std::string& map) {
  return std::make_shared<MapHost>(
      map, [this, map] { return store_->Open(map); }, limits_.host, clock_, gate_);
}

// Either the map is made with its first event, or nothing is left of it.
Status MapDirectory::MakeStore(const std::string& map, const MapSettings& settings) {
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<MapStore> store, store_->Create(map));
  const std::array<LogEntry, 1> first = {{{EventNumber{1}, EncodeEvent(CreateMapEvent{settings})}}};
  const Status status = store->Append(first);
  if (!status.ok()) {
    store.reset();
    IgnoreError(store_->Delete(map), "the next start lists what is left, and Create takes it over");
  }
  return status;
}

}  // namespace loci
