// SPDX-License-Identifier: Apache-2.0
// The same events give the same state, however the engine came by them.
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/engine/engine.h"
#include "tests/support/loop_world.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// The events of one loop, and the engine after all of them, made once for all tests of a process.
const SimulatedMap& Loop() {
  static const SimulatedMap kLoop = DriveAroundTheBlock(1);
  return kLoop;
}

struct Ending {
  Digest state;
  Digest snapshot;
};

Ending EndingOf(Engine& engine) {
  return {engine.StateDigest(), DigestOf(*engine.TakeSnapshot())};
}

const Ending& LoopEnding() {
  static const Ending kEnding = [] {
    Engine engine = EngineOf(Loop().events);
    return EndingOf(engine);
  }();
  return kEnding;
}

Engine Reloaded(const Engine& engine) {
  StatusOr<Engine> reloaded = Engine::FromRecords(engine.ChangesSince(EventNumber{0}).written);
  LOCI_CHECK(reloaded.ok());
  return std::move(reloaded).value();
}

TEST(ReplayTest, TheSameEventsGiveTheSameDigest) {
  Engine engine = EngineOf(Loop().events);
  const Ending ending = EndingOf(engine);
  EXPECT_EQ(ending.state, LoopEnding().state);
  EXPECT_EQ(ending.snapshot, LoopEnding().snapshot);
}

TEST(ReplayTest, EveryEventChangesTheDigest) {
  Engine engine;
  Digest before = engine.StateDigest();
  for (std::size_t i = 0; i < 40; ++i) {
    engine.Apply(Loop().events[i]);
    EXPECT_NE(engine.StateDigest(), before) << i;
    before = engine.StateDigest();
  }
}

TEST(ReplayTest, RecordsOfAnyEventGoOnToTheSameEnding) {
  const std::vector<Event>& events = Loop().events;
  Engine engine;
  for (std::size_t k = 0; k < events.size(); ++k) {
    if (k < 4 || k % 41 == 17 || k + 2 >= events.size()) {
      SCOPED_TRACE(k);
      Engine reloaded = Reloaded(engine);
      ASSERT_EQ(reloaded.last_event(), engine.last_event());
      ASSERT_EQ(reloaded.StateDigest(), engine.StateDigest());
      for (std::size_t i = k; i < events.size(); ++i) {
        reloaded.Apply(events[i]);
      }
      const Ending ending = EndingOf(reloaded);
      EXPECT_EQ(ending.state, LoopEnding().state);
      EXPECT_EQ(ending.snapshot, LoopEnding().snapshot);
    }
    engine.Apply(events[k]);
  }
}

TEST(ReplayTest, ReloadingAgainAndAgainGoesOnToTheSameEnding) {
  Engine engine;
  for (std::size_t i = 0; i < Loop().events.size(); ++i) {
    if (i % 23 == 5) {
      engine = Reloaded(engine);
    }
    engine.Apply(Loop().events[i]);
  }
  const Ending ending = EndingOf(engine);
  EXPECT_EQ(ending.state, LoopEnding().state);
  EXPECT_EQ(ending.snapshot, LoopEnding().snapshot);
}

TEST(ReplayTest, ReadRecordsShowTheSameSnapshotAtOnce) {
  Engine engine;
  for (std::size_t i = 0; i < Loop().events.size(); ++i) {
    engine.Apply(Loop().events[i]);
    if (i % 60 == 59 || i + 1 == Loop().events.size()) {
      Engine reloaded = Reloaded(engine);
      EXPECT_EQ(DigestOf(*reloaded.TakeSnapshot()), DigestOf(*engine.TakeSnapshot())) << i;
    }
  }
}

using Records = std::map<std::pair<std::uint32_t, std::uint64_t>, std::string>;

void Merge(const Engine::RecordChanges& changes, Records& records) {
  for (const auto& name : changes.removed) {
    records.erase(name);
  }
  for (const StateRecord& record : changes.written) {
    records[{record.kind, record.id}] = record.bytes;
  }
}

TEST(ReplayTest, ChangesOverAnOlderCheckpointAreTheWholeState) {
  Engine engine;
  Records merged;
  EventNumber since;
  RandomSequence random(1);
  std::size_t next = 0;
  bool reload = false;
  for (std::size_t i = 0; i < Loop().events.size(); ++i) {
    engine.Apply(Loop().events[i]);
    if (i < next && i + 1 < Loop().events.size()) {
      continue;
    }
    next = i + 1 + random.NextBits() % 40;
    Merge(engine.ChangesSince(since), merged);
    since = engine.last_event();
    engine.ForgetChangesUpTo(since);
    Records whole;
    Merge(engine.ChangesSince(EventNumber{0}), whole);
    ASSERT_EQ(merged.size(), whole.size()) << i;
    EXPECT_TRUE(merged == whole) << i;
    if (reload) {  // a process that begins from a checkpoint goes on with the next one
      engine = Reloaded(engine);
    }
    reload = !reload;
  }
}

TEST(ReplayTest, SnapshotsAtAnyTimeChangeNothing) {
  Engine engine;
  for (const Event& event : Loop().events) {
    engine.Apply(event);
    const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
    EXPECT_EQ(snapshot->revision, engine.last_event());
  }
  const Ending ending = EndingOf(engine);
  EXPECT_EQ(ending.state, LoopEnding().state);
  EXPECT_EQ(ending.snapshot, LoopEnding().snapshot);
}

TEST(ReplayTest, ASnapshotNeverChanges) {
  Engine engine;
  std::vector<std::pair<std::shared_ptr<const Snapshot>, Digest>> taken;
  for (std::size_t i = 0; i < Loop().events.size(); ++i) {
    engine.Apply(Loop().events[i]);
    if (i % 20 == 3) {
      const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
      taken.emplace_back(snapshot, DigestOf(*snapshot));
    }
  }
  for (const auto& [snapshot, digest] : taken) {
    EXPECT_EQ(DigestOf(*snapshot), digest) << snapshot->revision.value;
  }
}

TEST(ReplayTest, TheSeedIsPartOfTheState) {
  Engine a;
  a.Apply(CreateMapEvent{});
  MapSettings other;
  other.seed = 1;
  Engine b;
  b.Apply(CreateMapEvent{other});
  EXPECT_NE(a.StateDigest(), b.StateDigest());
  EXPECT_NE(a.StateDigest(), Engine().StateDigest());
}

}  // namespace
}  // namespace loci
