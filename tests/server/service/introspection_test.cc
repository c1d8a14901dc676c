// SPDX-License-Identifier: Apache-2.0
// A server that tells of itself: health, reflection, and `loci call` on top of them.
#include <memory>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include "clients/cli/call_command.h"
#include "server/service/health_service.h"
#include "server/service/reflection_service.h"
#include "server/transport/memory_transport.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_link.h"

namespace loci {
namespace {

using Check = v1::HealthCheckResponse;
using cli::CallArguments;

class IntrospectionTest : public testing::Test {
 protected:
  IntrospectionTest() {
    health_.Register(dispatcher_);
    RegisterReflection(dispatcher_);
    EXPECT_THAT(dispatcher_.Start(transport_), IsOk());
    client::ChannelOptions options;
    options.link_factory = [this](const std::string&) {
      return std::make_unique<MemoryLink>([this] { return transport_.Connect(); });
    };
    channel_ = client::Channel::Create("memory", options);
  }
  ~IntrospectionTest() override {
    channel_.reset();
    dispatcher_.Stop();
  }

  StatusOr<Check> Health(const std::string& service) {
    v1::HealthCheckRequest request;
    request.set_service(service);
    return channel_->Call<Check>("loci.v1.Health/Check", request);
  }
  // What `loci call` prints, or how it fails.
  StatusOr<std::string> Call(const std::string& method, const std::string& json = "{}") {
    CallArguments arguments;
    arguments.method = method;
    arguments.json = json;
    arguments.compact = true;
    std::ostringstream out;
    LOCI_RETURN_IF_ERROR(cli::RunCall(*channel_, arguments, out));
    return out.str();
  }

  const SteadyClock clock_;
  HealthService health_;
  MemoryTransport transport_{{}, clock_};
  Dispatcher dispatcher_{{}, clock_};
  std::shared_ptr<client::Channel> channel_;
};

TEST_F(IntrospectionTest, HealthFollowsTheServer) {
  EXPECT_EQ(Health("")->status(), Check::NOT_SERVING);
  health_.SetServing(true);
  EXPECT_EQ(Health("")->status(), Check::SERVING);
  EXPECT_EQ(Health("loci.v1.Reflection")->status(), Check::SERVING);
  EXPECT_THAT(Health("loci.v1.Nothing").status(),
              IsStatus(StatusCode::kNotFound, "loci.v1.Nothing"));
}

TEST_F(IntrospectionTest, HealthIsToldAsItChanges) {
  auto known = channel_->Stream<Check>("loci.v1.Health/Watch", v1::HealthCheckRequest());
  Check response;
  ASSERT_TRUE(known.Next(response));
  EXPECT_EQ(response.status(), Check::NOT_SERVING);
  health_.SetServing(true);
  ASSERT_TRUE(known.Next(response));
  EXPECT_EQ(response.status(), Check::SERVING);
  v1::HealthCheckRequest request;
  request.set_service("loci.v1.Nothing");
  auto unknown = channel_->Stream<Check>("loci.v1.Health/Watch", request);
  ASSERT_TRUE(unknown.Next(response));
  EXPECT_EQ(response.status(), Check::SERVICE_UNKNOWN);
}

TEST_F(IntrospectionTest, DescriptionsBuildInOrder) {
  const auto response = channel_->Call<v1::GetDescriptorsResponse>(
      "loci.v1.Reflection/GetDescriptors", v1::GetDescriptorsRequest());
  ASSERT_THAT(response, IsOk());
  EXPECT_THAT(response->services(), testing::ElementsAre("loci.v1.Health", "loci.v1.Reflection"));
  google::protobuf::DescriptorPool pool;
  for (const auto& file : response->files().file()) {
    EXPECT_NE(pool.BuildFile(file), nullptr) << file.name();
  }
  EXPECT_NE(pool.FindMethodByName("loci.v1.Reflection.GetDescriptors"), nullptr);
}

TEST_F(IntrospectionTest, CallNeedsNoGeneratedCode) {
  health_.SetServing(true);
  const auto answer = Call("loci.v1.Health/Check", R"({"service": "loci.v1.Health"})");
  ASSERT_THAT(answer, IsOk());
  EXPECT_EQ(*answer, "{\"status\":\"SERVING\"}\n");
}

TEST_F(IntrospectionTest, CallListsWhatThereIs) {
  const auto all = Call("");
  ASSERT_THAT(all, IsOk());
  EXPECT_THAT(*all,
              testing::HasSubstr("loci.v1.Health/Watch(loci.v1.HealthCheckRequest) returns "
                                 "(stream loci.v1.HealthCheckResponse)\n"));
  const auto one = Call("loci.v1.Reflection");
  ASSERT_THAT(one, IsOk());
  EXPECT_THAT(*one, testing::Not(testing::HasSubstr("Health")));
}

TEST_F(IntrospectionTest, CallSaysWhatIsWrong) {
  EXPECT_THAT(Call("loci.v1.Helth/Check").status(),
              IsStatus(StatusCode::kNotFound, "loci.v1.Health, loci.v1.Reflection"));
  EXPECT_THAT(Call("loci.v1.Health/Chek").status(),
              IsStatus(StatusCode::kNotFound, "Check, Watch"));
  EXPECT_THAT(Call("loci.v1.Health/Check", "{").status(),
              IsStatus(StatusCode::kInvalidArgument, "loci.v1.HealthCheckRequest"));
  EXPECT_THAT(Call("loci.v1.Health/Check", R"({"servise": ""})").status(),
              IsStatus(StatusCode::kInvalidArgument, "servise"));
  EXPECT_THAT(Call("loci.v1.Health/Check", R"({"service": "x"})").status(),
              IsStatus(StatusCode::kNotFound));
}

}  // namespace
}  // namespace loci
