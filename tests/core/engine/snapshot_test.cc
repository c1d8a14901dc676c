// SPDX-License-Identifier: Apache-2.0
#include "core/engine/snapshot.h"

#include <memory>

#include <gtest/gtest.h>

#include "core/engine/admission.h"
#include "core/engine/engine.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(SnapshotTest, ASessionCanBeFoundAgainByItsStartAfterARestart) {
  const Pose2 start{1.0, -2.0, 0.5};
  Engine engine;
  engine.Apply(CreateMapEvent{});
  engine.Apply(OpenSessionEvent{"monday", "anna", start});
  StatusOr<Engine> restarted = Engine::FromRecords(engine.ChangesSince({}).written);
  ASSERT_THAT(restarted, IsOk());
  const std::shared_ptr<const Snapshot> snapshot = restarted->TakeSnapshot();
  ASSERT_EQ(snapshot->sessions.size(), 1U);
  EXPECT_EQ(snapshot->sessions[0].map_from_start, start);

  const AdmissionControl admission = AdmissionControl::FromSnapshot(*snapshot);
  const AdmittedSession* found = admission.FindByName("monday", nullptr);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->map_from_start, start);
}

}  // namespace
}  // namespace loci
