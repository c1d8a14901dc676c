// SPDX-License-Identifier: Apache-2.0
// Observations and names that cannot be: a status that names the field, no change, and a server
// that goes on.
#include "tests/support/bad_input.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci {
namespace {

const std::string kLongName(65, 'a');

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
    cases.push_back(WrongStream<v1::WatchMapRequest, v1::MapChange>(
        "watch of a map named " + name,
        "Watch/WatchMap",
        [name](v1::WatchMapRequest& r) { r.set_map(name); },
        StatusCode::kInvalidArgument,
        "map: "));
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

TEST_F(BadInputTest, NumbersThatAreNotFiniteAreRefused) {
  CheckAll(WrongNumbers());
}

TEST_F(BadInputTest, ImpossibleGeometryIsRefused) {
  CheckAll(WrongShapes());
}

TEST_F(BadInputTest, NamesThatAreNoneAreRefused) {
  CheckAll(WrongNames());
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
  const auto next = server_.Call<v1::AppendBatchResponse>(
      "Mapping/AppendBatch", BatchOf("hall", "s", RoomDrive(20), 13, 20));
  ASSERT_THAT(next, IsOk());
  EXPECT_EQ(next->refused_size(), 0);
}

}  // namespace
}  // namespace loci
