// SPDX-License-Identifier: Apache-2.0
// The calls in flight and the peers that made them.
#include "server/rpc/call_table.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "server/rpc/frame.h"

namespace loci {
namespace {

// Peers that are known: more connections than a machine has files.
constexpr std::size_t kPeersMax = 65'536;
// What a message costs beside its bytes: queues and control blocks.
constexpr std::size_t kMessageOverheadBytes = 256;
constexpr std::chrono::milliseconds kSweepMax{1'000};
constexpr std::chrono::milliseconds kStarvedRetry{20};

std::string Exceeds(std::string_view what, std::size_t limit) {
  return std::string(what) + " exceed the limit of " + std::to_string(limit) +
         "; wait for answers and send again";
}

}  // namespace

CallTable::CallTable(const DispatcherOptions& options,
                     const Clock& clock,
                     std::shared_ptr<RpcCounters> counters)
    : options_(options),
      clock_(clock),
      counters_(std::move(counters)),
      pool_(options.worker_count) {}

void CallTable::Start(Transport& transport) {
  const MutexLock lock(transport_mutex_);
  transport_ = &transport;
}

void CallTable::Detach() {
  const MutexLock lock(transport_mutex_);
  transport_ = nullptr;
}

void CallTable::EndAll() {
  std::vector<std::shared_ptr<ServerCall>> calls;
  {
    const MutexLock lock(mutex_);
    draining_ = true;
    for (const auto& [id, peer] : peers_) {
      for (const auto& [call_id, entry] : peer.calls) {
        calls.push_back(entry.call);
      }
    }
  }
  for (const std::shared_ptr<ServerCall>& call : calls) {
    call->Finish(UnavailableError("the server is stopping; try again"));
  }
}

void CallTable::StopWorkers() {
  pool_.Stop();
  Peers dropped;  // destroyed without the lock: tasks that waited for their turn hold calls
  const MutexLock lock(mutex_);
  dropped.swap(peers_);
}

bool CallTable::HearFrom(const PeerId& peer, TimePoint now) {
  const MutexLock lock(mutex_);
  auto found = peers_.find(peer);
  if (found == peers_.end()) {
    if (peers_.size() >= kPeersMax) {
      return false;
    }
    found = peers_.try_emplace(peer).first;
    found->second.strand = std::make_shared<Strand>(pool_);
    found->second.pinged = now;
    counters_->peers.store(peers_.size());
  }
  found->second.heard = now;
  return found->second.account->unsent_messages.load() <= options_.unsent_messages_per_peer_max;
}

Status CallTable::CheckRoomLocked(const Peer& peer, const ServerCall::Request& request) const {
  if (draining_) {
    return UnavailableError("the server is stopping; try again");
  }
  if (peer.calls.size() + peer.ending->load() >= options_.calls_per_peer_max) {
    return ResourceExhaustedError(
        Exceeds("calls in flight on this connection", options_.calls_per_peer_max));
  }
  if (call_count_ >= options_.calls_max) {
    return ResourceExhaustedError(Exceeds("calls in flight in the server", options_.calls_max));
  }
  if (peer.request_bytes + request.size_bytes > options_.request_bytes_per_peer_max) {
    return ResourceExhaustedError(Exceeds("bytes of requests in flight on this connection",
                                          options_.request_bytes_per_peer_max));
  }
  if (request_bytes_ + request.size_bytes > options_.request_bytes_max) {
    return ResourceExhaustedError(
        Exceeds("bytes of requests in flight in the server", options_.request_bytes_max));
  }
  return {};
}

StatusOr<std::shared_ptr<ServerCall>> CallTable::Begin(ServerCall::Request request,
                                                       MethodCounters& counters) {
  const MutexLock lock(mutex_);
  const auto found = peers_.find(request.peer);
  if (found == peers_.end()) {
    return UnavailableError("the connection is gone");
  }
  Peer& peer = found->second;
  if (request.call_id <= peer.last_call_id) {
    return AlreadyExistsError("a repeat");
  }
  peer.last_call_id = request.call_id;
  LOCI_RETURN_IF_ERROR(CheckRoomLocked(peer, request));
  peer.request_bytes += request.size_bytes;
  request_bytes_ += request.size_bytes;
  counters_->calls_in_flight.store(++call_count_);
  const std::uint64_t call_id = request.call_id;
  const Deadline deadline = request.deadline;
  auto call =
      std::make_shared<ServerCall>(shared_from_this(), std::move(request), peer.account, counters);
  const auto position =
      deadline.never() ? deadlines_.end() : deadlines_.emplace(deadline.time(), call);
  peer.calls.emplace(call_id, CallEntry{call, position});
  return call;
}

void CallTable::Remove(const ServerCall& call) {
  std::shared_ptr<ServerCall> kept;  // destroyed without the lock
  const MutexLock lock(mutex_);
  const auto peer = peers_.find(call.peer());
  if (peer == peers_.end()) {
    return;
  }
  const auto entry = peer->second.calls.find(call.call_id());
  if (entry == peer->second.calls.end() || entry->second.call.get() != &call) {
    return;
  }
  if (entry->second.deadline != deadlines_.end()) {
    deadlines_.erase(entry->second.deadline);
  }
  peer->second.request_bytes -= call.request_size_bytes();
  request_bytes_ -= call.request_size_bytes();
  counters_->calls_in_flight.store(--call_count_);
  kept = std::move(entry->second.call);
  peer->second.calls.erase(entry);
}

void CallTable::Cancel(const PeerId& peer, std::uint64_t call_id) {
  std::shared_ptr<ServerCall> call;
  {
    const MutexLock lock(mutex_);
    const auto found = peers_.find(peer);
    if (found == peers_.end()) {
      return;
    }
    const auto entry = found->second.calls.find(call_id);
    if (entry == found->second.calls.end()) {
      return;  // it has ended meanwhile
    }
    call = entry->second.call;
  }
  call->Finish(Status(StatusCode::kCancelled, "cancelled by the client"));
}

void CallTable::DropPeer(const PeerId& peer, const std::string& reason) {
  std::vector<std::shared_ptr<ServerCall>> calls;
  {
    const MutexLock lock(mutex_);
    const auto found = peers_.find(peer);
    if (found == peers_.end()) {
      return;
    }
    for (const auto& [call_id, entry] : found->second.calls) {
      calls.push_back(entry.call);
    }
  }
  for (const std::shared_ptr<ServerCall>& call : calls) {
    call->Finish(Status(StatusCode::kCancelled, reason));
  }
  const MutexLock lock(mutex_);
  const auto found = peers_.find(peer);
  // Requests begin on the transport's thread, as this runs: none has come meanwhile.
  if (found != peers_.end() && found->second.calls.empty()) {
    peers_.erase(found);
    counters_->peers.store(peers_.size());
  }
}

std::vector<std::shared_ptr<ServerCall>> CallTable::TakeLateLocked(TimePoint now) {
  std::vector<std::shared_ptr<ServerCall>> late;
  for (auto it = deadlines_.begin(); it != deadlines_.end() && it->first <= now; ++it) {
    if (std::shared_ptr<ServerCall> call = it->second.lock()) {
      late.push_back(std::move(call));
    }
  }
  return late;
}

void CallTable::TakeSilentLocked(TimePoint now,
                                 std::vector<PeerId>& to_ping,
                                 std::vector<PeerId>& gone) {
  if (now < next_sweep_) {
    return;
  }
  next_sweep_ = now + std::min<Duration>(options_.ping_after / 4, kSweepMax);
  for (auto& [id, peer] : peers_) {
    if (now - peer.heard >= options_.gone_after) {
      gone.push_back(id);
    } else if (now - std::max(peer.heard, peer.pinged) >= options_.ping_after) {
      peer.pinged = now;
      to_ping.push_back(id);
    }
  }
}

TimePoint CallTable::NextTickLocked(TimePoint now) const {
  TimePoint next = next_sweep_;
  if (!deadlines_.empty()) {
    next = std::min(next, deadlines_.begin()->first);
  }
  if (starved_.load()) {
    next = std::min(next, now + kStarvedRetry);
  }
  return next;
}

TimePoint CallTable::Tick(TimePoint now) {
  std::vector<std::shared_ptr<ServerCall>> late;
  std::vector<std::shared_ptr<ServerCall>> starved;
  std::vector<PeerId> to_ping;
  std::vector<PeerId> gone;
  {
    const MutexLock lock(mutex_);
    late = TakeLateLocked(now);
    TakeSilentLocked(now, to_ping, gone);
    if (starved_.exchange(false)) {
      for (const auto& [id, peer] : peers_) {
        for (const auto& [call_id, entry] : peer.calls) {
          starved.push_back(entry.call);
        }
      }
    }
  }
  for (const std::shared_ptr<ServerCall>& call : late) {
    call->Finish(DeadlineExceededError(call->method() + ": the deadline passed in the server"));
  }
  for (const PeerId& peer : to_ping) {
    SendControl(peer, PingEnvelope(0));
  }
  for (const PeerId& peer : gone) {
    DropPeer(peer, "the client has said nothing for too long");
  }
  for (const std::shared_ptr<ServerCall>& call : starved) {
    const MutexLock lock(call->mutex_);
    call->ScheduleLocked();
  }
  const MutexLock lock(mutex_);
  return NextTickLocked(now);
}

void CallTable::Post(const PeerId& peer, bool ordered, std::function<void()> task) {
  if (!ordered) {
    pool_.Post(std::move(task));
    return;
  }
  std::shared_ptr<Strand> strand;
  {
    const MutexLock lock(mutex_);
    const auto found = peers_.find(peer);
    if (found == peers_.end()) {
      return;  // and the call has ended with its peer
    }
    strand = found->second.strand;
  }
  strand->Post(std::move(task));
}

void CallTable::NoteStarved() {
  if (!starved_.exchange(true)) {
    const MutexLock lock(transport_mutex_);
    if (transport_ != nullptr) {
      transport_->Wake();
    }
  }
}

bool CallTable::HasRoom(const Account& account) const {
  return account.unsent_bytes.load() < options_.unsent_bytes_per_peer_max &&
         account.unsent_messages.load() < options_.unsent_messages_per_peer_max &&
         unsent_bytes_.load() < options_.unsent_bytes_max;
}

bool CallTable::ResponseFits(const Account& account, std::size_t size_bytes) const {
  return account.unsent_bytes.load() + size_bytes <= options_.unsent_bytes_per_peer_max &&
         unsent_bytes_.load() + size_bytes <= options_.unsent_bytes_max;
}

bool CallTable::Transmit(OutgoingMessage message) {
  const MutexLock lock(transport_mutex_);
  return transport_ != nullptr && transport_->Send(std::move(message));
}

bool CallTable::SendFrom(ServerCall& call, std::string envelope, std::string body, bool is_end) {
  const std::size_t body_size = body.size();
  const std::size_t size = envelope.size() + body_size + kMessageOverheadBytes;
  const std::shared_ptr<Account>& account = call.account_;
  std::shared_ptr<std::atomic<std::size_t>> ending;
  if (is_end) {
    const MutexLock lock(mutex_);
    const auto found = peers_.find(call.peer());
    if (found != peers_.end()) {
      ending = found->second.ending;
      ++*ending;
    }
  }
  account->unsent_bytes += size;
  account->unsent_messages++;
  unsent_bytes_ += size;
  const auto give_back = [self = shared_from_this(), account, ending, size] {
    account->unsent_bytes -= size;
    account->unsent_messages--;
    self->unsent_bytes_ -= size;
    if (ending != nullptr) {
      --*ending;
    }
  };
  auto on_released = [give_back, is_end, body_size, held = call.shared_from_this()] {
    give_back();
    if (!is_end) {
      held->OnReleased(body_size);
    }
  };
  if (Transmit({call.peer(), std::move(envelope), std::move(body), std::move(on_released)})) {
    return true;
  }
  give_back();
  return false;
}

void CallTable::SendControl(const PeerId& peer, std::string envelope) {
  std::shared_ptr<Account> account;
  {
    const MutexLock lock(mutex_);
    const auto found = peers_.find(peer);
    if (found == peers_.end()) {
      return;
    }
    account = found->second.account;
  }
  account->unsent_messages++;
  if (!Transmit({peer, std::move(envelope), {}, [account] { account->unsent_messages--; }})) {
    account->unsent_messages--;
  }
}

}  // namespace loci
