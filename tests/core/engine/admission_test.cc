// SPDX-License-Identifier: Apache-2.0
#include "core/engine/admission.h"

#include <gtest/gtest.h>

#include "tests/support/events.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// A map with session 0, open.
AdmissionControl WithOneSession() {
  AdmissionControl admission;
  admission.Admit(CreateMapEvent{});
  admission.Admit(ValidOpenSession("first"));
  return admission;
}

TEST(AdmissionTest, TheFirstEventCreatesTheMapAndNoOtherDoes) {
  AdmissionControl admission;
  EXPECT_THAT(admission.Check(ValidOpenSession()), IsStatus(StatusCode::kFailedPrecondition));
  ASSERT_THAT(admission.Check(CreateMapEvent{}), IsOk());
  admission.Admit(CreateMapEvent{});
  EXPECT_THAT(admission.Check(CreateMapEvent{}), IsStatus(StatusCode::kAlreadyExists));
}

TEST(AdmissionTest, SessionsAreNumberedInOrderOfOpening) {
  AdmissionControl admission = WithOneSession();
  EXPECT_THAT(admission.Check(ValidOpenSession("first")),
              IsStatus(StatusCode::kAlreadyExists, "\"first\""));
  admission.Admit(ValidOpenSession("second"));
  SessionId id;
  ASSERT_NE(admission.FindByName("second", &id), nullptr);
  EXPECT_EQ(id, SessionId{1});
  EXPECT_EQ(admission.Find(id)->session, "second");
  EXPECT_EQ(admission.Find(id)->map_from_start, ValidOpenSession().map_from_start);
  EXPECT_EQ(admission.Find(SessionId{2}), nullptr);
  EXPECT_EQ(admission.FindByName("third", &id), nullptr);
}

TEST(AdmissionTest, ObservationsComeInTurn) {
  AdmissionControl admission = WithOneSession();
  EXPECT_THAT(admission.Check(ValidObservation(2)),
              IsStatus(StatusCode::kFailedPrecondition, "number: 2, must be 1"));
  admission.Admit(ValidObservation(1));
  EXPECT_THAT(admission.Check(ValidObservation(1)),
              IsStatus(StatusCode::kFailedPrecondition, "number: 1, must be 2"));
  EXPECT_THAT(admission.Check(ValidObservation(2)), IsOk());
  EXPECT_THAT(admission.Check(ValidObservation(1, SessionId{1})), IsStatus(StatusCode::kNotFound));
}

TEST(AdmissionTest, AnObservationNotNewerIsInvalidAndItsRefusalConsumesTheNumber) {
  AdmissionControl admission = WithOneSession();
  admission.Admit(ValidObservation(1));
  ObservationEvent late = ValidObservation(2);
  late.stamp_ns = ValidObservation(1).stamp_ns;
  EXPECT_THAT(admission.Check(late), IsStatus(StatusCode::kInvalidArgument, "stamp_ns: 100000000"));
  const RefuseObservationEvent refusal = Refusal(2);
  ASSERT_THAT(admission.Check(refusal), IsOk());
  admission.Admit(refusal);
  EXPECT_THAT(admission.Check(ValidObservation(3)), IsOk());
  EXPECT_EQ(admission.Find(SessionId{0})->last_number, 2U);
}

TEST(AdmissionTest, TheFirstStampMayBeZero) {
  AdmissionControl admission = WithOneSession();
  ObservationEvent event = ValidObservation(1);
  event.stamp_ns = 0;
  EXPECT_THAT(admission.Check(event), IsOk());
}

TEST(AdmissionTest, AClosedSessionTakesNothingMore) {
  AdmissionControl admission = WithOneSession();
  ASSERT_THAT(admission.Check(CloseSessionEvent{}), IsOk());
  admission.Admit(CloseSessionEvent{});
  EXPECT_THAT(admission.Check(ValidObservation(1)),
              IsStatus(StatusCode::kFailedPrecondition, "closed"));
  EXPECT_THAT(admission.Check(Refusal(1)), IsStatus(StatusCode::kFailedPrecondition, "closed"));
  EXPECT_THAT(admission.Check(CloseSessionEvent{}), IsStatus(StatusCode::kFailedPrecondition));
  EXPECT_THAT(admission.Check(CloseSessionEvent{.session = SessionId{5}}),
              IsStatus(StatusCode::kNotFound));
}

TEST(AdmissionTest, WhatIsWrongByItselfIsRefusedBeforeTheMapIsAsked) {
  const AdmissionControl admission = WithOneSession();
  ObservationEvent event = ValidObservation(7);
  event.stamp_ns = -1;
  EXPECT_THAT(admission.Check(event), IsStatus(StatusCode::kInvalidArgument, "stamp_ns: -1"));
}

TEST(AdmissionTest, GoesOnFromASnapshotAsIfItHadSeenTheEvents) {
  Snapshot snapshot;
  snapshot.revision = {3};
  SessionSnapshot session;
  session.session = "first";
  session.robot = "robot_1";
  session.map_from_start = ValidOpenSession().map_from_start;
  session.accepted_count = 1;
  session.last_number = 1;
  session.last_stamp_ns = ValidObservation(1).stamp_ns;
  snapshot.sessions.push_back(session);
  const AdmissionControl admission = AdmissionControl::FromSnapshot(snapshot);
  EXPECT_THAT(admission.Check(CreateMapEvent{}), IsStatus(StatusCode::kAlreadyExists));
  EXPECT_THAT(admission.Check(ValidOpenSession("first")), IsStatus(StatusCode::kAlreadyExists));
  EXPECT_THAT(admission.Check(ValidObservation(1)), IsStatus(StatusCode::kFailedPrecondition));
  ObservationEvent late = ValidObservation(2);
  late.stamp_ns = session.last_stamp_ns;
  EXPECT_THAT(admission.Check(late), IsStatus(StatusCode::kInvalidArgument, "stamp_ns"));
  EXPECT_THAT(admission.Check(ValidObservation(2)), IsOk());
  EXPECT_EQ(admission.Find(SessionId{0})->map_from_start, session.map_from_start);
}

TEST(AdmissionTest, TheSnapshotOfAnEmptyLogStillHasToBeCreated) {
  const AdmissionControl admission = AdmissionControl::FromSnapshot(Snapshot{});
  EXPECT_THAT(admission.Check(CreateMapEvent{}), IsOk());
}

}  // namespace
}  // namespace loci
