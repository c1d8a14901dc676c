// SPDX-License-Identifier: Apache-2.0
// A server of the Health service whose handlers a test gives, over either transport.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "clients/cpp/channel.h"
#include "loci/v1/health.pb.h"
#include "server/base/clock.h"
#include "server/rpc/dispatcher.h"
#include "server/transport/memory_transport.h"
#include "server/transport/zmq_transport.h"
#include "tests/support/memory_link.h"

namespace loci {

inline constexpr const char* kCheck = "loci.v1.Health/Check";
inline constexpr const char* kWatch = "loci.v1.Health/Watch";

enum class Wire { kMemory, kZmq };

inline std::string WireName(const ::testing::TestParamInfo<Wire>& wire) {
  return wire.param == Wire::kMemory ? "Memory" : "Zmq";
}

struct RpcServerOptions {
  DispatcherOptions dispatcher;
  MemoryTransportOptions memory;
  ZmqTransportOptions zmq;
  Execution execution = Execution::kWorker;
};

class RpcServer {
 public:
  using Call = UnaryCall<v1::HealthCheckRequest, v1::HealthCheckResponse>;
  using UnaryHandler = std::function<void(std::shared_ptr<Call> call)>;
  using StreamHandler = std::function<StatusOr<StreamSource<v1::HealthCheckResponse>>(
      const std::shared_ptr<ServerCall>& call, const v1::HealthCheckRequest& request)>;

  // The answer of a unary call that has no handler of its own.
  static void Serve(const std::shared_ptr<Call>& call) {
    v1::HealthCheckResponse response;
    response.set_status(v1::HealthCheckResponse::SERVING);
    call->Finish(response);
  }

  explicit RpcServer(Wire wire,
                     UnaryHandler unary = Serve,
                     StreamHandler stream = nullptr,
                     RpcServerOptions options = {})
      : wire_(wire), options_(std::move(options)) {
    options_.zmq.endpoint = "tcp://127.0.0.1:0";
    dispatcher_.emplace(options_.dispatcher, clock_);
    dispatcher_->AddService("loci.v1.Health");
    dispatcher_->AddAsyncUnary<v1::HealthCheckRequest, v1::HealthCheckResponse>(
        kCheck, options_.execution, std::move(unary));
    dispatcher_->AddServerStream<v1::HealthCheckRequest, v1::HealthCheckResponse>(
        kWatch,
        options_.execution,
        [stream = std::move(stream)](const std::shared_ptr<ServerCall>& call,
                                     const v1::HealthCheckRequest& request)
            -> StatusOr<StreamSource<v1::HealthCheckResponse>> {
          if (stream == nullptr) {
            return UnimplementedError("this test has no stream");
          }
          return stream(call, request);
        });
    if (wire_ == Wire::kZmq) {
      auto transport = ZmqTransport::Listen(options_.zmq);
      LOCI_CHECK(transport.ok());
      transport_ = std::move(transport).value();
    } else {
      auto memory = std::make_unique<MemoryTransport>(options_.memory, clock_);
      memory_ = memory.get();
      transport_ = std::move(memory);
    }
    LOCI_CHECK(dispatcher_->Start(*transport_).ok());
  }
  ~RpcServer() { dispatcher_->Stop(); }

  std::shared_ptr<client::Channel> Connect(client::ChannelOptions options = {}) {
    if (memory_ != nullptr) {
      options.link_factory = [this](const std::string&) {
        return std::make_unique<MemoryLink>([this] { return memory_->Connect(); });
      };
    }
    return client::Channel::Create(transport_->endpoint(), std::move(options));
  }

  Dispatcher& dispatcher() { return *dispatcher_; }
  Transport& transport() { return *transport_; }
  MemoryTransport& memory() { return *memory_; }
  const MethodCounters& counters(const char* method) {
    return dispatcher_->counters().methods.find(method)->second;
  }

 private:
  const Wire wire_;
  const SteadyClock clock_;
  RpcServerOptions options_;
  std::unique_ptr<Transport> transport_;
  MemoryTransport* memory_ = nullptr;
  std::optional<Dispatcher> dispatcher_;
};

// Waits for a condition that other threads bring about.
inline bool Eventually(const std::function<bool()>& condition,
                       std::chrono::seconds limit = std::chrono::seconds(20)) {
  const auto until = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) {
      return false;
    }
    std::this_thread::yield();
  }
  return true;
}

}  // namespace loci
