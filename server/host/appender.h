// SPDX-License-Identifier: Apache-2.0
// The one writer of a map's event log: many requests, one durable append (group commit).
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/status.h"
#include "core/engine/admission.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "server/host/append_request.h"
#include "server/host/applier.h"
#include "storage/store.h"

namespace loci {

// For metrics.
struct AppenderCounts {
  std::uint64_t bytes_waiting = 0;
  std::uint64_t appends = 0;
  std::uint64_t append_failures = 0;
};

// What is durable of a session.
struct DurableSession {
  SessionId id;
  AdmittedSession admitted;
};

// Decides what may be appended, appends it, hands it to the applier, answers.
//
// In each round it takes one observation of every waiting session in turn, so that no session waits
// behind another's batch, until the group is full. Nothing is answered before the group is durable;
// if the store refuses it, nothing of it was admitted and every waiting request is told why.
// Thread-safe; it runs one thread of its own.
class Appender {
 public:
  // All references must outlive the appender. `admission` has followed every event of the store.
  Appender(std::string map,
           const HostLimits& limits,
           MapStore& store,
           Applier& applier,
           AdmissionControl admission);
  ~Appender();

  // Queues the request, whose `done` is called in any case. Errors: kResourceExhausted (window or
  // disk full), kUnavailable (stopping, or the disk failed), kInvalidArgument, kNotFound,
  // kAlreadyExists, kFailedPrecondition (gap; session closed).
  void Submit(AppendRequest request) LOCI_EXCLUDES(mutex_);

  // Answers what waits with kUnavailable and joins the thread. An append that runs is finished.
  void Stop() LOCI_EXCLUDES(mutex_);

  // What is durable of a session; nothing if it was never opened.
  std::optional<DurableSession> FindSession(const std::string& session) const LOCI_EXCLUDES(mutex_);
  // By SessionId.
  std::vector<DurableSession> ListSessions() const LOCI_EXCLUDES(mutex_);

  AppenderCounts Counts() const LOCI_EXCLUDES(mutex_);
  // Why the map takes no writes any more; OK while it does.
  Status Health() const LOCI_EXCLUDES(mutex_);

 private:
  // A request with what is decided of it so far.
  struct Pending {
    AppendRequest request;
    std::size_t size_bytes = 0;
    std::size_t next_observation = 0;  // of a batch: index of the first one not yet looked at
    AppendOutcome outcome;
  };
  // Requests that end with the group, and what they will be told if it becomes durable.
  struct Finished {
    Pending pending;
    Status status;
  };
  struct Group {
    std::vector<Event> events;
    std::vector<LogEntry> entries;
    std::size_t size_bytes = 0;
    std::vector<Finished> finished;
  };
  enum class Step : std::uint8_t { kFinished, kMore };

  void Run();
  bool TakeIncoming() LOCI_EXCLUDES(mutex_);
  Group BuildGroup();
  void TakeTurn(std::deque<Pending>& queue, Group& group);
  StatusOr<Step> Advance(Pending& pending, Group& group);
  StatusOr<Step> AdvanceOpen(const OpenRequest& open, Pending& pending, Group& group);
  StatusOr<Step> AdvanceBatch(BatchRequest& batch, Pending& pending, Group& group);
  StatusOr<Step> AdvanceClose(Pending& pending, Group& group);
  void AddToGroup(Event event, Group& group);
  void Commit(Group group) LOCI_EXCLUDES(mutex_);
  void Fail(Group group, const Status& status) LOCI_EXCLUDES(mutex_);
  void AnswerAll(std::vector<Finished> finished) LOCI_EXCLUDES(mutex_);
  void Release(const Pending& pending) LOCI_EXCLUDES(mutex_);

  const std::string map_;
  const HostLimits limits_;
  MapStore& store_;
  Applier& applier_;

  // Of the appender's thread alone:
  AdmissionControl tentative_;                         // with the group that is being built
  std::map<std::string, std::deque<Pending>> queues_;  // by session; none is empty
  std::string last_served_;                            // session whose turn was last
  EventNumber last_event_;                             // durable

  mutable Mutex mutex_;
  ConditionVariable wake_;
  std::vector<Pending> incoming_ LOCI_GUARDED_BY(mutex_);
  std::map<std::string, std::size_t> session_bytes_ LOCI_GUARDED_BY(mutex_);  // none is 0
  std::size_t map_bytes_ LOCI_GUARDED_BY(mutex_) = 0;
  AdmissionControl durable_ LOCI_GUARDED_BY(mutex_);
  AppenderCounts counts_ LOCI_GUARDED_BY(mutex_);
  Status health_ LOCI_GUARDED_BY(mutex_);
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses everything above
};

}  // namespace loci
