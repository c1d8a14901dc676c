// SPDX-License-Identifier: Apache-2.0
#include "server/service/map_admin_service.h"

#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "core/base/name.h"
#include "loci/v1/map_admin.pb.h"
#include "server/convert/map_admin_convert.h"

namespace loci {
namespace {

// Administrative jobs that may wait; more are refused.
constexpr std::size_t kJobsWaitingMax = 256;
constexpr std::size_t kJobThreads = 2;

// Runs `work` on the queue, and finishes the call with what it returns or with why it cannot run.
template <typename Call>
void RunOn(JobQueue& queue, std::shared_ptr<Call> call, std::function<void(Call&)> work) {
  const Status status = queue.Submit([call, work = std::move(work)] {
    if (!call->over()) {
      work(*call);
    }
  });
  if (!status.ok()) {
    call->Finish(status);
  }
}

}  // namespace

MapAdminService::MapAdminService(const ServerLimits& limits,
                                 const Clock& clock,
                                 MapDirectory& maps,
                                 std::string version)
    : clock_(clock),
      started_at_(clock.Now()),
      maps_(maps),
      version_(std::move(version)),
      jobs_("administrative calls", kJobThreads, kJobsWaitingMax),
      verifications_("verifications", limits.verifications_at_once, 0) {}

void MapAdminService::AddTo(Dispatcher& dispatcher) {
  dispatcher.AddService("loci.v1.MapAdmin");
  using Create = UnaryCall<v1::CreateMapRequest, v1::CreateMapResponse>;
  dispatcher.AddAsyncUnary<v1::CreateMapRequest, v1::CreateMapResponse>(
      "loci.v1.MapAdmin/CreateMap", Execution::kWorker, [this](std::shared_ptr<Create> call) {
        RunOn<Create>(jobs_, std::move(call), [this](Create& created) {
          const Status status =
              maps_.Create(created.request().map(), SettingsFrom(created.request().settings()));
          if (status.ok()) {
            created.Finish(v1::CreateMapResponse());
          } else {
            created.Finish(status);
          }
        });
      });
  using Delete = UnaryCall<v1::DeleteMapRequest, v1::DeleteMapResponse>;
  dispatcher.AddAsyncUnary<v1::DeleteMapRequest, v1::DeleteMapResponse>(
      "loci.v1.MapAdmin/DeleteMap", Execution::kWorker, [this](std::shared_ptr<Delete> call) {
        RunOn<Delete>(jobs_, std::move(call), [this](Delete& deleted) {
          const Status status = maps_.Delete(deleted.request().map());
          if (status.ok()) {
            deleted.Finish(v1::DeleteMapResponse());
          } else {
            deleted.Finish(status);
          }
        });
      });
  using Verify = UnaryCall<v1::VerifyMapRequest, v1::VerifyMapResponse>;
  dispatcher.AddAsyncUnary<v1::VerifyMapRequest, v1::VerifyMapResponse>(
      "loci.v1.MapAdmin/VerifyMap", Execution::kWorker, [this](std::shared_ptr<Verify> call) {
        const StatusOr<std::shared_ptr<MapHost>> host = maps_.Find(call->request().map());
        if (!host.ok()) {
          call->Finish(host.status());
          return;
        }
        RunOn<Verify>(verifications_, std::move(call), [host = *host](Verify& verified) {
          const StatusOr<VerificationReport> report =
              host->Verify([&verified] { return verified.over(); });
          if (!report.ok()) {
            verified.Finish(report.status());
            return;
          }
          v1::VerifyMapResponse response;
          Fill(*report, response);
          verified.Finish(response);
        });
      });
  AddGetMapInfo(dispatcher);
  AddQueries(dispatcher);
}

void MapAdminService::AddGetMapInfo(Dispatcher& dispatcher) {
  using Info = UnaryCall<v1::GetMapInfoRequest, v1::MapInfo>;
  dispatcher.AddAsyncUnary<v1::GetMapInfoRequest, v1::MapInfo>(
      "loci.v1.MapAdmin/GetMapInfo", Execution::kWorker, [this](const std::shared_ptr<Info>& call) {
        const StatusOr<std::shared_ptr<MapHost>> host = maps_.Find(call->request().map());
        if (!host.ok()) {
          call->Finish(host.status());
          return;
        }
        // Measuring the file's parts reads it: not on a worker.
        const Status status = jobs_.Submit([call, host = *host] {
          host->GetInfo([call](const StatusOr<HostedMapInfo>& info) {
            if (!info.ok()) {
              call->Finish(info.status());
              return;
            }
            v1::MapInfo response;
            response.set_map(call->request().map());
            Fill(*info, response);
            call->Finish(response);
          });
        });
        if (!status.ok()) {
          call->Finish(status);
        }
      });
}

void MapAdminService::AddQueries(Dispatcher& dispatcher) {
  dispatcher.AddUnary<v1::ListMapsRequest, v1::ListMapsResponse>(
      "loci.v1.MapAdmin/ListMaps",
      Execution::kWorker,
      [this](ServerCall&, const v1::ListMapsRequest&) -> StatusOr<v1::ListMapsResponse> {
        v1::ListMapsResponse response;
        for (const MapStatus& status : maps_.Maps()) {
          Fill(status, *response.add_maps());
        }
        return response;
      });
  dispatcher.AddUnary<v1::ListClosuresRequest, v1::ListClosuresResponse>(
      "loci.v1.MapAdmin/ListClosures",
      Execution::kWorker,
      [this](ServerCall&,
             const v1::ListClosuresRequest& request) -> StatusOr<v1::ListClosuresResponse> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{}));
        v1::ListClosuresResponse response;
        response.set_revision(snapshot->revision.value);
        for (const ClosureSnapshot& closure : *snapshot->closures) {
          Fill(closure, *response.add_closures());
        }
        return response;
      });
  dispatcher.AddUnary<v1::GetServerStatusRequest, v1::ServerStatus>(
      "loci.v1.MapAdmin/GetServerStatus",
      Execution::kWorker,
      [this](ServerCall&, const v1::GetServerStatusRequest& request) -> StatusOr<v1::ServerStatus> {
        if (!request.map().empty()) {
          LOCI_RETURN_IF_ERROR(maps_.Find(request.map()).status());
        }
        v1::ServerStatus response;
        response.set_ready(true);  // unless a map still replays its log: what /readyz says too
        response.set_version(version_);
        response.set_uptime_s(std::chrono::duration<double>(clock_.Now() - started_at_).count());
        for (const MapStatus& status : maps_.Maps()) {
          if (status.state == MapState::kRecovering) {
            response.set_ready(false);
          }
          if (request.map().empty() || request.map() == status.map) {
            Fill(status, *response.add_maps());
          }
        }
        return response;
      });
}

}  // namespace loci
