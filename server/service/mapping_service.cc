// SPDX-License-Identifier: Apache-2.0
#include "server/service/mapping_service.h"

#include <memory>
#include <utility>

#include "core/base/name.h"
#include "loci/v1/mapping.pb.h"
#include "server/convert/mapping_convert.h"
#include "server/convert/pose_convert.h"

namespace loci {
namespace {

using Open = UnaryCall<v1::OpenSessionRequest, v1::SessionState>;
using Append = UnaryCall<v1::AppendBatchRequest, v1::AppendBatchResponse>;
using Close = UnaryCall<v1::CloseSessionRequest, v1::SessionState>;

template <typename Call>
MapHost::Done<HostedSession> AnswerWithSession(std::shared_ptr<Call> call) {
  return [call = std::move(call)](const StatusOr<HostedSession>& session) {
    if (!session.ok()) {
      call->Finish(session.status());
      return;
    }
    v1::SessionState response;
    Fill(*session, response);
    call->Finish(response);
  };
}

void AnswerAppend(const MapHost& host, Append& call, const StatusOr<AppendOutcome>& outcome) {
  if (!outcome.ok()) {
    call.Finish(outcome.status());
    return;
  }
  v1::AppendBatchResponse response;
  Fill(*outcome, response);
  if (const StatusOr<std::shared_ptr<const Snapshot>> snapshot = host.FindSnapshot(Revision{});
      snapshot.ok()) {
    response.set_revision((*snapshot)->revision.value);
    // The session may be durable and not applied yet.
    if (outcome->session.value < (*snapshot)->sessions.size()) {
      Fill((*snapshot)->sessions[outcome->session.value].map_from_odom,
           *response.mutable_map_from_odom());
    }
  }
  call.Finish(response);
}

}  // namespace

void MappingService::AddTo(Dispatcher& dispatcher) {
  dispatcher.AddService("loci.v1.Mapping");
  dispatcher.AddAsyncUnary<v1::OpenSessionRequest, v1::SessionState>(
      "loci.v1.Mapping/OpenSession",
      Execution::kOrdered,
      [this](const std::shared_ptr<Open>& call) {
        const StatusOr<std::shared_ptr<MapHost>> host = maps_.Find(call->request().map());
        if (!host.ok()) {
          call->Finish(host.status());
          return;
        }
        (*host)->OpenSession(
            call->request().session(), OpenRequestFrom(call->request()), AnswerWithSession(call));
      });
  dispatcher.AddAsyncUnary<v1::CloseSessionRequest, v1::SessionState>(
      "loci.v1.Mapping/CloseSession",
      Execution::kOrdered,
      [this](const std::shared_ptr<Close>& call) {
        const StatusOr<std::shared_ptr<MapHost>> host = maps_.Find(call->request().map());
        const Status name = ValidateName(call->request().session(), "session");
        if (!host.ok() || !name.ok()) {
          call->Finish(host.ok() ? name : host.status());
          return;
        }
        (*host)->CloseSession(call->request().session(), AnswerWithSession(call));
      });
  AddAppend(dispatcher);
  AddQueries(dispatcher);
}

void MappingService::AddAppend(Dispatcher& dispatcher) {
  dispatcher.AddAsyncUnary<v1::AppendBatchRequest, v1::AppendBatchResponse>(
      "loci.v1.Mapping/AppendBatch",
      Execution::kOrdered,
      [this](const std::shared_ptr<Append>& call) {
        const StatusOr<std::shared_ptr<MapHost>> host = maps_.Find(call->request().map());
        if (!host.ok()) {
          call->Finish(host.status());
          return;
        }
        if (const Status status = ValidateName(call->request().session(), "session");
            !status.ok()) {
          call->Finish(status);
          return;
        }
        StatusOr<BatchRequest> batch = BatchRequestFrom(call->request());
        if (!batch.ok()) {
          call->Finish(batch.status());
          return;
        }
        const std::string session = call->request().session();
        call->request().Clear();  // the batch has it all now
        (*host)->AppendBatch(session,
                             std::move(batch).value(),
                             [call, host = *host](const StatusOr<AppendOutcome>& outcome) {
                               AnswerAppend(*host, *call, outcome);
                             });
      });
}

void MappingService::AddQueries(Dispatcher& dispatcher) {
  dispatcher.AddUnary<v1::GetSessionRequest, v1::SessionState>(
      "loci.v1.Mapping/GetSession",
      Execution::kWorker,
      [this](ServerCall&, const v1::GetSessionRequest& request) -> StatusOr<v1::SessionState> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<MapHost> host, maps_.Find(request.map()));
        LOCI_RETURN_IF_ERROR(ValidateName(request.session(), "session"));
        LOCI_ASSIGN_OR_RETURN(const HostedSession session, host->FindSession(request.session()));
        v1::SessionState response;
        Fill(session, response);
        return response;
      });
  dispatcher.AddUnary<v1::ListSessionsRequest, v1::ListSessionsResponse>(
      "loci.v1.Mapping/ListSessions",
      Execution::kWorker,
      [this](ServerCall&,
             const v1::ListSessionsRequest& request) -> StatusOr<v1::ListSessionsResponse> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<MapHost> host, maps_.Find(request.map()));
        LOCI_ASSIGN_OR_RETURN(const std::vector<HostedSession> sessions, host->ListSessions());
        v1::ListSessionsResponse response;
        for (const HostedSession& session : sessions) {
          Fill(session, *response.add_sessions());
        }
        return response;
      });
}

}  // namespace loci
