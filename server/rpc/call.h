// SPDX-License-Identifier: Apache-2.0
// A call as its handler sees it.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <google/protobuf/message_lite.h>

#include "core/base/status.h"
#include "server/base/mutex.h"
#include "server/rpc/deadline.h"
#include "server/transport/transport.h"

namespace loci {

class CallTable;
struct MethodCounters;

// What a step of a stream found.
enum class StreamStep {
  kMessage,  // a message; ask again
  kEnd,      // no more: the call ends with OK
  kWait,     // nothing now: ask again after ServerCall::Wake
};

// Gives the messages of a server stream, one for each call. It is called by one worker at a time,
// and only while the reader keeps up: it need not and must not wait. It is destroyed when the call
// is over, so what it holds can end a subscription. An error ends the call with it.
template <typename Response>
using StreamSource = std::function<StatusOr<StreamStep>(Response& response)>;

// A call in progress. Any thread may call any function. It may outlive the dispatcher.
//
// Invariant: exactly one end is sent, whoever comes first: the handler, the deadline, the client's
// cancellation, or the loss of the peer. What comes after is dropped.
class ServerCall : public std::enable_shared_from_this<ServerCall> {
 public:
  using Metadata = std::map<std::string, std::string>;
  // Appends the next message's bytes to its argument.
  using ByteSource = std::function<StatusOr<StreamStep>(std::string& body)>;

  struct Request {
    PeerId peer;
    std::uint64_t call_id = 0;
    std::string method;  // "loci.v1.MapQuery/GetTile"
    Metadata metadata;
    Deadline deadline;
    std::size_t size_bytes = 0;
    TimePoint arrival;
  };

  // For the call table. `unsent` is the account of the peer.
  struct PeerAccount {
    std::atomic<std::size_t> unsent_bytes{0};
    std::atomic<std::size_t> unsent_messages{0};
  };
  ServerCall(std::shared_ptr<CallTable> table,
             Request request,
             std::shared_ptr<PeerAccount> account,
             MethodCounters& counters);

  const std::string& method() const { return request_.method; }
  const Metadata& metadata() const { return request_.metadata; }
  const Deadline& deadline() const { return request_.deadline; }
  const PeerId& peer() const { return request_.peer; }
  std::uint64_t call_id() const { return request_.call_id; }
  std::size_t request_size_bytes() const { return request_.size_bytes; }

  // True when nobody waits for the answer any more. Long work asks at least every millisecond.
  bool over() const { return over_.load(std::memory_order_acquire); }

  // Calls `callback` once when the call is over, at once if it is. It may run on any thread and
  // must be short.
  void OnOver(std::function<void()> callback);

  // Ends the call. With kOk, a unary call must have been given its response.
  void Finish(const Status& status);
  // Ends a unary call with OK and these bytes.
  void FinishWithBody(std::string body);

  // Begins a stream that `source` feeds.
  void StartStream(ByteSource source);
  // Asks a source again that said kWait.
  void Wake();

 private:
  friend class CallTable;
  enum class Pump { kNone, kIdle, kScheduled, kRunning };

  // Sends under the lock, so that no message follows the end.
  void SendBodyLocked(std::string body) LOCI_REQUIRES(mutex_);
  bool HasRoomLocked() LOCI_REQUIRES(mutex_);
  void ScheduleLocked() LOCI_REQUIRES(mutex_);
  void End(const Status& status, std::string* body);
  void RunPump();
  bool StepPump();
  void OnReleased(std::size_t size_bytes);

  const std::shared_ptr<CallTable> table_;
  const Request request_;
  const std::shared_ptr<PeerAccount> account_;
  MethodCounters& counters_;
  std::atomic<bool> over_{false};
  Mutex mutex_;
  std::vector<std::function<void()>> on_over_ LOCI_GUARDED_BY(mutex_);
  Pump pump_ LOCI_GUARDED_BY(mutex_) = Pump::kNone;
  bool wanted_ LOCI_GUARDED_BY(mutex_) = false;
  std::size_t unsent_bytes_ LOCI_GUARDED_BY(mutex_) = 0;
  std::size_t unsent_messages_ LOCI_GUARDED_BY(mutex_) = 0;
  ByteSource source_;  // touched only by whoever runs the pump, or starts it
};

// A unary call that its handler finishes whenever it likes, from any thread. Let it go unfinished,
// and the client gets INTERNAL.
template <typename RequestType, typename Response>
class UnaryCall {
 public:
  UnaryCall(std::shared_ptr<ServerCall> call, RequestType request)
      : call_(std::move(call)), request_(std::move(request)) {}
  UnaryCall(const UnaryCall&) = delete;
  UnaryCall& operator=(const UnaryCall&) = delete;
  ~UnaryCall() { call_->Finish(InternalError(call_->method() + ": the handler gave no answer")); }

  // The handler may move from it.
  RequestType& request() { return request_; }
  ServerCall& context() { return *call_; }
  bool over() const { return call_->over(); }

  // The first one counts.
  void Finish(const Response& response) { call_->FinishWithBody(response.SerializeAsString()); }
  void Finish(const Status& status) {
    call_->Finish(status.ok() ? InternalError(call_->method() + ": OK without a response")
                              : status);
  }
  void Finish(const StatusOr<Response>& result) {
    if (result.ok()) {
      Finish(*result);
    } else {
      Finish(result.status());
    }
  }

 private:
  const std::shared_ptr<ServerCall> call_;
  RequestType request_;
};

}  // namespace loci
