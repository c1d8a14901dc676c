// SPDX-License-Identifier: Apache-2.0
// A disk that fills up while a robot streams, and gets room again.
#include <csignal>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cpp/channel.h"
#include "loci/v1/map_admin.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/observation_messages.h"
#include "tests/support/room_drive.h"
#include "tests/support/scarce_room.h"
#include "tests/support/server_process.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

class DiskFullTest : public testing::TestWithParam<Shortage> {
 protected:
  template <typename Response>
  StatusOr<Response> Call(const std::string& method, const google::protobuf::MessageLite& request) {
    return channel_->Call<Response>("loci.v1." + method, request);
  }
  StatusOr<v1::AppendBatchResponse> Append(std::size_t begin, std::size_t end) {
    return Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                         BatchOf("hall", "run", drive_, begin, end));
  }
  void CreateAndOpen(const std::string& endpoint) {
    channel_ = client::Channel::Create(endpoint);
    v1::CreateMapRequest map;
    map.set_map("hall");
    ASSERT_THAT(Call<v1::CreateMapResponse>("MapAdmin/CreateMap", map), IsOk());
    v1::OpenSessionRequest session;
    session.set_map("hall");
    session.set_session("run");
    session.set_robot("robot");
    ASSERT_THAT(Call<v1::SessionState>("Mapping/OpenSession", session), IsOk());
  }
  std::string CloseForDigest() {
    v1::CloseSessionRequest close;
    close.set_map("hall");
    close.set_session("run");
    EXPECT_THAT(Call<v1::SessionState>("Mapping/CloseSession", close), IsOk());
    v1::GetMapInfoRequest info;
    info.set_map("hall");
    const auto answer = Call<v1::MapInfo>("MapAdmin/GetMapInfo", info);
    EXPECT_THAT(answer, IsOk());
    return answer.ok() ? answer->state_digest() : "";
  }

  const std::vector<ObservationEvent> drive_ = RoomDrive(4000);
  std::shared_ptr<client::Channel> channel_;
};

TEST_P(DiskFullTest, TheClientIsToldNothingIsLostAndTheServerGoesOnWhenThereIsRoom) {
  constexpr std::size_t kBatch = 50;
  ScarceRoom room(GetParam());
  if (!room.possible()) {
    GTEST_SKIP() << "mounting a tmpfs is not allowed here";
  }
  ServerProcess server(LOCI_LOCID, room.maps());
  CreateAndOpen(server.endpoint());
  room.RunOut(server, std::size_t{400} << 10U);
  std::size_t durable = 0;
  Status refusal;
  while (refusal.ok() && durable < drive_.size()) {
    const auto response = Append(durable, durable + kBatch);
    if (response.ok()) {
      durable = response->last_durable_number();
    } else {
      refusal = response.status();
    }
  }
  ASSERT_THAT(refusal, IsStatus(StatusCode::kResourceExhausted, "hall"));
  ASSERT_GT(durable, 0U);
  // It lives, answers reads, and refuses again.
  v1::GetSessionRequest session;
  session.set_map("hall");
  session.set_session("run");
  const auto state = Call<v1::SessionState>("Mapping/GetSession", session);
  ASSERT_THAT(state, IsOk());
  EXPECT_EQ(state->last_durable_number(), durable);
  EXPECT_THAT(Append(durable, durable + kBatch), IsStatus(StatusCode::kResourceExhausted));
  room.ComeBack(server);
  const std::size_t end = durable + 4 * kBatch;
  for (; durable < end; durable += kBatch) {
    ASSERT_THAT(Append(durable, durable + kBatch), IsOk());
  }
  const std::string digest = CloseForDigest();
  EXPECT_EQ(server.End(SIGTERM), 0);

  const TemporaryDirectory roomy;
  ServerProcess undisturbed(LOCI_LOCID, roomy.path());
  CreateAndOpen(undisturbed.endpoint());
  for (std::size_t begin = 0; begin < end; begin += kBatch) {
    ASSERT_THAT(Append(begin, begin + kBatch), IsOk());
  }
  EXPECT_EQ(CloseForDigest(), digest);
}

INSTANTIATE_TEST_SUITE_P(Shortages,
                         DiskFullTest,
                         testing::Values(Shortage::kFileSystem, Shortage::kFileSize),
                         ShortageName);

}  // namespace
}  // namespace loci
