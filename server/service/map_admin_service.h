// SPDX-License-Identifier: Apache-2.0
// Administration of maps and of the server (loci.v1.MapAdmin).
#pragma once

#include <string>

#include "server/base/clock.h"
#include "server/base/job_queue.h"
#include "server/config.h"
#include "server/map_directory.h"
#include "server/rpc/dispatcher.h"

namespace loci {

// Thread-safe. What reads or writes files runs on threads of its own, never on the dispatcher's.
class MapAdminService {
 public:
  // References must outlive the service. Destroy it after Dispatcher::Stop.
  MapAdminService(const ServerLimits& limits,
                  const Clock& clock,
                  MapDirectory& maps,
                  std::string version);

  void AddTo(Dispatcher& dispatcher);

 private:
  void AddGetMapInfo(Dispatcher& dispatcher);
  void AddQueries(Dispatcher& dispatcher);

  const Clock& clock_;
  const TimePoint started_at_;
  MapDirectory& maps_;
  const std::string version_;  // of the program
  JobQueue jobs_;
  JobQueue verifications_;
};

}  // namespace loci
