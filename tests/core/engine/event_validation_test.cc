// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/engine/event.h"
#include "tests/support/events.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct BadObservation {
  std::function<void(ObservationEvent&)> spoil;
  std::string message;
};

void ExpectRefused(const std::vector<BadObservation>& cases) {
  for (const BadObservation& bad : cases) {
    ObservationEvent event = ValidObservation();
    bad.spoil(event);
    EXPECT_THAT(ValidateEvent(event, "observations[3]"),
                IsStatus(StatusCode::kInvalidArgument, "observations[3]." + bad.message));
  }
}

TEST(EventValidationTest, ValidEventsOfEveryKindPass) {
  EXPECT_THAT(ValidateEvent(CreateMapEvent{}, ""), IsOk());
  EXPECT_THAT(ValidateEvent(ValidOpenSession(), ""), IsOk());
  EXPECT_THAT(ValidateEvent(ValidObservation(), ""), IsOk());
  EXPECT_THAT(ValidateEvent(Refusal(1), ""), IsOk());
  EXPECT_THAT(ValidateEvent(CloseSessionEvent{}, ""), IsOk());
}

TEST(EventValidationTest, OdometryAndScanMayBeAbsent) {
  ObservationEvent event = ValidObservation();
  event.odometry.reset();
  event.scan.reset();
  EXPECT_THAT(ValidateEvent(event, ""), IsOk());
}

TEST(EventValidationTest, FullTurnsOfRealLasersPass) {
  ObservationEvent event = ValidObservation();
  event.scan = ValidScan(361);
  event.scan->angle_min_rad = -kPi;
  event.scan->angle_step_rad = kPi / 180.0;  // the last beam looks where the first does
  EXPECT_THAT(ValidateEvent(event, ""), IsOk());
  event.scan->angle_step_rad = 0.01746;  // a log that rounds
  EXPECT_THAT(ValidateEvent(event, ""), IsOk());
}

TEST(EventValidationTest, ImpossibleOdometryIsRefusedByName) {
  ExpectRefused({
      {[](auto& e) { e.odometry->previous_from_robot.x = kNaN; },
       "odometry.previous_from_robot.x: nan, must be from -1000 to 1000"},
      {[](auto& e) { e.odometry->previous_from_robot.y = -kInfinity; },
       "odometry.previous_from_robot.y: -inf"},
      {[](auto& e) { e.odometry->previous_from_robot.theta = 4.0; },
       "odometry.previous_from_robot.theta: 4, must be from -3.14159265 to 3.14159265"},
      {[](auto& e) {
         e.odometry->previous_from_robot.x = 800.0;
         e.odometry->previous_from_robot.y = 800.0;
       },
       "odometry.previous_from_robot: distance in metres: 1131.3"},
  });
}

TEST(EventValidationTest, BadCovariancesAreRefusedByName) {
  ExpectRefused({
      {[](auto& e) { e.odometry->covariance_upper[0] = kNaN; },
       "odometry.covariance: not a finite number"},
      {[](auto& e) { e.odometry->covariance_upper[3] = -0.2; },
       "odometry.covariance: eigenvalue -0.2"},
      {[](auto& e) { e.odometry->covariance_upper[1] = 1.0; },
       "odometry.covariance: eigenvalue -0.99"},
      {[](auto& e) { e.odometry->covariance_upper = {}; }, "odometry.covariance: eigenvalue 0"},
      {[](auto& e) { e.odometry->covariance_upper[5] = 1e-20; },
       "odometry.covariance: eigenvalue: 1e-20, must be from 1e-14 to 1000000"},
      {[](auto& e) { e.odometry->covariance_upper[0] = 1e9; },
       "odometry.covariance: eigenvalue: 1e+09"},
  });
}

TEST(EventValidationTest, ImpossibleScansAreRefusedByName) {
  ExpectRefused({
      {[](auto& e) { e.scan->ranges_mm.clear(); }, "scan.ranges_mm: 0 beams, must be from 1 to"},
      {[](auto& e) { e.scan->ranges_mm.resize(4097); }, "scan.ranges_mm: 4097 beams"},
      {[](auto& e) { e.scan->angle_step_rad = 0.0; }, "scan.angle_step_rad: 0, must be from"},
      {[](auto& e) { e.scan->angle_step_rad = -0.01; }, "scan.angle_step_rad: -0.01"},
      {[](auto& e) { e.scan->angle_step_rad = kNaN; }, "scan.angle_step_rad: nan"},
      {[](auto& e) { e.scan->angle_step_rad = 0.1; },
       "scan.angle_step_rad: 0.1 over 180 beams spans 17.9 rad"},
      {[](auto& e) { e.scan->angle_min_rad = 7.0; }, "scan.angle_min_rad: 7"},
      {[](auto& e) { e.scan->angle_min_rad = kInfinity; }, "scan.angle_min_rad: inf"},
      {[](auto& e) { e.scan->robot_from_laser.x = 101.0; },
       "scan.robot_from_laser.x: 101, must be from -100 to 100"},
      {[](auto& e) { e.scan->robot_from_laser.theta = kNaN; }, "scan.robot_from_laser.theta: nan"},
  });
}

TEST(EventValidationTest, NumbersAndStampsAreBounded) {
  ExpectRefused({
      {[](auto& e) { e.number = 0; }, "number: 0, must be at least 1"},
      {[](auto& e) { e.stamp_ns = -1; }, "stamp_ns: -1, must be at least 0"},
  });
  EXPECT_THAT(ValidateEvent(Refusal(0), ""), IsStatus(StatusCode::kInvalidArgument, "number: 0"));
  EXPECT_THAT(ValidateEvent(Refusal(1, std::string(1001, 'x')), ""),
              IsStatus(StatusCode::kInvalidArgument, "reason: 1001 bytes, must be at most 1000"));
}

TEST(EventValidationTest, NamesAndStartsAreBounded) {
  for (const std::string& name : {std::string(),
                                  std::string("Upper"),
                                  std::string("a/b"),
                                  std::string(65, 'a'),
                                  std::string("a\0b", 3),
                                  std::string("\xc3\xa9")}) {
    OpenSessionEvent event = ValidOpenSession(name);
    EXPECT_THAT(ValidateEvent(event, ""), IsStatus(StatusCode::kInvalidArgument, "session: \""));
    event = ValidOpenSession();
    event.robot = name;
    EXPECT_THAT(ValidateEvent(event, "open"),
                IsStatus(StatusCode::kInvalidArgument, "open.robot: \""));
  }
  OpenSessionEvent far = ValidOpenSession(std::string(64, 'a'));
  EXPECT_THAT(ValidateEvent(far, ""), IsOk());
  far.map_from_start.x = 30001.0;
  EXPECT_THAT(ValidateEvent(far, ""),
              IsStatus(StatusCode::kInvalidArgument, "map_from_start.x: 30001, must be from"));
}

TEST(EventValidationTest, SettingsAreChecked) {
  CreateMapEvent event;
  event.settings.cell_size_m = kNaN;
  EXPECT_THAT(ValidateEvent(event, "create"),
              IsStatus(StatusCode::kInvalidArgument, "create.settings.cell_size_m"));
}

}  // namespace
}  // namespace loci
