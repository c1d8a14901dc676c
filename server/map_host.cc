// SPDX-License-Identifier: Apache-2.0
#include "server/map_host.h"

#include <chrono>
#include <limits>

#include <spdlog/spdlog.h>

namespace loci {
namespace {

Status Stopping(const std::string& map) {
  return UnavailableError("map \"" + map + "\": the server is stopping");
}

// What is applied of the session at the snapshot, or what its opening says if that is nothing yet.
HostedSession Describe(const DurableSession& durable, const Snapshot& snapshot) {
  HostedSession hosted;
  hosted.last_durable_number = durable.admitted.last_number;
  hosted.revision = snapshot.revision;
  if (durable.id.value < snapshot.sessions.size()) {
    hosted.session = snapshot.sessions[durable.id.value];
  } else {
    hosted.session.id = durable.id;
    hosted.session.session = durable.admitted.session;
    hosted.session.robot = durable.admitted.robot;
    hosted.session.map_from_start = durable.admitted.map_from_start;
    hosted.session.map_from_robot = durable.admitted.map_from_start;
    hosted.session.map_from_odom = durable.admitted.map_from_start;
  }
  return hosted;
}

// Numbers the observations and checks what can be wrong by itself.
Status CheckBatch(BatchRequest& batch) {
  if (batch.observations.empty()) {
    return InvalidArgumentError("observations: none, must be at least 1");
  }
  if (batch.first_number == 0 ||
      batch.first_number > std::numeric_limits<std::uint64_t>::max() - batch.observations.size()) {
    return InvalidArgumentError("first_number: " + std::to_string(batch.first_number) +
                                ", a session counts its observations from 1");
  }
  for (std::size_t i = 0; i < batch.observations.size(); ++i) {
    batch.observations[i].number = batch.first_number + i;
    LOCI_RETURN_IF_ERROR(
        ValidateObservation(batch.observations[i], "observations[" + std::to_string(i) + "]"));
  }
  return {};
}

}  // namespace

bool RecoveryGate::Enter(const std::function<bool()>& cancelled) {
  const MutexLock lock(mutex_);
  while (free_ == 0 && !cancelled()) {
    changed_.Wait(mutex_);
  }
  if (cancelled()) {
    return false;
  }
  --free_;
  return true;
}

void RecoveryGate::Leave() {
  const MutexLock lock(mutex_);
  ++free_;
  changed_.NotifyAll();
}

void RecoveryGate::Wake() {
  const MutexLock lock(mutex_);
  changed_.NotifyAll();
}

MapHost::Lease::~Lease() {
  if (host_ != nullptr) {
    const MutexLock lock(host_->mutex_);
    --host_->leases_;
    host_->state_changed_.NotifyAll();
  }
}

MapHost::Serving::Serving(const MapHost& host,
                          std::unique_ptr<MapStore> opened,
                          RecoveredMap recovered)
    : recovered_from(recovered.checkpoint),
      events_replayed(recovered.events_replayed),
      store(std::move(opened)),
      publisher(host.map_, host.limits_, host.clock_),
      checkpointer(host.map_,
                   host.limits_,
                   host.clock_,
                   *store,
                   recovered.checkpoint,
                   recovered.events_replayed),
      applier(host.limits_, publisher, checkpointer, std::move(recovered.engine)),
      appender(host.map_, host.limits_, *store, applier, std::move(recovered.admission)) {}

MapHost::MapHost(std::string map,
                 OpenStore open_store,
                 const HostLimits& limits,
                 const Clock& clock,
                 RecoveryGate& gate)
    : map_(std::move(map)),
      open_store_(std::move(open_store)),
      limits_(limits),
      clock_(clock),
      gate_(gate) {
  thread_ = std::thread([this] { Run(); });
}

MapHost::~MapHost() {
  Stop(StopMode::kAbandon);
}

void MapHost::Stop(StopMode mode) {
  if (stopping_.exchange(true)) {
    return;
  }
  gate_.Wake();
  Serving* serving = nullptr;
  {
    const MutexLock lock(mutex_);
    serving = serving_.get();
  }
  if (serving != nullptr) {
    serving->applier.RequestStop();
    serving->appender.Stop();
  }
  thread_.join();
  if (serving != nullptr) {
    serving->checkpointer.Stop();
    Applier& applier = serving->applier;
    if (mode == StopMode::kCheckpoint &&
        applier.engine().last_event() != serving->checkpointer.last_written()) {
      IgnoreError(serving->checkpointer.WriteNow(applier.engine(), applier.StateDigest()),
                  "it is in the server's log; the next start replays more");
    }
    serving->publisher.End();
  }
  std::unique_ptr<Serving> ended;
  const MutexLock lock(mutex_);
  if (state_ != MapState::kRefused) {
    state_ = MapState::kRecovering;
    problem_ = Stopping(map_);
  }
  ended = std::move(serving_);
  while (leases_ > 0) {
    state_changed_.Wait(mutex_);
  }
  ended.reset();
  state_changed_.NotifyAll();
}

Status MapHost::WaitUntilServing() const {
  const MutexLock lock(mutex_);
  while (state_ == MapState::kRecovering && !stopping_) {
    state_changed_.Wait(mutex_);
  }
  return state_ == MapState::kServing ? Status() : problem_;
}

MapStatus MapHost::CurrentStatus() const {
  MapStatus status;
  status.map = map_;
  StatusOr<Lease> serving = Acquire();
  if (!serving.ok()) {
    const MutexLock lock(mutex_);
    status.state = state_ == MapState::kServing ? MapState::kRecovering : state_;  // stopping
    status.problem = state_ == MapState::kRefused ? serving.status().ToString() : "";
    return status;
  }
  Serving& parts = serving->parts();
  status.state = MapState::kServing;
  status.newest = parts.publisher.ring().Peek();
  status.last_event = parts.store->LastEvent().value;
  status.last_checkpoint = parts.checkpointer.last_written().value;
  status.recovered_from = parts.recovered_from.value;
  status.events_replayed = parts.events_replayed;
  const ApplierCounts applied = parts.applier.Counts();
  status.events_waiting = applied.events_waiting;
  status.closures = applied.closures;
  status.digests = applied.digests;
  const AppenderCounts appended = parts.appender.Counts();
  status.bytes_waiting = appended.bytes_waiting;
  status.appends = appended.appends;
  status.append_failures = appended.append_failures;
  const Status health = parts.appender.Health();
  status.problem = health.ok() ? "" : health.ToString();
  return status;
}

StatusOr<std::shared_ptr<const Snapshot>> MapHost::FindSnapshot(Revision revision) const {
  LOCI_ASSIGN_OR_RETURN(const Lease serving, Acquire());
  if (revision.value == 0) {
    return serving->publisher.ring().Newest();
  }
  return serving->publisher.ring().Find(revision);
}

StatusOr<std::unique_ptr<Subscription>> MapHost::Subscribe(
    SnapshotSource::RevisionCallback callback) {
  LOCI_ASSIGN_OR_RETURN(const Lease serving, Acquire());
  return serving->publisher.Subscribe(std::move(callback));
}

StatusOr<HostedSession> MapHost::FindSession(const std::string& session) const {
  LOCI_ASSIGN_OR_RETURN(const Lease serving, Acquire());
  const std::optional<DurableSession> durable = serving->appender.FindSession(session);
  if (!durable.has_value()) {
    return NotFoundError("session: \"" + session + "\" was never opened in map \"" + map_ + "\"");
  }
  return Describe(*durable, *serving->publisher.ring().Newest());
}

StatusOr<std::vector<HostedSession>> MapHost::ListSessions() const {
  LOCI_ASSIGN_OR_RETURN(const Lease serving, Acquire());
  const std::shared_ptr<const Snapshot> snapshot = serving->publisher.ring().Newest();
  std::vector<HostedSession> sessions;
  for (const DurableSession& durable : serving->appender.ListSessions()) {
    sessions.push_back(Describe(durable, *snapshot));
  }
  return sessions;
}

void MapHost::OpenSession(std::string session, OpenRequest open, Done<HostedSession> done) {
  const StatusOr<Lease> lease = Acquire();
  if (!lease.ok()) {
    done(lease.status());
    return;
  }
  if (const Status status =
          ValidateEvent(OpenSessionEvent{session, open.robot, open.map_from_start}, "");
      !status.ok()) {
    done(status);
    return;
  }
  // Whoever answers is a thread of `serving`, or this one: it is alive.
  Serving& serving = lease->parts();
  const std::string name = session;
  serving.appender.Submit(
      {std::move(session),
       std::move(open),
       [&serving, name, done = std::move(done)](const StatusOr<AppendOutcome>& outcome) {
         if (!outcome.ok()) {
           done(outcome.status());
           return;
         }
         done(Describe(*serving.appender.FindSession(name), *serving.publisher.ring().Newest()));
       }});
}

void MapHost::AppendBatch(std::string session, BatchRequest batch, Done<AppendOutcome> done) {
  const StatusOr<Lease> lease = Acquire();
  if (!lease.ok()) {
    done(lease.status());
    return;
  }
  if (const Status status = CheckBatch(batch); !status.ok()) {
    done(status);
    return;
  }
  lease->parts().appender.Submit({std::move(session), std::move(batch), std::move(done)});
}

void MapHost::CloseSession(std::string session, const Done<HostedSession>& done) {
  const StatusOr<Lease> lease = Acquire();
  if (!lease.ok()) {
    done(lease.status());
    return;
  }
  Serving& serving = lease->parts();
  const std::string name = session;
  const auto answer = [&serving, name, map = map_, done](const Engine* engine) {
    if (engine == nullptr) {
      done(Stopping(map));
      return;
    }
    done(Describe(*serving.appender.FindSession(name), *serving.publisher.ring().Newest()));
  };
  serving.appender.Submit({std::move(session),
                           CloseRequest{},
                           [&serving, answer, done](const StatusOr<AppendOutcome>& outcome) {
                             if (outcome.ok()) {
                               serving.applier.Post(answer);
                             } else {
                               done(outcome.status());
                             }
                           }});
}

void MapHost::GetInfo(const Done<HostedMapInfo>& done) {
  const StatusOr<Lease> lease = Acquire();
  if (!lease.ok()) {
    done(lease.status());
    return;
  }
  Serving& serving = lease->parts();
  const StatusOr<StoredBytes> bytes = serving.store->MeasureBytes();
  if (!bytes.ok()) {
    done(bytes.status());
    return;
  }
  serving.applier.Post([&serving, map = map_, bytes = *bytes, done](const Engine* engine) {
    if (engine == nullptr) {
      done(Stopping(map));
      return;
    }
    done(HostedMapInfo{.last_event = engine->last_event(),
                       .state_digest = serving.applier.StateDigest(),
                       .counts = engine->Counts(),
                       .settings = serving.publisher.ring().Newest()->settings,
                       .file_bytes = bytes});
  });
}

StatusOr<VerificationReport> MapHost::Verify(const std::function<bool()>& cancelled) {
  LOCI_ASSIGN_OR_RETURN(const Lease serving, Acquire());
  LOCI_ASSIGN_OR_RETURN(const ServedState served, AwaitServedState(serving.parts()));
  return VerifyMap(
      *serving->store, served, [this, &cancelled] { return stopping_ || cancelled(); });
}

void MapHost::Run() {
  const auto cancelled = [this] { return stopping_.load(); };
  if (!gate_.Enter(cancelled)) {
    return;
  }
  StatusOr<std::unique_ptr<Serving>> recovered = Recover();
  gate_.Leave();
  if (!recovered.ok()) {
    Refuse(recovered.status());
    return;
  }
  Serving* serving = nullptr;
  {
    const MutexLock lock(mutex_);
    if (stopping_) {
      return;
    }
    serving_ = std::move(recovered).value();
    serving = serving_.get();
    state_ = MapState::kServing;
    state_changed_.NotifyAll();
  }
  serving->applier.Run();
}

StatusOr<std::unique_ptr<MapHost::Serving>> MapHost::Recover() {
  const TimePoint begin = clock_.Now();
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<MapStore> store, open_store_());
  LOCI_ASSIGN_OR_RETURN(RecoveredMap recovered,
                        RecoverMap(map_, *store, [this] { return stopping_.load(); }));
  const auto duration = std::chrono::duration_cast<std::chrono::milliseconds>(clock_.Now() - begin);
  spdlog::info("event=map_recovered map={} checkpoint={} replayed={} last_event={} ms={}",
               map_,
               recovered.checkpoint.value,
               recovered.events_replayed,
               recovered.engine.last_event().value,
               duration.count());
  return std::make_unique<Serving>(*this, std::move(store), std::move(recovered));
}

void MapHost::Refuse(const Status& status) {
  const MutexLock lock(mutex_);
  if (!stopping_) {
    spdlog::error("event=map_refused map={} problem=\"{}\"", map_, status.ToString());
    state_ = MapState::kRefused;
    problem_ = Status(status.code(), "map \"" + map_ + "\" is refused: " + status.message());
  }
  state_changed_.NotifyAll();
}

StatusOr<MapHost::Lease> MapHost::Acquire() const {
  const MutexLock lock(mutex_);
  if (stopping_) {
    return Stopping(map_);
  }
  switch (state_) {
    case MapState::kServing:
      ++leases_;
      return Lease(*this, *serving_);
    case MapState::kRefused:
      return problem_;
    case MapState::kRecovering:
      break;
  }
  return UnavailableError("map \"" + map_ + "\" is recovering; call again in a moment");
}

StatusOr<ServedState> MapHost::AwaitServedState(Serving& serving) {
  struct Answer {
    Mutex mutex;
    ConditionVariable given;
    std::optional<StatusOr<ServedState>> state LOCI_GUARDED_BY(mutex);
  };
  const auto answer = std::make_shared<Answer>();
  serving.applier.Post([answer, &applier = serving.applier, map = map_](const Engine* engine) {
    StatusOr<ServedState> state = Stopping(map);
    if (engine != nullptr) {
      state = ServedState{engine->last_event(), applier.StateDigest()};
    }
    const MutexLock lock(answer->mutex);
    answer->state = std::move(state);
    answer->given.NotifyAll();
  });
  const MutexLock lock(answer->mutex);
  while (!answer->state.has_value()) {
    answer->given.Wait(answer->mutex);
  }
  return *answer->state;
}

}  // namespace loci
