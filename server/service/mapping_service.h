// SPDX-License-Identifier: Apache-2.0
// Sessions and observations of robots (loci.v1.Mapping).
#pragma once

#include "server/map_directory.h"
#include "server/rpc/dispatcher.h"

namespace loci {

// Calls of one robot's connection are taken in the order in which they came. Thread-safe.
class MappingService {
 public:
  // `maps` must outlive the service. Destroy it after Dispatcher::Stop.
  explicit MappingService(MapDirectory& maps) : maps_(maps) {}

  void AddTo(Dispatcher& dispatcher);

 private:
  void AddAppend(Dispatcher& dispatcher);
  void AddQueries(Dispatcher& dispatcher);

  MapDirectory& maps_;
};

}  // namespace loci
