// SPDX-License-Identifier: Apache-2.0
// Requests for what is not there, is closed, or is out of range.
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/bad_input.h"

namespace loci {
namespace {

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
      WrongCall<v1::GetServerStatusRequest, v1::ServerStatus>(
          "status of an unknown map",
          "MapAdmin/GetServerStatus",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::ListClosuresRequest, v1::ListClosuresResponse>(
          "closures of an unknown map",
          "MapAdmin/ListClosures",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::GetMeshRequest, v1::Mesh>(
          "mesh of an unknown map",
          "MapQuery/GetMesh",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::GetGraphRequest, v1::Graph>(
          "graph of an unknown map",
          "MapQuery/GetGraph",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongTile(
          "tile of an unknown map",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::OpenSessionRequest, v1::SessionState>(
          "session of an unknown map",
          "Mapping/OpenSession",
          [](auto& r) {
            r.set_map("nowhere");
            r.set_session("s");
            r.set_robot("robot");
          },
          StatusCode::kNotFound,
          "nowhere"),
      WrongCall<v1::ListSessionsRequest, v1::ListSessionsResponse>(
          "sessions of an unknown map",
          "Mapping/ListSessions",
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
      WrongStream<v1::StreamTilesRequest, v1::Tile>(
          "tiles of an unknown map",
          "MapQuery/StreamTiles",
          [](auto& r) {
            r.set_map("nowhere");
            r.set_layer("occupancy");
          },
          StatusCode::kNotFound,
          "nowhere"),
      WrongStream<v1::StreamRasterRequest, v1::RasterRows>(
          "raster of an unknown map",
          "MapQuery/StreamRaster",
          [](auto& r) {
            r.set_map("nowhere");
            r.set_layer("occupancy");
          },
          StatusCode::kNotFound,
          "nowhere"),
      WrongStream<v1::StreamTrajectoryRequest, v1::TrajectoryPoses>(
          "trajectory of an unknown map",
          "MapQuery/StreamTrajectory",
          [](auto& r) { r.set_map("nowhere"); },
          StatusCode::kNotFound,
          "nowhere"),
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

// The session "done" has two observations and is closed.
std::vector<Case> ClosedSessions() {
  return {
      WrongCall<v1::AppendBatchRequest, v1::AppendBatchResponse>(
          "batch of a closed session",
          "Mapping/AppendBatch",
          [](auto& r) { r = BatchOf("hall", "done", RoomDrive(4), 2, 4); },
          StatusCode::kFailedPrecondition,
          "session: \"done\" is closed"),
      WrongCall<v1::OpenSessionRequest, v1::SessionState>(
          "closed session opened again",
          "Mapping/OpenSession",
          [](auto& r) {
            r.set_map("hall");
            r.set_session("done");
            r.set_robot("robot");
          },
          StatusCode::kAlreadyExists,
          "session: \"done\" is closed"),
      WrongCall<v1::OpenSessionRequest, v1::SessionState>(
          "open session of another robot",
          "Mapping/OpenSession",
          [](auto& r) {
            r.set_map("hall");
            r.set_session("s");
            r.set_robot("other");
          },
          StatusCode::kAlreadyExists,
          "robot"),
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
          "y 2^24", [](auto& r) { r.set_y(1 << 24); }, StatusCode::kOutOfRange, "y"),
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
      WrongStream<v1::StreamTilesRequest, v1::Tile>("tiles of a region that is no number",
                                                    "MapQuery/StreamTiles",
                                                    region(0.0, 0.0, kNan, 1.0),
                                                    StatusCode::kInvalidArgument,
                                                    "region.x_max_m"),
      WrongStream<v1::StreamTilesRequest, v1::Tile>("tiles of a region turned over",
                                                    "MapQuery/StreamTiles",
                                                    region(0.0, 1.0, 1.0, 0.0),
                                                    StatusCode::kInvalidArgument,
                                                    "region.y_max_m"),
      WrongStream<v1::StreamTilesRequest, v1::Tile>(
          "tiles of an unknown layer",
          "MapQuery/StreamTiles",
          [region](auto& r) {
            region(0.0, 0.0, 1.0, 1.0)(r);
            r.set_layer("salinity");
          },
          StatusCode::kInvalidArgument,
          "salinity"),
      WrongStream<v1::StreamTilesRequest, v1::Tile>(
          "tiles at zoom 25",
          "MapQuery/StreamTiles",
          [region](auto& r) {
            region(0.0, 0.0, 1.0, 1.0)(r);
            r.set_zoom(25);
          },
          StatusCode::kOutOfRange,
          "zoom"),
      WrongStream<Raster, v1::RasterRows>(
          "raster of an unknown layer",
          "MapQuery/StreamRaster",
          [region](auto& r) {
            region(0.0, 0.0, 1.0, 1.0)(r);
            r.set_layer("salinity");
          },
          StatusCode::kInvalidArgument,
          "salinity"),
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

TEST_F(BadInputTest, UnknownThingsAreNotFound) {
  CheckAll(UnknownThings());
}

TEST_F(BadInputTest, ClosedSessionsStayClosedAndSessionsTheirRobots) {
  CheckAll(ClosedSessions());
}

TEST_F(BadInputTest, QueriesOutOfRangeAreRefused) {
  CheckAll(WrongQueries());
}

}  // namespace
}  // namespace loci
