// SPDX-License-Identifier: Apache-2.0
// Joins requests to handlers, by the service descriptors.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "core/base/status.h"
#include "server/base/clock.h"
#include "server/rpc/call.h"
#include "server/rpc/counters.h"
#include "server/rpc/deadline.h"
#include "server/rpc/wire_scan.h"
#include "server/transport/transport.h"

namespace loci {

// Where a handler runs.
enum class Execution {
  kInline,   // on the transport's thread: for handlers that take microseconds and never wait
  kWorker,   // on any worker, in any order
  kOrdered,  // on any worker; the kOrdered calls of one peer one after the other, as they came
};

struct DispatcherOptions {
  std::size_t worker_count = 2;
  // Longest request and response body; a longer one is RESOURCE_EXHAUSTED.
  std::size_t message_max_bytes = std::size_t{4} << 20U;
  // Calls in flight, of one peer and of all; more are RESOURCE_EXHAUSTED.
  std::size_t calls_per_peer_max = 256;
  std::size_t calls_max = 8192;
  // Bytes of requests in flight, of one peer and of all; more are RESOURCE_EXHAUSTED.
  std::size_t request_bytes_per_peer_max = std::size_t{64} << 20U;
  std::size_t request_bytes_max = std::size_t{256} << 20U;
  // Bytes of answers that the operating system has not taken yet. A unary answer over them becomes
  // RESOURCE_EXHAUSTED, a stream waits.
  std::size_t unsent_bytes_per_peer_max = std::size_t{64} << 20U;
  std::size_t unsent_bytes_max = std::size_t{512} << 20U;
  // Messages, however small, that one peer may leave unread before its requests are ignored.
  std::size_t unsent_messages_per_peer_max = 4096;
  // What one stream may have unsent before its source is left alone.
  std::size_t stream_window_bytes = std::size_t{1} << 20U;
  std::size_t stream_window_messages = 64;
  // A peer with calls in flight that says nothing is pinged after the first and given up after the
  // second.
  std::chrono::milliseconds ping_after{10'000};
  std::chrono::milliseconds gone_after{30'000};
  // Bounds of what a request may hold, against bodies that grow when they are parsed.
  WireLimits wire_limits;
};

// Owns the workers and the calls in flight. Add* and AddService before Start, by one thread; after
// that it works by itself. Handlers must not block for long: a worker that waits serves nobody.
class Dispatcher : public TransportSink {
 public:
  // `clock` must outlive it and be the transport's.
  Dispatcher(const DispatcherOptions& options, const Clock& clock);
  Dispatcher(const Dispatcher&) = delete;
  Dispatcher& operator=(const Dispatcher&) = delete;
  ~Dispatcher() override;

  // Declares that every method of the service with this full name ("loci.v1.MapQuery") is served.
  void AddService(std::string_view service);

  // A handler that answers at once. `method` is "loci.v1.MapQuery/GetTile".
  template <typename Request, typename Response>
  void AddUnary(
      const std::string& method,
      Execution execution,
      std::function<StatusOr<Response>(ServerCall& call, const Request& request)> handler);

  // A handler that may answer later, from any thread.
  template <typename Request, typename Response>
  void AddAsyncUnary(
      const std::string& method,
      Execution execution,
      std::function<void(std::shared_ptr<UnaryCall<Request, Response>> call)> handler);

  // A handler that gives the source of a stream. It may keep the call, to Wake it.
  template <typename Request, typename Response>
  void AddServerStream(
      const std::string& method,
      Execution execution,
      std::function<StatusOr<StreamSource<Response>>(const std::shared_ptr<ServerCall>& call,
                                                     const Request& request)> handler);

  // Begins to serve. kFailedPrecondition names every method of the services that has no handler, or
  // one of another request, response or streaming kind, and every handler of a method that there is
  // not. `transport` must live until Stop has returned.
  Status Start(Transport& transport);

  // Ends every call with UNAVAILABLE, refuses new ones, waits at most `drain` for the answers to
  // leave, stops the transport, and waits for handlers that are running: those ask
  // ServerCall::over.
  void Stop(Duration drain = std::chrono::milliseconds(250));

  // The services, in the order of AddService. For reflection and health.
  const std::vector<const google::protobuf::ServiceDescriptor*>& services() const;
  const RpcCounters& counters() const;

  void OnMessage(const PeerId& peer, std::string envelope, std::string body) override;
  void OnPeerGone(const PeerId& peer) override;
  TimePoint OnTick(TimePoint now) override;

 private:
  class Impl;
  // Runs a handler on the bytes of a request.
  using Invoke = std::function<void(const std::shared_ptr<ServerCall>& call, std::string body)>;
  struct Handler {
    const google::protobuf::Descriptor* request = nullptr;
    const google::protobuf::Descriptor* response = nullptr;
    bool server_streaming = false;
    Execution execution = Execution::kWorker;
    Invoke invoke;
  };
  void AddHandler(const std::string& method, Handler&& handler);
  // Scans and parses `body`, or ends the call with kInvalidArgument.
  bool ParseRequest(ServerCall& call, const std::string& body, google::protobuf::Message& request);

  std::unique_ptr<Impl> impl_;
};

template <typename Request, typename Response>
void Dispatcher::AddUnary(
    const std::string& method,
    Execution execution,
    std::function<StatusOr<Response>(ServerCall& call, const Request& request)> handler) {
  AddHandler(method,
             {Request::descriptor(),
              Response::descriptor(),
              false,
              execution,
              [this, handler = std::move(handler)](const std::shared_ptr<ServerCall>& call,
                                                   const std::string& body) {
                Request request;
                if (!ParseRequest(*call, body, request)) {
                  return;
                }
                const StatusOr<Response> result = handler(*call, request);
                if (result.ok()) {
                  call->FinishWithBody(result->SerializeAsString());
                } else {
                  call->Finish(result.status());
                }
              }});
}

template <typename Request, typename Response>
void Dispatcher::AddAsyncUnary(
    const std::string& method,
    Execution execution,
    std::function<void(std::shared_ptr<UnaryCall<Request, Response>> call)> handler) {
  AddHandler(method,
             {Request::descriptor(),
              Response::descriptor(),
              false,
              execution,
              [this, handler = std::move(handler)](const std::shared_ptr<ServerCall>& call,
                                                   std::string body) {
                Request request;
                if (ParseRequest(*call, body, request)) {
                  body = {};  // the parsed form may wait for long
                  handler(std::make_shared<UnaryCall<Request, Response>>(call, std::move(request)));
                }
              }});
}

template <typename Request, typename Response>
void Dispatcher::AddServerStream(
    const std::string& method,
    Execution execution,
    std::function<StatusOr<StreamSource<Response>>(const std::shared_ptr<ServerCall>& call,
                                                   const Request& request)> handler) {
  AddHandler(method,
             {Request::descriptor(),
              Response::descriptor(),
              true,
              execution,
              [this, handler = std::move(handler)](const std::shared_ptr<ServerCall>& call,
                                                   const std::string& body) {
                Request request;
                if (!ParseRequest(*call, body, request)) {
                  return;
                }
                StatusOr<StreamSource<Response>> source = handler(call, request);
                if (!source.ok()) {
                  call->Finish(source.status());
                  return;
                }
                call->StartStream([source = std::move(source).value()](
                                      std::string& bytes) -> StatusOr<StreamStep> {
                  Response response;
                  LOCI_ASSIGN_OR_RETURN(const StreamStep step, source(response));
                  if (step == StreamStep::kMessage) {
                    response.AppendToString(&bytes);
                  }
                  return step;
                });
              }});
}

}  // namespace loci
