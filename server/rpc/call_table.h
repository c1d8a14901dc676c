// SPDX-License-Identifier: Apache-2.0
// The calls in flight and the peers that made them.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/rpc/call.h"
#include "server/rpc/counters.h"
#include "server/rpc/dispatcher.h"
#include "server/rpc/worker_pool.h"
#include "server/transport/transport.h"

namespace loci {

// Any thread may call. Calls hold it alive, so that one which ends late finds it.
//
// Locks are taken in this order: a call's, the table's, the transport's.
class CallTable : public std::enable_shared_from_this<CallTable> {
 public:
  CallTable(const DispatcherOptions& options,
            const Clock& clock,
            std::shared_ptr<RpcCounters> counters);

  const DispatcherOptions& options() const { return options_; }

  void Start(Transport& transport);
  // Ends all calls with UNAVAILABLE; new ones are refused.
  void EndAll();
  // No message is sent any more.
  void Detach();
  // Waits for the tasks that run and drops those that wait, with all that is known of peers.
  void StopWorkers();

  // Notes that the peer lives. False: it leaves too much unread, and what it asks is ignored.
  bool HearFrom(const PeerId& peer, TimePoint now);

  // A new call, or the reason why not. kAlreadyExists: a repeat, which gets no answer.
  StatusOr<std::shared_ptr<ServerCall>> Begin(ServerCall::Request request,
                                              MethodCounters& counters);
  void Cancel(const PeerId& peer, std::uint64_t call_id);
  void DropPeer(const PeerId& peer, const std::string& reason);
  // Ends what is late, pings who is silent. Returns when it wants to be called again.
  TimePoint Tick(TimePoint now);

  // Sends without a call: refusals, pings. What it costs is counted on the peer.
  void SendControl(const PeerId& peer, std::string envelope);

  // Runs a task of a peer: in the order of its other ones if `ordered`.
  void Post(const PeerId& peer, bool ordered, std::function<void()> task);

  // For calls:
  bool SendFrom(ServerCall& call, std::string envelope, std::string body, bool is_end);
  void Remove(const ServerCall& call);
  void Post(std::function<void()> task) { pool_.Post(std::move(task)); }
  bool HasRoom(const ServerCall::PeerAccount& account) const;
  bool ResponseFits(const ServerCall::PeerAccount& account, std::size_t size_bytes) const;
  TimePoint Now() const { return clock_.Now(); }
  // A stream waits for room that not it, but its peer or the server lacks: Tick asks it again.
  void NoteStarved();

 private:
  using Account = ServerCall::PeerAccount;
  struct CallEntry {
    std::shared_ptr<ServerCall> call;
    std::multimap<TimePoint, std::weak_ptr<ServerCall>>::iterator deadline;
  };
  struct Peer {
    std::shared_ptr<Account> account = std::make_shared<Account>();
    std::shared_ptr<Strand> strand;
    std::map<std::uint64_t, CallEntry> calls;
    // Ended, but the end has not left yet: they count, so that who does not read does not ask more.
    std::shared_ptr<std::atomic<std::size_t>> ending =
        std::make_shared<std::atomic<std::size_t>>(0);
    std::uint64_t last_call_id = 0;
    std::size_t request_bytes = 0;
    TimePoint heard;
    TimePoint pinged;
  };
  using Peers = std::unordered_map<PeerId, Peer>;

  Status CheckRoomLocked(const Peer& peer, const ServerCall::Request& request) const
      LOCI_REQUIRES(mutex_);
  bool Transmit(OutgoingMessage message);
  std::vector<std::shared_ptr<ServerCall>> TakeLateLocked(TimePoint now) LOCI_REQUIRES(mutex_);
  TimePoint NextTickLocked(TimePoint now) const LOCI_REQUIRES(mutex_);
  void TakeSilentLocked(TimePoint now, std::vector<PeerId>& to_ping, std::vector<PeerId>& gone)
      LOCI_REQUIRES(mutex_);

  const DispatcherOptions options_;
  const Clock& clock_;
  const std::shared_ptr<RpcCounters> counters_;
  WorkerPool pool_;
  std::atomic<std::size_t> unsent_bytes_{0};
  std::atomic<bool> starved_{false};
  Mutex mutex_;
  Peers peers_ LOCI_GUARDED_BY(mutex_);
  std::multimap<TimePoint, std::weak_ptr<ServerCall>> deadlines_ LOCI_GUARDED_BY(mutex_);
  std::size_t call_count_ LOCI_GUARDED_BY(mutex_) = 0;
  std::size_t request_bytes_ LOCI_GUARDED_BY(mutex_) = 0;
  bool draining_ LOCI_GUARDED_BY(mutex_) = false;
  TimePoint next_sweep_ LOCI_GUARDED_BY(mutex_);
  Mutex transport_mutex_;
  Transport* transport_ LOCI_GUARDED_BY(transport_mutex_) = nullptr;
};

}  // namespace loci
