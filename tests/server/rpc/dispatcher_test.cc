// SPDX-License-Identifier: Apache-2.0
// A server starts only with a handler of the right kind for every method.
#include "server/rpc/dispatcher.h"

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/health.pb.h"
#include "loci/v1/reflection.pb.h"
#include "server/transport/memory_transport.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

using Request = v1::HealthCheckRequest;
using Response = v1::HealthCheckResponse;

StatusOr<Response> Answer(ServerCall& /*call*/, const Request& /*request*/) {
  return Response();
}

StatusOr<StreamSource<Response>> Stream(const std::shared_ptr<ServerCall>& /*call*/,
                                        const Request& /*request*/) {
  return StreamSource<Response>([](Response&) -> StatusOr<StreamStep> { return StreamStep::kEnd; });
}

class DispatcherTest : public testing::Test {
 protected:
  Status Start() { return dispatcher_.Start(transport_); }

  SteadyClock clock_;
  MemoryTransport transport_{{}, clock_};
  Dispatcher dispatcher_{{}, clock_};
};

TEST_F(DispatcherTest, StartsWhenEveryMethodHasItsHandler) {
  dispatcher_.AddService("loci.v1.Health");
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  dispatcher_.AddServerStream<Request, Response>(
      "loci.v1.Health/Watch", Execution::kInline, Stream);
  EXPECT_THAT(Start(), IsOk());
}

TEST_F(DispatcherTest, NamesTheMethodWithoutAHandler) {
  dispatcher_.AddService("loci.v1.Health");
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  EXPECT_THAT(Start(),
              IsStatus(StatusCode::kFailedPrecondition, "loci.v1.Health/Watch: no handler"));
}

TEST_F(DispatcherTest, NamesTheHandlerOfAnotherKind) {
  dispatcher_.AddService("loci.v1.Health");
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Watch", Execution::kInline, Answer);
  EXPECT_THAT(Start(),
              IsStatus(StatusCode::kFailedPrecondition,
                       "loci.v1.Health/Watch: the handler is (loci.v1.HealthCheckRequest) returns "
                       "(loci.v1.HealthCheckResponse), the method is (loci.v1.HealthCheckRequest) "
                       "returns (stream loci.v1.HealthCheckResponse)"));
}

TEST_F(DispatcherTest, NamesTheHandlerOfAnotherType) {
  dispatcher_.AddService("loci.v1.Health");
  dispatcher_.AddUnary<v1::GetDescriptorsRequest, Response>(
      "loci.v1.Health/Check",
      Execution::kInline,
      [](ServerCall&, const v1::GetDescriptorsRequest&) -> StatusOr<Response> {
        return Response();
      });
  dispatcher_.AddServerStream<Request, Response>(
      "loci.v1.Health/Watch", Execution::kInline, Stream);
  EXPECT_THAT(
      Start(),
      IsStatus(StatusCode::kFailedPrecondition, "the handler is (loci.v1.GetDescriptorsRequest)"));
}

TEST_F(DispatcherTest, NamesHandlersThatServeNothing) {
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  EXPECT_THAT(Start(), IsStatus(StatusCode::kFailedPrecondition, "no service that is served"));
}

TEST_F(DispatcherTest, NamesMethodsWithTwoHandlersAndUnknownServices) {
  dispatcher_.AddService("loci.v1.Nothing");
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  dispatcher_.AddUnary<Request, Response>("loci.v1.Health/Check", Execution::kInline, Answer);
  const Status status = Start();
  EXPECT_THAT(status,
              IsStatus(StatusCode::kFailedPrecondition, "loci.v1.Health/Check: two handlers"));
  EXPECT_THAT(status, IsStatus(StatusCode::kFailedPrecondition, "loci.v1.Nothing"));
}

}  // namespace
}  // namespace loci
