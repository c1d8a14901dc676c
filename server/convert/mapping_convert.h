// SPDX-License-Identifier: Apache-2.0
// What robots send, and what they are answered.
#pragma once

#include "core/base/status.h"
#include "core/engine/snapshot.h"
#include "loci/v1/mapping.pb.h"
#include "server/host/append_request.h"
#include "server/map_host.h"

namespace loci {

OpenRequest OpenRequestFrom(const v1::OpenSessionRequest& message);

// kInvalidArgument names the field of what cannot be expressed: "observations[3].scan.ranges_mm[7]:
// 70000, must be at most 65535". Everything else is checked with the events.
StatusOr<BatchRequest> BatchRequestFrom(const v1::AppendBatchRequest& message);

void Fill(const HostedSession& hosted, v1::SessionState& message);
// A session as far as it is applied.
void Fill(const SessionSnapshot& session, Revision revision, v1::SessionState& message);

void Fill(const AppendOutcome& outcome, v1::AppendBatchResponse& message);

}  // namespace loci
