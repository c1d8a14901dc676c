// SPDX-License-Identifier: Apache-2.0
// Health of the server and of each service, with gRPC's names and states.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/status.h"
#include "loci/v1/health.pb.h"
#include "server/base/mutex.h"
#include "server/rpc/dispatcher.h"

namespace loci {

// Any thread may call. It must live until the dispatcher is stopped.
class HealthService {
 public:
  // Serves loci.v1.Health for the services that `dispatcher` has at its start, all NOT_SERVING.
  void Register(Dispatcher& dispatcher);

  // Sets the state of the server (the service "") and of all services, and tells those who watch.
  void SetServing(bool serving);

 private:
  using ServingStatus = v1::HealthCheckResponse::ServingStatus;
  bool IsKnown(std::string_view service) const;
  StatusOr<v1::HealthCheckResponse> Check(const v1::HealthCheckRequest& request);
  StatusOr<StreamSource<v1::HealthCheckResponse>> Watch(const std::shared_ptr<ServerCall>& call,
                                                        const v1::HealthCheckRequest& request);
  ServingStatus StatusOf(std::string_view service);

  const Dispatcher* dispatcher_ = nullptr;
  Mutex mutex_;
  bool serving_ LOCI_GUARDED_BY(mutex_) = false;
  std::vector<std::weak_ptr<ServerCall>> watchers_ LOCI_GUARDED_BY(mutex_);
};

}  // namespace loci
