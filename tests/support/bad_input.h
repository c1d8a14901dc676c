// SPDX-License-Identifier: Apache-2.0
// Tests of bad input over the wire: requests that are wrong, and what each must be answered.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "loci/v1/map_query.pb.h"
#include "loci/v1/watch.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/observation_messages.h"
#include "tests/support/room_drive.h"
#include "tests/support/test_server.h"

namespace loci {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// One wrong request: what it must be answered.
struct Case {
  std::string name;
  std::function<Status(TestServer&)> call;
  StatusCode code;
  std::string part_of_message;
};

// A batch of three good observations, of which `change` spoils the second.
inline Case WrongObservation(std::string name,
                             std::function<void(v1::Observation&)> change,
                             std::string part_of_message) {
  return {std::move(name),
          [change = std::move(change)](TestServer& server) {
            v1::AppendBatchRequest request = BatchOf("hall", "s", RoomDrive(13), 10, 13);
            change(*request.mutable_observations(1));
            return server.Call<v1::AppendBatchResponse>("Mapping/AppendBatch", request).status();
          },
          StatusCode::kInvalidArgument,
          "observations[1]." + std::move(part_of_message)};
}

template <typename Request, typename Response>
Case WrongCall(std::string name,
               std::string method,
               std::function<void(Request&)> fill,
               StatusCode code,
               std::string part_of_message) {
  return {std::move(name),
          [method = std::move(method), fill = std::move(fill)](TestServer& server) {
            Request request;
            fill(request);
            return server.Call<Response>(method, request).status();
          },
          code,
          std::move(part_of_message)};
}

template <typename Request, typename Response>
Case WrongStream(std::string name,
                 std::string method,
                 std::function<void(Request&)> fill,
                 StatusCode code,
                 std::string part_of_message) {
  return {std::move(name),
          [method = std::move(method), fill = std::move(fill)](TestServer& server) {
            Request request;
            fill(request);
            auto stream = server.channel().Stream<Response>("loci.v1." + method, request);
            Response response;
            while (stream.Next(response)) {
            }
            return stream.status();
          },
          code,
          std::move(part_of_message)};
}

inline Case WrongTile(std::string name,
                      std::function<void(v1::GetTileRequest&)> change,
                      StatusCode code,
                      std::string part_of_message) {
  return WrongCall<v1::GetTileRequest, v1::Tile>(
      std::move(name),
      "MapQuery/GetTile",
      [change = std::move(change)](v1::GetTileRequest& request) {
        request.set_map("hall");
        request.set_layer("occupancy");
        request.set_zoom(8);
        change(request);
      },
      code,
      std::move(part_of_message));
}

class BadInputTest : public testing::Test {
 protected:
  // A map with a closed session of two observations, and an open one of ten.
  void SetUp() override {
    ASSERT_THAT(server_.CreateMap("hall"), IsOk());
    ASSERT_THAT(server_.OpenSession("hall", "done"), IsOk());
    ASSERT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                      BatchOf("hall", "done", RoomDrive(2), 0, 2)),
                IsOk());
    v1::CloseSessionRequest close;
    close.set_map("hall");
    close.set_session("done");
    ASSERT_THAT(server_.Call<v1::SessionState>("Mapping/CloseSession", close), IsOk());
    ASSERT_THAT(server_.OpenSession("hall", "s"), IsOk());
    ASSERT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                      BatchOf("hall", "s", RoomDrive(10), 0, 10)),
                IsOk());
  }

  std::string Digest() {
    const StatusOr<v1::MapInfo> info = server_.Info("hall");
    EXPECT_THAT(info, IsOk());
    return info.ok() ? info->state_digest() : "";
  }

  void CheckAll(const std::vector<Case>& cases) {
    const std::string digest = Digest();
    for (const Case& a_case : cases) {
      SCOPED_TRACE(a_case.name);
      EXPECT_THAT(a_case.call(server_), IsStatus(a_case.code, a_case.part_of_message));
      ASSERT_EQ(Digest(), digest);
    }
    ExpectServes();
  }

  // The next observations are taken.
  void ExpectServes() {
    EXPECT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                      BatchOf("hall", "s", RoomDrive(20), 10, 20)),
                IsOk());
  }

  TestServer server_;
};

}  // namespace loci
