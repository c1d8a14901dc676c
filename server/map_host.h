// SPDX-License-Identifier: Apache-2.0
// One map that is served: its engine, its store, its writer and its published revisions.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "core/engine/engine.h"
#include "core/engine/snapshot.h"
#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "server/host/append_request.h"
#include "server/host/appender.h"
#include "server/host/applier.h"
#include "server/host/checkpointer.h"
#include "server/host/publisher.h"
#include "server/host/recovery.h"
#include "server/host/verification.h"
#include "server/snapshot_source.h"
#include "storage/store.h"

namespace loci {

// A session as it was applied at one revision, with what is durable beyond that.
struct HostedSession {
  SessionSnapshot session;
  std::uint64_t last_durable_number = 0;
  Revision revision;
};

// All about a map at its last durable event.
struct HostedMapInfo {
  EventNumber last_event;
  std::string state_digest;  // hexadecimal
  EngineCounts counts;
  MapSettings settings;
  StoredBytes file_bytes;
};

// How a host ends.
enum class StopMode : std::uint8_t {
  kCheckpoint,  // with a last checkpoint, so that the next start replays nothing
  kAbandon,     // as a power cut would: what is durable is all that counts
};

// Lets a few maps recover at a time.
class RecoveryGate {
 public:
  explicit RecoveryGate(std::size_t at_once) : free_(at_once) {}
  // False if `cancelled` became true first; it is asked after every Wake.
  bool Enter(const std::function<bool()>& cancelled) LOCI_EXCLUDES(mutex_);
  void Leave() LOCI_EXCLUDES(mutex_);
  void Wake() LOCI_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  ConditionVariable changed_;
  std::size_t free_ LOCI_GUARDED_BY(mutex_);
};

// Recovers in the background, then appends, applies and publishes until it is stopped.
//
// The way of a request: Appender (validate against the log, one durable append for many) -> answer
// -> Applier (engine, in log order) -> Publisher (revisions). Calls before the map is recovered get
// kUnavailable, calls to a damaged one kDataLoss. Thread-safe.
class MapHost {
 public:
  using OpenStore = std::function<StatusOr<std::unique_ptr<MapStore>>()>;
  template <typename T>
  using Done = std::function<void(StatusOr<T>)>;

  // `clock` and `gate` must outlive the host. The store is opened by the host's own thread, since
  // opening a damaged or large file takes time.
  MapHost(std::string map,
          OpenStore open_store,
          const HostLimits& limits,
          const Clock& clock,
          RecoveryGate& gate);
  // Stops with kAbandon if Stop was not called.
  ~MapHost();

  // Afterwards every call gets kUnavailable. The second call and later ones do nothing.
  void Stop(StopMode mode) LOCI_EXCLUDES(mutex_);
  // Waits for the end of the recovery; kDataLoss if the map is refused.
  Status WaitUntilServing() const LOCI_EXCLUDES(mutex_);

  const std::string& map() const { return map_; }
  MapStatus CurrentStatus() const LOCI_EXCLUDES(mutex_);

  // Reads; see SnapshotSource.
  StatusOr<std::shared_ptr<const Snapshot>> FindSnapshot(Revision revision) const;
  StatusOr<std::unique_ptr<Subscription>> Subscribe(SnapshotSource::RevisionCallback callback);
  StatusOr<HostedSession> FindSession(const std::string& session) const;
  StatusOr<std::vector<HostedSession>> ListSessions() const;

  // Writes; `done` is called once, on any thread, when what was asked for is durable.
  // OpenSession's answer may be of a revision before the session's.
  void OpenSession(std::string session, OpenRequest open, Done<HostedSession> done);
  void AppendBatch(std::string session, BatchRequest batch, Done<AppendOutcome> done);
  // Done when all of the session's events are applied and published.
  void CloseSession(std::string session, const Done<HostedSession>& done);

  // Done when every event that is durable now is applied.
  void GetInfo(const Done<HostedMapInfo>& done);
  // Takes as long as reading everything and replaying; `cancelled` is asked often.
  StatusOr<VerificationReport> Verify(const std::function<bool()>& cancelled);

 private:
  // What there is while the map is served. Members are built in this order and depend on the ones
  // before.
  struct Serving {
    Serving(const MapHost& host, std::unique_ptr<MapStore> opened, RecoveredMap recovered);
    const EventNumber recovered_from;
    const std::uint64_t events_replayed;
    const std::unique_ptr<MapStore> store;
    Publisher publisher;
    Checkpointer checkpointer;
    Applier applier;
    Appender appender;
  };

  // Keeps the parts alive: Stop waits until there is none.
  class Lease {
   public:
    explicit Lease(const MapHost& host, Serving& serving) : host_(&host), serving_(&serving) {}
    Lease(Lease&& other) noexcept
        : host_(std::exchange(other.host_, nullptr)), serving_(other.serving_) {}
    Lease& operator=(Lease&&) = delete;
    ~Lease();
    Serving* operator->() const { return serving_; }
    Serving& parts() const { return *serving_; }

   private:
    const MapHost* host_;
    Serving* serving_;
  };

  void Run() LOCI_EXCLUDES(mutex_);
  StatusOr<std::unique_ptr<Serving>> Recover();
  void Refuse(const Status& status) LOCI_EXCLUDES(mutex_);
  // The parts, or why the map is not served.
  StatusOr<Lease> Acquire() const LOCI_EXCLUDES(mutex_);
  StatusOr<ServedState> AwaitServedState(Serving& serving);

  const std::string map_;
  const OpenStore open_store_;
  const HostLimits limits_;
  const Clock& clock_;
  RecoveryGate& gate_;
  std::atomic<bool> stopping_{false};

  mutable Mutex mutex_;
  mutable ConditionVariable state_changed_;
  MapState state_ LOCI_GUARDED_BY(mutex_) = MapState::kRecovering;
  Status problem_ LOCI_GUARDED_BY(mutex_);
  std::unique_ptr<Serving> serving_ LOCI_GUARDED_BY(mutex_);
  mutable std::size_t leases_ LOCI_GUARDED_BY(mutex_) = 0;

  std::thread thread_;  // recovers, then applies
};

}  // namespace loci
