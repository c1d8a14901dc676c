// SPDX-License-Identifier: Apache-2.0
#include "server/host/appender.h"

#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

namespace loci {
namespace {

std::string Quoted(const std::string& name) {
  return "\"" + name + "\"";
}

}  // namespace

Appender::Appender(std::string map,
                   const HostLimits& limits,
                   MapStore& store,
                   Applier& applier,
                   AdmissionControl admission)
    : map_(std::move(map)),
      limits_(limits),
      store_(store),
      applier_(applier),
      tentative_(admission),
      last_event_(store.LastEvent()),
      durable_(std::move(admission)) {
  thread_ = std::thread([this] { Run(); });
}

Appender::~Appender() {
  Stop();
}

void Appender::Submit(AppendRequest request) {
  Pending pending;
  pending.size_bytes = SizeBytes(request);
  pending.request = std::move(request);
  Status refused;
  {
    const MutexLock lock(mutex_);
    const auto session = session_bytes_.find(pending.request.session);
    const std::size_t session_bytes = session == session_bytes_.end() ? 0 : session->second;
    if (stopping_) {
      refused = UnavailableError("map " + Quoted(map_) + ": the server is stopping");
    } else if (!health_.ok()) {
      refused = health_;
    } else if (session_bytes > 0 &&
               session_bytes + pending.size_bytes > limits_.session_window_bytes) {
      refused = ResourceExhaustedError(
          "session " + Quoted(pending.request.session) + ": " + std::to_string(session_bytes) +
          " bytes wait to become durable, the window is " +
          std::to_string(limits_.session_window_bytes) + "; send again later");
    } else if (map_bytes_ > 0 && map_bytes_ + pending.size_bytes > limits_.map_window_bytes) {
      refused =
          ResourceExhaustedError("map " + Quoted(map_) + ": " + std::to_string(map_bytes_) +
                                 " bytes of all sessions wait to become durable, the window is " +
                                 std::to_string(limits_.map_window_bytes) + "; send again later");
    } else {
      session_bytes_[pending.request.session] += pending.size_bytes;
      map_bytes_ += pending.size_bytes;
      incoming_.push_back(std::move(pending));
      wake_.NotifyAll();
      return;
    }
  }
  pending.request.done(refused);
}

void Appender::Stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    wake_.NotifyAll();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
}

std::optional<DurableSession> Appender::FindSession(const std::string& session) const {
  const MutexLock lock(mutex_);
  SessionId id;
  const AdmittedSession* const found = durable_.FindByName(session, &id);
  return found == nullptr ? std::nullopt : std::optional(DurableSession{id, *found});
}

std::vector<DurableSession> Appender::ListSessions() const {
  const MutexLock lock(mutex_);
  std::vector<DurableSession> sessions;
  for (SessionId id; durable_.Find(id) != nullptr; ++id.value) {
    sessions.push_back({id, *durable_.Find(id)});
  }
  return sessions;
}

AppenderCounts Appender::Counts() const {
  const MutexLock lock(mutex_);
  AppenderCounts counts = counts_;
  counts.bytes_waiting = map_bytes_;
  return counts;
}

Status Appender::Health() const {
  const MutexLock lock(mutex_);
  return health_;
}

void Appender::Run() {
  while (TakeIncoming()) {
    applier_.WaitForRoom();
    Commit(BuildGroup());
  }
  Fail({}, UnavailableError("the server is stopping"));
}

// Waits for requests. False when the thread shall end.
bool Appender::TakeIncoming() {
  std::vector<Pending> taken;
  {
    const MutexLock lock(mutex_);
    while (queues_.empty() && incoming_.empty() && !stopping_) {
      wake_.Wait(mutex_);
    }
    if (stopping_) {
      return false;
    }
    taken.swap(incoming_);
  }
  for (Pending& pending : taken) {
    queues_[pending.request.session].push_back(std::move(pending));
  }
  return true;
}

Appender::Group Appender::BuildGroup() {
  Group group;
  while (!queues_.empty() && group.entries.size() < limits_.group_events_max &&
         group.size_bytes < limits_.group_bytes_max) {
    auto turn = queues_.upper_bound(last_served_);
    if (turn == queues_.end()) {
      turn = queues_.begin();
    }
    last_served_ = turn->first;
    TakeTurn(turn->second, group);
    if (turn->second.empty()) {
      queues_.erase(turn);
    }
  }
  return group;
}

// Goes one event further in the first request of a session.
void Appender::TakeTurn(std::deque<Pending>& queue, Group& group) {
  Pending& pending = queue.front();
  const StatusOr<Step> step = Advance(pending, group);
  if (!step.ok() || *step == Step::kFinished) {
    group.finished.push_back({std::move(pending), step.status()});
    queue.pop_front();
  }
}

StatusOr<Appender::Step> Appender::Advance(Pending& pending, Group& group) {
  if (const auto* open = std::get_if<OpenRequest>(&pending.request.what); open != nullptr) {
    return AdvanceOpen(*open, pending, group);
  }
  if (auto* batch = std::get_if<BatchRequest>(&pending.request.what); batch != nullptr) {
    return AdvanceBatch(*batch, pending, group);
  }
  return AdvanceClose(pending, group);
}

StatusOr<Appender::Step> Appender::AdvanceOpen(const OpenRequest& open,
                                               Pending& pending,
                                               Group& group) {
  const std::string& name = pending.request.session;
  const AdmittedSession* session = tentative_.FindByName(name, &pending.outcome.session);
  if (session == nullptr) {
    const Event event = OpenSessionEvent{name, open.robot, open.map_from_start};
    LOCI_RETURN_IF_ERROR(tentative_.Check(event));
    AddToGroup(event, group);
    LOCI_CHECK(tentative_.FindByName(name, &pending.outcome.session) != nullptr);
    return Step::kFinished;
  }
  if (!session->open) {
    return AlreadyExistsError("session: " + Quoted(name) +
                              " is closed; a new run needs a new name");
  }
  if (session->robot != open.robot) {
    return AlreadyExistsError("session: " + Quoted(name) + " was opened by robot " +
                              Quoted(session->robot));
  }
  if (session->map_from_start != open.map_from_start) {
    return AlreadyExistsError("session: " + Quoted(name) +
                              " was opened with another map_from_start");
  }
  pending.outcome.last_durable_number = session->last_number;
  return Step::kFinished;
}

StatusOr<Appender::Step> Appender::AdvanceBatch(BatchRequest& batch,
                                                Pending& pending,
                                                Group& group) {
  const std::string& name = pending.request.session;
  const AdmittedSession* session = tentative_.FindByName(name, &pending.outcome.session);
  if (session == nullptr) {
    return NotFoundError("session: " + Quoted(name) + " was never opened in map " + Quoted(map_));
  }
  const std::uint64_t expected = session->last_number + 1;
  const std::uint64_t next_number = batch.first_number + pending.next_observation;
  if (next_number > expected) {
    return FailedPreconditionError("first_number: " + std::to_string(batch.first_number) +
                                   ", the number expected next is " + std::to_string(expected));
  }
  // What is durable already is passed over: a batch may be sent again.
  pending.next_observation =
      std::min<std::size_t>(expected - batch.first_number, batch.observations.size());
  if (pending.next_observation < batch.observations.size()) {
    ObservationEvent& observation = batch.observations[pending.next_observation];
    observation.session = pending.outcome.session;
    observation.number = expected;
    Event event = std::move(observation);
    const Status status = tentative_.Check(event);
    if (status.code() == StatusCode::kInvalidArgument) {
      // It is valid by itself, so it is not newer than the session's last: its number is consumed.
      pending.outcome.refused.push_back({expected, status.message()});
      event = RefuseObservationEvent{pending.outcome.session, expected, status.message()};
    } else if (!status.ok()) {
      return status;
    }
    AddToGroup(std::move(event), group);
    ++pending.next_observation;
  }
  pending.outcome.last_durable_number = tentative_.Find(pending.outcome.session)->last_number;
  return pending.next_observation == batch.observations.size() ? Step::kFinished : Step::kMore;
}

StatusOr<Appender::Step> Appender::AdvanceClose(Pending& pending, Group& group) {
  const std::string& name = pending.request.session;
  const AdmittedSession* session = tentative_.FindByName(name, &pending.outcome.session);
  if (session == nullptr) {
    return NotFoundError("session: " + Quoted(name) + " was never opened in map " + Quoted(map_));
  }
  if (session->open) {
    const Event event = CloseSessionEvent{pending.outcome.session};
    LOCI_RETURN_IF_ERROR(tentative_.Check(event));
    AddToGroup(event, group);
  }
  pending.outcome.last_durable_number = tentative_.Find(pending.outcome.session)->last_number;
  return Step::kFinished;
}

// The event has passed Check.
void Appender::AddToGroup(Event event, Group& group) {
  tentative_.Admit(event);
  LogEntry entry{{last_event_.value + group.entries.size() + 1}, EncodeEvent(event)};
  group.size_bytes += entry.bytes.size();
  group.entries.push_back(std::move(entry));
  group.events.push_back(std::move(event));
}

void Appender::Commit(Group group) {
  if (!group.entries.empty()) {
    const Status status = store_.Append(group.entries);
    if (!status.ok()) {
      Fail(std::move(group), status);
      return;
    }
    last_event_ = group.entries.back().number;
    std::vector<DurableEvent> events;
    {
      const MutexLock lock(mutex_);
      ++counts_.appends;
      for (std::size_t i = 0; i < group.entries.size(); ++i) {
        durable_.Admit(group.events[i]);
        events.push_back(
            {group.entries[i].number, std::move(group.events[i]), group.entries[i].bytes.size()});
      }
    }
    // Before the answers, so that a task that a client's next request posts comes after them.
    applier_.Push(std::move(events));
  }
  AnswerAll(std::move(group.finished));
}

// Nothing of the group is in the log. Everything that waits may build on it, so all of it fails.
void Appender::Fail(Group group, const Status& status) {
  Status answer(status.code(), "map " + Quoted(map_) + ": " + status.message());
  std::vector<Pending> incoming;
  {
    const MutexLock lock(mutex_);
    tentative_ = durable_;
    incoming.swap(incoming_);
    if (!group.entries.empty()) {
      ++counts_.append_failures;
      if (status.code() != StatusCode::kResourceExhausted) {
        answer = UnavailableError(answer.message() +
                                  "; the map takes no writes until the server is started again");
        health_ = answer;
      }
      spdlog::error("event=append_failed map={} after={} problem=\"{}\"",
                    map_,
                    last_event_.value,
                    status.ToString());
    }
  }
  std::vector<Finished> finished = std::move(group.finished);
  for (Finished& one : finished) {
    one.status = answer;
  }
  for (auto& [session, queue] : queues_) {
    for (Pending& pending : queue) {
      finished.push_back({std::move(pending), answer});
    }
  }
  queues_.clear();
  for (Pending& pending : incoming) {
    finished.push_back({std::move(pending), answer});
  }
  AnswerAll(std::move(finished));
}

void Appender::AnswerAll(std::vector<Finished> finished) {
  for (Finished& one : finished) {
    Release(one.pending);
    if (one.status.ok()) {
      one.pending.request.done(std::move(one.pending.outcome));
    } else {
      one.pending.request.done(one.status);
    }
  }
}

void Appender::Release(const Pending& pending) {
  const MutexLock lock(mutex_);
  map_bytes_ -= pending.size_bytes;
  const auto session = session_bytes_.find(pending.request.session);
  session->second -= pending.size_bytes;
  if (session->second == 0) {
    session_bytes_.erase(session);
  }
}

}  // namespace loci
