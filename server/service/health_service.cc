// SPDX-License-Identifier: Apache-2.0
// Health of the server and of each service.
#include "server/service/health_service.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace loci {

void HealthService::Register(Dispatcher& dispatcher) {
  dispatcher_ = &dispatcher;
  dispatcher.AddService("loci.v1.Health");
  dispatcher.AddUnary<v1::HealthCheckRequest, v1::HealthCheckResponse>(
      "loci.v1.Health/Check",
      Execution::kInline,
      [this](ServerCall& /*call*/, const v1::HealthCheckRequest& request) {
        return Check(request);
      });
  dispatcher.AddServerStream<v1::HealthCheckRequest, v1::HealthCheckResponse>(
      "loci.v1.Health/Watch",
      Execution::kInline,
      [this](const std::shared_ptr<ServerCall>& call, const v1::HealthCheckRequest& request) {
        return Watch(call, request);
      });
}

void HealthService::SetServing(bool serving) {
  std::vector<std::weak_ptr<ServerCall>> watchers;
  {
    const MutexLock lock(mutex_);
    serving_ = serving;
    watchers = watchers_;
  }
  for (const std::weak_ptr<ServerCall>& watcher : watchers) {
    if (const std::shared_ptr<ServerCall> call = watcher.lock()) {
      call->Wake();
    }
  }
}

bool HealthService::IsKnown(std::string_view service) const {
  const auto& services = dispatcher_->services();
  return service.empty() || std::any_of(services.begin(), services.end(), [&](const auto* one) {
           return one->full_name() == service;
         });
}

HealthService::ServingStatus HealthService::StatusOf(std::string_view service) {
  if (!IsKnown(service)) {
    return v1::HealthCheckResponse::SERVICE_UNKNOWN;
  }
  const MutexLock lock(mutex_);
  return serving_ ? v1::HealthCheckResponse::SERVING : v1::HealthCheckResponse::NOT_SERVING;
}

StatusOr<v1::HealthCheckResponse> HealthService::Check(const v1::HealthCheckRequest& request) {
  if (!IsKnown(request.service())) {
    return NotFoundError("service \"" + request.service() +
                         "\": this server has none of that name");
  }
  v1::HealthCheckResponse response;
  response.set_status(StatusOf(request.service()));
  return response;
}

StatusOr<StreamSource<v1::HealthCheckResponse>> HealthService::Watch(
    const std::shared_ptr<ServerCall>& call, const v1::HealthCheckRequest& request) {
  {
    const MutexLock lock(mutex_);
    std::erase_if(watchers_, [](const auto& watcher) { return watcher.expired(); });
    watchers_.push_back(call);
  }
  return StreamSource<v1::HealthCheckResponse>(
      [this, service = request.service(), told = std::make_shared<std::optional<ServingStatus>>()](
          v1::HealthCheckResponse& response) -> StatusOr<StreamStep> {
        const ServingStatus status = StatusOf(service);
        if (*told == status) {
          return StreamStep::kWait;
        }
        *told = status;
        response.set_status(status);
        return StreamStep::kMessage;
      });
}

}  // namespace loci
