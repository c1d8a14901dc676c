// SPDX-License-Identifier: Apache-2.0
// What a call promises, over either transport.
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/mapping.pb.h"
#include "server/rpc/frame.h"
#include "tests/support/matchers.h"
#include "tests/support/rpc_server.h"

namespace loci {
namespace {

using client::CallOptions;
using client::Channel;
using std::chrono::milliseconds;
using Request = v1::HealthCheckRequest;
using Response = v1::HealthCheckResponse;
using CallPointer = std::shared_ptr<RpcServer::Call>;

Request Named(std::string name) {
  Request request;
  request.set_service(std::move(name));
  return request;
}

CallOptions Within(milliseconds timeout) {
  CallOptions options;
  options.timeout = timeout;
  return options;
}

// Answers with `count` messages, then ends.
RpcServer::StreamHandler Messages(int count) {
  return [count](const std::shared_ptr<ServerCall>&, const Request&) {
    return StreamSource<Response>(
        [count, sent = std::make_shared<int>(0)](Response& response) -> StatusOr<StreamStep> {
          if (*sent == count) {
            return StreamStep::kEnd;
          }
          ++*sent;
          response.set_status(Response::SERVING);
          return StreamStep::kMessage;
        });
  };
}

// Messages of 64 KiB without end: unknown fields make the size.
StreamSource<Response> BigMessages(std::shared_ptr<std::atomic<int>> sent) {
  return [sent = std::move(sent)](Response& response) -> StatusOr<StreamStep> {
    response.GetReflection()->MutableUnknownFields(&response)->AddLengthDelimited(
        100, std::string(64U << 10U, 'x'));
    ++*sent;
    return StreamStep::kMessage;
  };
}

class CallTest : public testing::TestWithParam<Wire> {};

TEST_P(CallTest, AnswersAUnaryCall) {
  RpcServer server(GetParam());
  const auto response = server.Connect()->Call<Response>(kCheck, Request());
  ASSERT_THAT(response, IsOk());
  EXPECT_EQ(response->status(), Response::SERVING);
}

TEST_P(CallTest, AnswersAtOnceOrLaterFromAnyThread) {
  for (const Execution execution : {Execution::kInline, Execution::kWorker, Execution::kOrdered}) {
    RpcServerOptions options;
    options.execution = execution;
    std::promise<CallPointer> arrived;
    RpcServer server(
        GetParam(), [&](const CallPointer& call) { arrived.set_value(call); }, nullptr, options);
    const auto channel = server.Connect();
    auto answer = channel->CallFuture<Response>(kCheck, Request());
    const CallPointer call = arrived.get_future().get();
    std::thread([&] { RpcServer::Serve(call); }).join();
    EXPECT_THAT(answer.get(), IsOk());
  }
}

TEST_P(CallTest, CarriesEveryStatusCodeWithItsMessage) {
  RpcServer server(GetParam(), [](const CallPointer& call) {
    const auto code = static_cast<StatusCode>(std::stoi(call->request().service()));
    call->Finish(Status(code, "because of \xC3\xA9 and \xFF"));
  });
  const auto channel = server.Connect();
  for (int code = 1; code <= 16; ++code) {
    EXPECT_THAT(channel->Call<Response>(kCheck, Named(std::to_string(code))).status(),
                IsStatus(static_cast<StatusCode>(code), "because of \xC3\xA9 and ?"));
  }
}

TEST_P(CallTest, CarriesMetadataAndTheDeadline) {
  RpcServer server(GetParam(), [](const CallPointer& call) {
    const auto found = call->context().metadata().find("trace");
    EXPECT_FALSE(call->context().deadline().never());
    call->Finish(Status(StatusCode::kAborted,
                        found == call->context().metadata().end() ? "-" : found->second));
  });
  CallOptions options;
  options.metadata["trace"] = "4711";
  EXPECT_THAT(server.Connect()->Call<Response>(kCheck, Request(), options).status(),
              IsStatus(StatusCode::kAborted, "4711"));
}

TEST_P(CallTest, SaysThatAMethodIsUnknown) {
  RpcServer server(GetParam());
  EXPECT_THAT(server.Connect()->Call<Response>("loci.v1.Health/Chekc", Request()).status(),
              IsStatus(StatusCode::kUnimplemented, "Chekc"));
}

TEST_P(CallTest, SaysThatABodyDoesNotParse) {
  RpcServer server(GetParam());
  const auto channel = server.Connect();
  EXPECT_THAT(channel->CallRaw(kCheck, "\x0A\xFF").status(),
              IsStatus(StatusCode::kInvalidArgument, "loci.v1.HealthCheckRequest"));
  EXPECT_THAT(channel->CallRaw(kCheck, std::string("\x0A\x02\xFF\xFE", 4)).status(),
              IsStatus(StatusCode::kInvalidArgument, "UTF-8"));
  EXPECT_THAT(channel->Call<Response>(kCheck, Request()), IsOk());
}

TEST_P(CallTest, RefusesARequestThatIsTooLarge) {
  RpcServerOptions options;
  options.dispatcher.message_max_bytes = 1000;
  RpcServer server(GetParam(), RpcServer::Serve, nullptr, options);
  const auto channel = server.Connect();
  EXPECT_THAT(channel->Call<Response>(kCheck, Named(std::string(1001, 'x'))).status(),
              IsStatus(StatusCode::kResourceExhausted, "at most 1000"));
  EXPECT_THAT(channel->Call<Response>(kCheck, Named(std::string(900, 'x'))), IsOk());
}

TEST_P(CallTest, SaysThatAnAnswerIsTooLarge) {
  RpcServerOptions options;
  options.dispatcher.message_max_bytes = 1000;
  RpcServer server(
      GetParam(),
      [](const CallPointer& call) { call->context().FinishWithBody(std::string(1001, 'x')); },
      nullptr,
      options);
  EXPECT_THAT(server.Connect()->Call<Response>(kCheck, Request()).status(),
              IsStatus(StatusCode::kResourceExhausted, "1001 bytes"));
}

TEST_P(CallTest, EndsACallWhoseHandlerForgetsIt) {
  RpcServer server(GetParam(), [](const CallPointer&) {});
  EXPECT_THAT(server.Connect()->Call<Response>(kCheck, Request()).status(),
              IsStatus(StatusCode::kInternal, "no answer"));
}

TEST_P(CallTest, EndsACallWhoseHandlerThrows) {
  RpcServer server(GetParam(), [](const CallPointer&) { throw std::runtime_error("oh"); });
  EXPECT_THAT(server.Connect()->Call<Response>(kCheck, Request()).status(),
              IsStatus(StatusCode::kInternal));
}

TEST_P(CallTest, TheServerEndsACallAtItsDeadline) {
  std::promise<CallPointer> arrived;
  RpcServer server(GetParam(), [&](const CallPointer& call) { arrived.set_value(call); });
  const auto channel = server.Connect();
  auto answer = channel->CallFuture<Response>(kCheck, Request(), Within(milliseconds(60)));
  const CallPointer call = arrived.get_future().get();
  EXPECT_TRUE(Eventually([&] { return call->over(); }));
  EXPECT_THAT(answer.get().status(), IsStatus(StatusCode::kDeadlineExceeded));
  call->Finish(Response());  // comes too late and harms nobody
  EXPECT_TRUE(Eventually([&] {
    return server.counters(kCheck).calls_with(StatusCode::kDeadlineExceeded) +
               server.counters(kCheck).calls_with(StatusCode::kCancelled) ==
           1;
  }));
}

TEST_P(CallTest, CancellingReachesTheHandler) {
  std::promise<CallPointer> arrived;
  RpcServer server(GetParam(), [&](const CallPointer& call) { arrived.set_value(call); });
  const auto channel = server.Connect();
  std::promise<Status> ended;
  const client::CallHandle handle = channel->CallAsync<Response>(
      kCheck, Request(), CallOptions(), [&](const StatusOr<Response>& response) {
        ended.set_value(response.status());
      });
  const CallPointer call = arrived.get_future().get();
  std::promise<void> over;
  call->context().OnOver([&] { over.set_value(); });
  handle.Cancel();
  EXPECT_THAT(ended.get_future().get(), IsStatus(StatusCode::kCancelled));
  over.get_future().wait();
  EXPECT_TRUE(call->over());
}

TEST_P(CallTest, StreamsInOrderAndEnds) {
  RpcServer server(GetParam(), RpcServer::Serve, Messages(1000));
  Response response;
  int count = 0;
  const auto channel = server.Connect();
  auto whole = channel->Stream<Response>(kWatch, Request());
  for (count = 0; whole.Next(response); ++count) {
  }
  EXPECT_EQ(count, 1000);
  EXPECT_THAT(whole.status(), IsOk());
}

TEST_P(CallTest, AStreamThatOutlivesItsChannelIsCancelled) {
  const auto sent = std::make_shared<std::atomic<int>>(0);
  RpcServer server(
      GetParam(), RpcServer::Serve, [&](const std::shared_ptr<ServerCall>&, const Request&) {
        return BigMessages(sent);
      });
  auto stream = server.Connect()->Stream<Response>(kWatch, Request());
  Response response;
  while (stream.Next(response)) {
  }
  EXPECT_THAT(stream.status(), IsStatus(StatusCode::kCancelled));
}

TEST_P(CallTest, AStreamMayFailAtItsBeginningOrLater) {
  RpcServer server(GetParam(),
                   RpcServer::Serve,
                   [](const std::shared_ptr<ServerCall>&,
                      const Request& request) -> StatusOr<StreamSource<Response>> {
                     if (request.service() == "now") {
                       return NotFoundError("nothing");
                     }
                     return StreamSource<Response>(
                         [left = std::make_shared<int>(3)](Response&) -> StatusOr<StreamStep> {
                           if ((*left)-- == 0) {
                             return DataLossError("broken");
                           }
                           return StreamStep::kMessage;
                         });
                   });
  const auto channel = server.Connect();
  Response response;
  auto none = channel->Stream<Response>(kWatch, Named("now"));
  EXPECT_FALSE(none.Next(response));
  EXPECT_THAT(none.status(), IsStatus(StatusCode::kNotFound, "nothing"));
  auto some = channel->Stream<Response>(kWatch, Request());
  int count = 0;
  while (some.Next(response)) {
    ++count;
  }
  EXPECT_EQ(count, 3);
  EXPECT_THAT(some.status(), IsStatus(StatusCode::kDataLoss, "broken"));
}

TEST_P(CallTest, AWaitingStreamGoesOnWhenItIsWoken) {
  std::atomic<int> available{0};
  std::promise<std::shared_ptr<ServerCall>> arrived;
  RpcServer server(
      GetParam(), RpcServer::Serve, [&](const std::shared_ptr<ServerCall>& call, const Request&) {
        arrived.set_value(call);
        return StreamSource<Response>(
            [&, sent = std::make_shared<int>(0)](Response&) -> StatusOr<StreamStep> {
              if (*sent == available.load()) {
                return StreamStep::kWait;
              }
              ++*sent;
              return StreamStep::kMessage;
            });
      });
  const auto channel = server.Connect();
  auto stream = channel->Stream<Response>(kWatch, Request());
  const auto call = arrived.get_future().get();
  Response response;
  for (int i = 1; i <= 100; ++i) {
    available = i;
    call->Wake();
    ASSERT_TRUE(stream.Next(response));
  }
  EXPECT_EQ(stream.Next(response, milliseconds(1)), client::RawStream::NextResult::kTimedOut);
  stream.Cancel();
  EXPECT_TRUE(Eventually([&] { return call->over(); }));
}

TEST_P(CallTest, ASlowReaderHoldsUpItsOwnStreamOnly) {
  const auto sent = std::make_shared<std::atomic<int>>(0);
  RpcServerOptions options;
  options.dispatcher.worker_count = 1;
  RpcServer server(
      GetParam(),
      RpcServer::Serve,
      [&](const std::shared_ptr<ServerCall>&, const Request&) { return BigMessages(sent); },
      options);
  client::ChannelOptions small;
  small.stream_pause_bytes = 256U << 10U;
  const auto slow = server.Connect(small);
  auto stream = slow->Stream<Response>(kWatch, Request());
  Response response;
  ASSERT_TRUE(stream.Next(response));
  // It comes to rest although nobody ends it, and the only worker serves the others meanwhile.
  const auto other = server.Connect();
  EXPECT_TRUE(Eventually([&] {
    const int before = *sent;
    for (int i = 0; i < 20; ++i) {
      EXPECT_THAT(other->Call<Response>(kCheck, Request()), IsOk());
    }
    return *sent == before;
  }));
  EXPECT_LT(server.transport().counters().bytes_unsent.load(), 4U << 20U);
  // And goes on when it is read.
  const int at_rest = *sent;
  EXPECT_TRUE(Eventually([&] { return stream.Next(response) && *sent > at_rest; }));
}

TEST_P(CallTest, AReaderFarBehindIsCutOff) {
  CallPointer kept;
  const auto sent = std::make_shared<std::atomic<int>>(0);
  RpcServer server(
      GetParam(),
      // Not answered, so that the channel must go on reading.
      [&](const CallPointer& call) { kept = call; },
      [&](const std::shared_ptr<ServerCall>&, const Request&) { return BigMessages(sent); });
  client::ChannelOptions small;
  small.stream_pause_bytes = 256U << 10U;
  small.stream_unread_max_bytes = 1U << 20U;
  const auto channel = server.Connect(small);
  auto open = channel->CallFuture<Response>(kCheck, Request(), Within(milliseconds(20'000)));
  auto stream = channel->Stream<Response>(kWatch, Request());
  EXPECT_TRUE(Eventually([&] { return !stream.status().ok(); }));
  EXPECT_THAT(stream.status(), IsStatus(StatusCode::kResourceExhausted, "behind"));
}

TEST_P(CallTest, TheLossOfAPeerEndsItsCalls) {
  std::promise<CallPointer> arrived;
  RpcServerOptions options;
  options.dispatcher.ping_after = milliseconds(20);
  options.dispatcher.gone_after = milliseconds(20'000);
  RpcServer server(
      GetParam(), [&](const CallPointer& call) { arrived.set_value(call); }, nullptr, options);
  auto channel = server.Connect();
  auto answer = channel->CallFuture<Response>(kCheck, Request());
  const CallPointer call = arrived.get_future().get();
  channel.reset();
  EXPECT_TRUE(Eventually([&] { return call->over(); }));
  EXPECT_THAT(answer.get().status(), IsStatus(StatusCode::kCancelled));
}

TEST_P(CallTest, TooManyCallsOfAPeerAreRefused) {
  std::mutex mutex;
  std::vector<CallPointer> calls;
  RpcServerOptions options;
  options.dispatcher.calls_per_peer_max = 4;
  RpcServer server(
      GetParam(),
      [&](const CallPointer& call) {
        const std::lock_guard lock(mutex);
        calls.push_back(call);
      },
      nullptr,
      options);
  const auto channel = server.Connect();
  std::vector<std::future<StatusOr<Response>>> answers;
  for (int i = 0; i < 5; ++i) {
    answers.push_back(channel->CallFuture<Response>(kCheck, Request()));
  }
  EXPECT_THAT(answers.back().get().status(),
              IsStatus(StatusCode::kResourceExhausted, "limit of 4"));
  EXPECT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return calls.size() == 4;
  }));
  for (const CallPointer& call : calls) {
    RpcServer::Serve(call);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_THAT(answers[i].get(), IsOk());
  }
}

TEST_P(CallTest, OrderedCallsOfAPeerKeepTheirOrder) {
  std::mutex mutex;
  std::vector<std::string> order;
  RpcServerOptions options;
  options.execution = Execution::kOrdered;
  options.dispatcher.worker_count = 4;
  RpcServer server(
      GetParam(),
      [&](const CallPointer& call) {
        {
          const std::lock_guard lock(mutex);
          order.push_back(call->request().service());
        }
        RpcServer::Serve(call);
      },
      nullptr,
      options);
  const auto channel = server.Connect();
  std::vector<std::future<StatusOr<Response>>> answers;
  std::vector<std::string> expected;
  for (int i = 0; i < 200; ++i) {
    expected.push_back(std::to_string(i));
    answers.push_back(channel->CallFuture<Response>(kCheck, Named(expected.back())));
  }
  for (auto& answer : answers) {
    EXPECT_THAT(answer.get(), IsOk());
  }
  EXPECT_EQ(order, expected);
}

TEST_P(CallTest, StoppingTheServerEndsCallsWithUnavailable) {
  std::promise<CallPointer> arrived;
  RpcServer server(GetParam(), [&](const CallPointer& call) { arrived.set_value(call); });
  const auto channel = server.Connect();
  auto answer = channel->CallFuture<Response>(kCheck, Request());
  const CallPointer call = arrived.get_future().get();
  server.dispatcher().Stop();
  // On a real wire the loss of the connection may overtake the answer.
  EXPECT_THAT(answer.get().status(),
              IsStatus(StatusCode::kUnavailable, GetParam() == Wire::kZmq ? "" : "stopping"));
  call->Finish(Response());  // after the end of the dispatcher's work
  EXPECT_THAT(channel->Call<Response>(kCheck, Request()).status(),
              IsStatus(StatusCode::kUnavailable, channel->endpoint()));
  // Once the loss is noticed, the message says what to do.
  EXPECT_TRUE(Eventually([&] {
    const Status status = channel->Call<Response>(kCheck, Request()).status();
    return status.message().find("is locid running there?") != std::string::npos;
  }));
}

TEST_P(CallTest, CountsCallsByMethodAndCode) {
  RpcServer server(GetParam());
  const auto channel = server.Connect();
  EXPECT_THAT(channel->Call<Response>(kCheck, Request()), IsOk());
  EXPECT_THAT(channel->CallRaw(kCheck, "\x0A\xFF").status(), testing::Not(IsOk()));
  EXPECT_TRUE(Eventually([&] {
    return server.counters(kCheck).calls_with(StatusCode::kOk) == 1 &&
           server.counters(kCheck).calls_with(StatusCode::kInvalidArgument) == 1 &&
           server.dispatcher().counters().calls_in_flight == 0;
  }));
}

TEST_P(CallTest, ManyClientsAtOnceAllGetTheirAnswers) {
  RpcServer server(GetParam(), RpcServer::Serve, Messages(10));
  std::vector<std::thread> clients;
  std::atomic<int> good{0};
  for (int i = 0; i < 8; ++i) {
    clients.emplace_back([&] {
      const auto channel = server.Connect();
      for (int j = 0; j < 20; ++j) {
        good += channel->Call<Response>(kCheck, Request()).ok() ? 1 : 0;
        auto stream = channel->Stream<Response>(kWatch, Request());
        Response response;
        while (stream.Next(response)) {
        }
        good += stream.status().ok() ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : clients) {
    thread.join();
  }
  EXPECT_EQ(good, 8 * 20 * 2);
}

#ifdef LOCI_TEST_WITHOUT_ZMQ
INSTANTIATE_TEST_SUITE_P(Wires, CallTest, testing::Values(Wire::kMemory), WireName);
#else
INSTANTIATE_TEST_SUITE_P(Wires, CallTest, testing::Values(Wire::kMemory, Wire::kZmq), WireName);
#endif

}  // namespace
}  // namespace loci
