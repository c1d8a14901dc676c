// SPDX-License-Identifier: Apache-2.0
// Settings, states and closures of maps, for administration.
#pragma once

#include "core/engine/settings.h"
#include "core/engine/snapshot.h"
#include "loci/v1/map_admin.pb.h"
#include "server/map_host.h"
#include "server/snapshot_source.h"

namespace loci {

// An absent field takes its default.
MapSettings SettingsFrom(const v1::MapSettings& message);
void Fill(const MapSettings& settings, v1::MapSettings& message);

void Fill(const HostedMapInfo& info, v1::MapInfo& message);
void Fill(const MapStatus& status, v1::ListMapsResponse::Entry& message);
void Fill(const MapStatus& status, v1::ServerStatus::Map& message);
void Fill(const VerificationReport& report, v1::VerifyMapResponse& message);
void Fill(const ClosureSnapshot& closure, v1::Closure& message);

}  // namespace loci
