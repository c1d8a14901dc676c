// SPDX-License-Identifier: Apache-2.0
// Joins requests to handlers, by the service descriptors.
#include "server/rpc/dispatcher.h"

#include <exception>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "server/rpc/call_table.h"
#include "server/rpc/frame.h"

namespace loci {
namespace {

using google::protobuf::DescriptorPool;
using google::protobuf::MethodDescriptor;
using google::protobuf::ServiceDescriptor;

std::string MethodName(const ServiceDescriptor& service, const MethodDescriptor& method) {
  return service.full_name() + "/" + method.name();
}

std::string Describe(const std::string& request, const std::string& response, bool streaming) {
  return "(" + request + ") returns (" + (streaming ? "stream " : "") + response + ")";
}

}  // namespace

class Dispatcher::Impl {
 public:
  Impl(const DispatcherOptions& options, const Clock& clock)
      : clock_(clock),
        counters_(std::make_shared<RpcCounters>()),
        table_(std::make_shared<CallTable>(options, clock, counters_)) {}

  Status Check() const;
  void BeginCall(const PeerId& peer, v1::Envelope& envelope, std::string body);
  void Run(const Handler& handler, const std::shared_ptr<ServerCall>& call, std::string body);

  const Clock& clock_;
  std::shared_ptr<RpcCounters> counters_;
  std::vector<std::string> service_names_;
  std::vector<const ServiceDescriptor*> services_;
  std::map<std::string, Handler, std::less<>> handlers_;
  std::vector<std::string> doubled_;  // methods that were given two handlers
  std::shared_ptr<CallTable> table_;
  Transport* transport_ = nullptr;
};

Dispatcher::Dispatcher(const DispatcherOptions& options, const Clock& clock)
    : impl_(std::make_unique<Impl>(options, clock)) {}

Dispatcher::~Dispatcher() {
  Stop(Duration::zero());
}

void Dispatcher::AddService(std::string_view service) {
  impl_->service_names_.emplace_back(service);
  const ServiceDescriptor* descriptor =
      DescriptorPool::generated_pool()->FindServiceByName(std::string(service));
  if (descriptor == nullptr) {
    return;  // Start says so
  }
  impl_->services_.push_back(descriptor);
  for (int i = 0; i < descriptor->method_count(); ++i) {
    impl_->counters_->methods.try_emplace(MethodName(*descriptor, *descriptor->method(i)));
  }
}

void Dispatcher::AddHandler(const std::string& method, Handler&& handler) {
  const auto [position, inserted] = impl_->handlers_.try_emplace(method, std::move(handler));
  if (!inserted) {
    impl_->doubled_.push_back(position->first);
  }
}

Status Dispatcher::Impl::Check() const {
  std::string problems;
  const auto add = [&problems](const std::string& problem) {
    problems += (problems.empty() ? "" : "; ") + problem;
  };
  for (const std::string& name : service_names_) {
    if (DescriptorPool::generated_pool()->FindServiceByName(name) == nullptr) {
      add(name + ": no such service is linked in");
    }
  }
  std::set<std::string> declared;
  for (const ServiceDescriptor* service : services_) {
    for (int i = 0; i < service->method_count(); ++i) {
      const MethodDescriptor& method = *service->method(i);
      const std::string name = MethodName(*service, method);
      declared.insert(name);
      const auto found = handlers_.find(name);
      if (found == handlers_.end()) {
        add(name + ": no handler");
        continue;
      }
      const Handler& handler = found->second;
      const std::string wanted = Describe(method.input_type()->full_name(),
                                          method.output_type()->full_name(),
                                          method.server_streaming());
      const std::string given = Describe(
          handler.request->full_name(), handler.response->full_name(), handler.server_streaming);
      if (method.client_streaming()) {
        add(name + ": client streaming is not supported");
      } else if (wanted != given) {
        add(name + ": the handler is " + given + ", the method is " + wanted);
      }
    }
  }
  for (const auto& [name, handler] : handlers_) {
    if (declared.count(name) == 0) {
      add(name + ": a handler, but no service that is served has the method");
    }
  }
  for (const std::string& name : doubled_) {
    add(name + ": two handlers");
  }
  return problems.empty() ? Status() : FailedPreconditionError("cannot serve: " + problems);
}

Status Dispatcher::Start(Transport& transport) {
  LOCI_RETURN_IF_ERROR(impl_->Check());
  impl_->table_->Start(transport);
  const Status status = transport.Start(*this);
  if (!status.ok()) {
    impl_->table_->Detach();
    return status;
  }
  impl_->transport_ = &transport;
  return {};
}

void Dispatcher::Stop(Duration drain) {
  impl_->table_->EndAll();
  if (impl_->transport_ != nullptr) {
    impl_->transport_->Stop(drain);
    impl_->transport_ = nullptr;
  }
  impl_->table_->Detach();
  impl_->table_->StopWorkers();
}

const std::vector<const ServiceDescriptor*>& Dispatcher::services() const {
  return impl_->services_;
}

const RpcCounters& Dispatcher::counters() const {
  return *impl_->counters_;
}

void Dispatcher::OnPeerGone(const PeerId& peer) {
  impl_->table_->DropPeer(peer, "the connection is lost");
}

TimePoint Dispatcher::OnTick(TimePoint now) {
  return impl_->table_->Tick(now);
}

void Dispatcher::OnMessage(const PeerId& peer, std::string envelope_bytes, std::string body) {
  std::optional<v1::Envelope> envelope = ParseEnvelope(envelope_bytes);
  if (!envelope.has_value() || envelope->protocol_version() == 0) {
    impl_->counters_->envelopes_refused++;
    return;
  }
  CallTable& table = *impl_->table_;
  if (!table.HearFrom(peer, impl_->clock_.Now())) {
    impl_->counters_->requests_ignored++;
    return;
  }
  if (envelope->protocol_version() != kProtocolVersion) {
    impl_->counters_->versions_refused++;
    table.SendControl(
        peer,
        EndEnvelope(envelope->call_id(),
                    FailedPreconditionError("protocol_version " +
                                            std::to_string(envelope->protocol_version()) +
                                            ": this server speaks version " +
                                            std::to_string(kProtocolVersion) + " only")));
    return;
  }
  switch (envelope->kind()) {
    case v1::FRAME_KIND_REQUEST:
      impl_->BeginCall(peer, *envelope, std::move(body));
      return;
    case v1::FRAME_KIND_CANCEL:
      table.Cancel(peer, envelope->call_id());
      return;
    case v1::FRAME_KIND_PING:
      table.SendControl(peer, PongEnvelope(envelope->call_id()));
      return;
    case v1::FRAME_KIND_PONG:
      return;
    default:
      impl_->counters_->envelopes_refused++;
  }
}

void Dispatcher::Impl::BeginCall(const PeerId& peer, v1::Envelope& envelope, std::string body) {
  const std::uint64_t call_id = envelope.call_id();
  const auto refuse = [&](MethodCounters& counters, const Status& status) {
    counters.calls[static_cast<std::size_t>(status.code())]++;
    table_->SendControl(peer, EndEnvelope(call_id, status));
  };
  const auto found = handlers_.find(envelope.method());
  if (found == handlers_.end()) {
    refuse(counters_->unknown_method,
           UnimplementedError("method \"" + envelope.method() +
                              "\": this server has none of that name; loci.v1.Reflection/"
                              "GetDescriptors lists those that it has"));
    return;
  }
  MethodCounters& counters = counters_->methods.find(envelope.method())->second;
  const std::size_t size_max = table_->options().message_max_bytes;
  if (body.size() > size_max) {
    refuse(counters,
           ResourceExhaustedError(envelope.method() + ": the request has " +
                                  std::to_string(body.size()) + " bytes; at most " +
                                  std::to_string(size_max) + " are allowed"));
    return;
  }
  const TimePoint now = clock_.Now();
  ServerCall::Request request;
  request.peer = peer;
  request.call_id = call_id;
  request.method = envelope.method();
  request.metadata.insert(envelope.metadata().begin(), envelope.metadata().end());
  request.deadline = Deadline::FromTimeout(envelope.timeout_us(), now);
  request.size_bytes = body.size();
  request.arrival = now;
  StatusOr<std::shared_ptr<ServerCall>> call = table_->Begin(std::move(request), counters);
  if (!call.ok()) {
    if (call.status().code() == StatusCode::kAlreadyExists) {
      counters_->requests_repeated++;
    } else {
      refuse(counters, call.status());
    }
    return;
  }
  const Handler& handler = found->second;
  if (handler.execution == Execution::kInline) {
    Run(handler, *call, std::move(body));
    return;
  }
  table_->Post(peer,
               handler.execution == Execution::kOrdered,
               [this, &handler, call = *call, body = std::move(body)]() mutable {
                 Run(handler, call, std::move(body));
               });
}

void Dispatcher::Impl::Run(const Handler& handler,
                           const std::shared_ptr<ServerCall>& call,
                           std::string body) {
  if (call->over()) {
    return;
  }
  // A handler is ours, but what it calls may throw; one bad request must not end the server.
  try {
    handler.invoke(call, std::move(body));
  } catch (const std::bad_alloc&) {
    call->Finish(ResourceExhaustedError(call->method() + ": the server is out of memory"));
  } catch (const std::exception& error) {
    call->Finish(InternalError(call->method() + ": " + error.what()));
  }
}

bool Dispatcher::ParseRequest(ServerCall& call,
                              const std::string& body,
                              google::protobuf::Message& request) {
  const Status status =
      CheckWire(body, *request.GetDescriptor(), impl_->table_->options().wire_limits);
  if (!status.ok()) {
    call.Finish(status);
    return false;
  }
  if (!request.ParseFromString(body)) {
    call.Finish(InvalidArgumentError("the request is no " + request.GetTypeName() +
                                     ": a text in it may not be UTF-8"));
    return false;
  }
  return true;
}

}  // namespace loci
