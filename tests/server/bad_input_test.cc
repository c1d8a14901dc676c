// SPDX-License-Identifier: Apache-2.0
// Bad input over the wire: a status that names the field, no change, and a server that goes on.
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/map_query.pb.h"
#include "loci/v1/watch.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/observation_messages.h"
#include "tests/support/room_drive.h"
#include "tests/support/test_server.h"

namespace loci {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::string kLongName(65, 'a');

// One wrong request: what it must be answered.
struct Case {
  std::string name;
  std::function<Status(TestServer&)> call;
  StatusCode code;
  std::string part_of_message;
};

// A batch of three good observations, of which `change` spoils the second.
Case WrongObservation(std::string name,
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

Case WrongTile(std::string name,
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

std::vector<Case> WrongNumbers() {
  using v1::Observation;
  std::vector<Case> cases;
  for (const double number : {kNan, kInfinity, -kInfinity, 1e300}) {
    const std::string text = std::isnan(number) ? "NaN" : std::to_string(number).substr(0, 5);
    cases.push_back(WrongObservation(
        "odometry x " + text,
        [number](Observation& o) {
          o.mutable_odometry()->mutable_previous_from_robot()->set_x(number);
        },
        "odometry.previous_from_robot.x"));
    cases.push_back(WrongObservation(
        "covariance " + text,
        [number](Observation& o) { o.mutable_odometry()->set_covariance(3, number); },
        "odometry.covariance"));
    cases.push_back(WrongObservation(
        "laser pose " + text,
        [number](Observation& o) { o.mutable_scan()->mutable_robot_from_laser()->set_y(number); },
        "scan.robot_from_laser.y"));
    cases.push_back(WrongObservation(
        "angle_min " + text,
        [number](Observation& o) { o.mutable_scan()->set_angle_min_rad(number); },
        "scan.angle_min_rad"));
    cases.push_back(WrongObservation(
        "angle_step " + text,
        [number](Observation& o) { o.mutable_scan()->set_angle_step_rad(number); },
        "scan.angle_step_rad"));
  }
  for (const double number : {kNan, kInfinity}) {
    cases.push_back(WrongObservation(
        "odometry theta",
        [number](Observation& o) {
          o.mutable_odometry()->mutable_previous_from_robot()->set_theta(number);
        },
        "odometry.previous_from_robot.theta"));
  }
  return cases;
}

std::vector<Case> WrongShapes() {
  using v1::Observation;
  return {
      WrongObservation(
          "covariance not positive definite",
          [](Observation& o) { o.mutable_odometry()->set_covariance(0, -1e-4); },
          "odometry.covariance: eigenvalue"),
      WrongObservation(
          "covariance not symmetric positive definite by its off-diagonal",
          [](Observation& o) { o.mutable_odometry()->set_covariance(1, 1.0); },
          "odometry.covariance: eigenvalue"),
      WrongObservation(
          "covariance zero",
          [](Observation& o) {
            for (int i = 0; i < 6; ++i) {
              o.mutable_odometry()->set_covariance(i, 0.0);
            }
          },
          "odometry.covariance: eigenvalue"),
      WrongObservation(
          "covariance of five numbers",
          [](Observation& o) { o.mutable_odometry()->mutable_covariance()->RemoveLast(); },
          "odometry.covariance: 5 numbers, must be the 6"),
      WrongObservation(
          "odometry without motion",
          [](Observation& o) { o.mutable_odometry()->clear_previous_from_robot(); },
          "odometry.previous_from_robot: absent"),
      WrongObservation(
          "no beams",
          [](Observation& o) { o.mutable_scan()->clear_ranges_mm(); },
          "scan.ranges_mm: 0 beams"),
      WrongObservation(
          "too many beams",
          [](Observation& o) {
            o.mutable_scan()->set_angle_step_rad(1e-5);
            o.mutable_scan()->mutable_ranges_mm()->Resize(4097, 1000);
          },
          "scan.ranges_mm: 4097 beams"),
      WrongObservation(
          "range beyond 16 bits",
          [](Observation& o) { o.mutable_scan()->set_ranges_mm(7, 65536); },
          "scan.ranges_mm[7]: 65536, must be at most 65535"),
      WrongObservation(
          "beams that do not turn",
          [](Observation& o) { o.mutable_scan()->set_angle_step_rad(0.0); },
          "scan.angle_step_rad"),
      WrongObservation(
          "beams that turn backwards",
          [](Observation& o) { o.mutable_scan()->set_angle_step_rad(-0.01); },
          "scan.angle_step_rad"),
      WrongObservation(
          "more than one turn",
          [](Observation& o) { o.mutable_scan()->set_angle_step_rad(0.2); },
          "scan.angle_step_rad"),
      WrongObservation(
          "negative stamp", [](Observation& o) { o.set_stamp_ns(-1); }, "stamp_ns: -1"),
  };
}

std::vector<Case> WrongNames() {
  std::vector<Case> cases;
  for (const std::string& name : {std::string(),
                                  std::string("Hall"),
                                  std::string("../hall"),
                                  std::string("a b"),
                                  std::string("a\0b", 3),
                                  kLongName}) {
    cases.push_back(WrongCall<v1::CreateMapRequest, v1::CreateMapResponse>(
        "create map named " + name,
        "MapAdmin/CreateMap",
        [name](v1::CreateMapRequest& r) { r.set_map(name); },
        StatusCode::kInvalidArgument,
        "map: "));
    cases.push_back(WrongCall<v1::GetMapInfoRequest, v1::MapInfo>(
        "info of map named " + name,
        "MapAdmin/GetMapInfo",
        [name](v1::GetMapInfoRequest& r) { r.set_map(name); },
        StatusCode::kInvalidArgument,
        "map: "));
    cases.push_back(WrongCall<v1::OpenSessionRequest, v1::SessionState>(
        "session named " + name,
        "Mapping/OpenSession",
        [name](v1::OpenSessionRequest& r) {
          r.set_map("hall");
          r.set_session(name);
          r.set_robot("robot");
        },
        StatusCode::kInvalidArgument,
        "session: "));
    cases.push_back(WrongCall<v1::OpenSessionRequest, v1::SessionState>(
        "robot named " + name,
        "Mapping/OpenSession",
        [name](v1::OpenSessionRequest& r) {
          r.set_map("hall");
          r.set_session("new");
          r.set_robot(name);
        },
        StatusCode::kInvalidArgument,
        "robot: "));
    cases.push_back(WrongTile(
        "layer named " + name,
        [name](v1::GetTileRequest& r) { r.set_layer(name); },
        StatusCode::kInvalidArgument,
        "layer: "));
  }
  cases.push_back(WrongCall<v1::OpenSessionRequest, v1::SessionState>(
      "start that is no number",
      "Mapping/OpenSession",
      [](v1::OpenSessionRequest& r) {
        r.set_map("hall");
        r.set_session("new");
        r.set_robot("robot");
        r.mutable_map_from_start()->set_x(kNan);
      },
      StatusCode::kInvalidArgument,
      "map_from_start.x"));
  for (const double size : {0.0, -1.0, 5.0, kNan}) {
    cases.push_back(WrongCall<v1::CreateMapRequest, v1::CreateMapResponse>(
        "cell size",
        "MapAdmin/CreateMap",
        [size](v1::CreateMapRequest& r) {
          r.set_map("new");
          r.mutable_settings()->set_cell_size_m(size);
        },
        StatusCode::kInvalidArgument,
        "cell_size_m"));
  }
  return cases;
}

std::vector<Case> UnknownThings() {
  const auto session_request = [](auto& request) {
    request.set_map("hall");
    request.set_session("nobody");
  };
  return {
      WrongCall<v1::GetMapInfoRequest, v1::MapInfo>(
          "info of an unknown map",
          "MapAdmin/GetMapInfo",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::DeleteMapRequest, v1::DeleteMapResponse>(
          "delete of an unknown map",
          "MapAdmin/DeleteMap",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::VerifyMapRequest, v1::VerifyMapResponse>(
          "verify of an unknown map",
          "MapAdmin/VerifyMap",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::CreateMapRequest, v1::CreateMapResponse>(
          "map that exists",
          "MapAdmin/CreateMap",
          [](auto& r) { r.set_map("hall"); },
          StatusCode::kAlreadyExists,
          "hall"),
      WrongCall<v1::GetSessionRequest, v1::SessionState>("unknown session",
                                                         "Mapping/GetSession",
                                                         session_request,
                                                         StatusCode::kNotFound,
                                                         "nobody"),
      WrongCall<v1::CloseSessionRequest, v1::SessionState>("close of an unknown session",
                                                           "Mapping/CloseSession",
                                                           session_request,
                                                           StatusCode::kNotFound,
                                                           "nobody"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "batch of an unknown session",
          "Mapping/AppendBatch",
          [](auto& r) { r = BatchOf("hall", "nobody", RoomDrive(2), 0, 2); },
          StatusCode::kNotFound,
          "nobody"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "batch of an unknown map",
          "Mapping/AppendBatch",
          [](auto& r) { r = BatchOf("nowhere", "s", RoomDrive(2), 0, 2); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "gap",
          "Mapping/AppendBatch",
          [](auto& r) { r = BatchOf("hall", "s", RoomDrive(20), 15, 20); },
          StatusCode::kFailedPrecondition,
          "expected next is 11"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "number 0",
          "Mapping/AppendBatch",
          [](auto& r) {
            r = BatchOf("hall", "s", RoomDrive(12), 10, 12);
            r.set_first_number(0);
          },
          StatusCode::kInvalidArgument,
          "first_number"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "numbers beyond 64 bits",
          "Mapping/AppendBatch",
          [](auto& r) {
            r = BatchOf("hall", "s", RoomDrive(12), 10, 12);
            r.set_first_number(std::numeric_limits<std::uint64_t>::max());
          },
          StatusCode::kInvalidArgument,
          "first_number"),
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "empty batch",
          "Mapping/AppendBatch",
          [](auto& r) { r = BatchOf("hall", "s", {}, 10, 10); },
          StatusCode::kInvalidArgument,
          "observations: none"),
      WrongStream<v1::WatchMapRequest, v1::MapChange>(
          "watch of an unknown map",
          "Watch/WatchMap",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongStream<v1::StreamTrajectoryRequest, v1::TrajectoryPoses>("trajectory of nobody",
                                                                    "MapQuery/StreamTrajectory",
                                                                    session_request,
                                                                    StatusCode::kNotFound,
                                                                    "nobody"),
  };
}

std::vector<Case> WrongQueries() {
  const auto region = [](double x_min, double y_min, double x_max, double y_max) {
    return [=](auto& request) {
      request.set_map("hall");
      request.set_layer("occupancy");
      request.mutable_region()->set_x_min_m(x_min);
      request.mutable_region()->set_y_min_m(y_min);
      request.mutable_region()->set_x_max_m(x_max);
      request.mutable_region()->set_y_max_m(y_max);
    };
  };
  using Raster = v1::StreamRasterRequest;
  return {
      WrongTile(
          "zoom 25", [](auto& r) { r.set_zoom(25); }, StatusCode::kOutOfRange, "zoom"),
      WrongTile(
          "zoom 2^32-1", [](auto& r) { r.set_zoom(0xFFFFFFFFU); }, StatusCode::kOutOfRange, "zoom"),
      WrongTile(
          "x 2^24", [](auto& r) { r.set_x(1 << 24); }, StatusCode::kOutOfRange, "x"),
      WrongTile(
          "x -2^31",
          [](auto& r) { r.set_x(std::numeric_limits<std::int32_t>::min()); },
          StatusCode::kOutOfRange,
          "x"),
      WrongTile(
          "y -2^24", [](auto& r) { r.set_y(-(1 << 24)); }, StatusCode::kOutOfRange, "y"),
      WrongTile(
          "unknown layer",
          [](auto& r) { r.set_layer("salinity"); },
          StatusCode::kInvalidArgument,
          "salinity"),
      WrongTile(
          "unknown revision",
          [](auto& r) { r.set_revision(123456); },
          StatusCode::kNotFound,
          "123456"),
      WrongStream<Raster, v1::RasterRows>("region of no width",
                                          "MapQuery/StreamRaster",
                                          region(1.0, 0.0, 1.0, 1.0),
                                          StatusCode::kInvalidArgument,
                                          "region.x_max_m"),
      WrongStream<Raster, v1::RasterRows>("region that is no number",
                                          "MapQuery/StreamRaster",
                                          region(0.0, kNan, 1.0, 1.0),
                                          StatusCode::kInvalidArgument,
                                          "region.y_min_m"),
      WrongStream<Raster, v1::RasterRows>("region without end",
                                          "MapQuery/StreamRaster",
                                          region(0.0, 0.0, kInfinity, 1.0),
                                          StatusCode::kInvalidArgument,
                                          "region.x_max_m"),
      WrongStream<Raster, v1::RasterRows>("region of too many cells",
                                          "MapQuery/StreamRaster",
                                          region(-1e6, -1e6, 1e6, 1e6),
                                          StatusCode::kOutOfRange,
                                          "region"),
      WrongStream<Raster, v1::RasterRows>(
          "negative resolution",
          "MapQuery/StreamRaster",
          [region](auto& r) {
            region(0.0, 0.0, 1.0, 1.0)(r);
            r.set_resolution_m(-0.05);
          },
          StatusCode::kInvalidArgument,
          "resolution_m"),
      WrongStream<v1::StreamTilesRequest, v1::Tile>(
          "region of too many tiles",
          "MapQuery/StreamTiles",
          [region](auto& r) {
            region(-1e6, -1e6, 1e6, 1e6)(r);
            r.set_zoom(24);
          },
          StatusCode::kOutOfRange,
          "tiles"),
  };
}

class BadInputTest : public testing::Test {
 protected:
  // A map with ten observations.
  void SetUp() override {
    ASSERT_THAT(server_.CreateMap("hall"), IsOk());
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
    EXPECT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                      BatchOf("hall", "s", RoomDrive(20), 10, 20)),
                IsOk());
  }

  TestServer server_;
};

TEST_F(BadInputTest, NumbersThatAreNotFiniteAreRefused) {
  CheckAll(WrongNumbers());
}

TEST_F(BadInputTest, ImpossibleGeometryIsRefused) {
  CheckAll(WrongShapes());
}

TEST_F(BadInputTest, NamesThatAreNoneAreRefused) {
  CheckAll(WrongNames());
}

TEST_F(BadInputTest, UnknownThingsAreNotFound) {
  CheckAll(UnknownThings());
}

TEST_F(BadInputTest, QueriesOutOfRangeAreRefused) {
  CheckAll(WrongQueries());
}

TEST_F(BadInputTest, AnOldObservationConsumesItsNumberAndIsNamed) {
  std::vector<ObservationEvent> drive = RoomDrive(13);
  drive[11].stamp_ns = drive[4].stamp_ns;
  const auto response = server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                              BatchOf("hall", "s", drive, 10, 13));
  ASSERT_THAT(response, IsOk());
  EXPECT_EQ(response->last_durable_number(), 13U);
  ASSERT_EQ(response->refused_size(), 1);
  EXPECT_EQ(response->refused(0).number(), 12U);
  EXPECT_THAT(response->refused(0).reason(), testing::HasSubstr("stamp_ns"));
}

TEST_F(BadInputTest, ARequestOverTheSizeLimitIsRefused) {
  v1::AppendBatchRequest request = BatchOf("hall", "s", RoomDrive(11), 10, 11);
  v1::Observation large = request.observations(0);
  large.mutable_scan()->mutable_ranges_mm()->Resize(4096, 60000);
  while (request.ByteSizeLong() < (std::size_t{4} << 20U) + 1000) {
    *request.add_observations() = large;
  }
  const std::string digest = Digest();
  EXPECT_FALSE(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch", request).ok());
  EXPECT_EQ(Digest(), digest);
}

TEST_F(BadInputTest, BytesThatAreNoMessageAreRefused) {
  const std::string digest = Digest();
  for (const std::string& bytes : {std::string("\xFF\xFF\xFF\xFF"),
                                   std::string("\x0A\x7F"
                                               "abc"),
                                   std::string(1000, '\0')}) {
    EXPECT_THAT(server_.channel().CallRaw("loci.v1.Mapping/AppendBatch", bytes),
                IsStatus(StatusCode::kInvalidArgument));
    EXPECT_EQ(Digest(), digest);
  }
  EXPECT_THAT(server_.channel().CallRaw("loci.v1.Mapping/Fly", ""),
              IsStatus(StatusCode::kUnimplemented));
  EXPECT_THAT(server_.channel().CallRaw("", ""), IsStatus(StatusCode::kUnimplemented));
  EXPECT_EQ(Digest(), digest);
}

}  // namespace
}  // namespace loci
