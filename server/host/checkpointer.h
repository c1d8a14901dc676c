// SPDX-License-Identifier: Apache-2.0
// Writes a map's checkpoints beside the work of the applier.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "core/engine/engine.h"
#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "storage/store.h"

namespace loci {

// The applier asks at its start and after every event whether a checkpoint is due and hands the
// changes over; they are written on a thread of their own. A checkpoint that fails (a full disk) is
// tried again later from the state of then: checkpoints only shorten recovery, the log holds the
// truth.
class Checkpointer {
 public:
  // References must outlive the checkpointer. `last` is the checkpoint of the store that the
  // engine's changes count from; 0 for none. `replayed` events came after it: they count as applied
  // since, so that a server that is killed again and again does not replay ever more.
  Checkpointer(std::string map,
               const HostLimits& limits,
               const Clock& clock,
               MapStore& store,
               EventNumber last,
               std::uint64_t replayed);
  ~Checkpointer();

  // By the applier: an event of so many bytes was applied.
  void CountEvent(std::size_t size_bytes) LOCI_EXCLUDES(mutex_);
  // By the applier: whether it should call Begin now.
  bool IsDue() const LOCI_EXCLUDES(mutex_);
  // Takes the engine's changes since the last checkpoint and has them written. `state_digest` is
  // the engine's.
  void Begin(const Engine& engine, const std::string& state_digest) LOCI_EXCLUDES(mutex_);

  // Ends the thread when what it writes is written; afterwards only WriteNow may be called.
  void Stop() LOCI_EXCLUDES(mutex_);
  // Writes a checkpoint now. After Stop only, and only if the engine has changed since the last
  // one.
  Status WriteNow(const Engine& engine, const std::string& state_digest) LOCI_EXCLUDES(mutex_);

  EventNumber last_written() const LOCI_EXCLUDES(mutex_);

 private:
  void Run() LOCI_EXCLUDES(mutex_);
  Status Write(const CheckpointChanges& changes) LOCI_EXCLUDES(mutex_);

  const std::string map_;
  const HostLimits limits_;
  const Clock& clock_;
  MapStore& store_;

  mutable Mutex mutex_;
  ConditionVariable wake_;
  EventNumber last_written_ LOCI_GUARDED_BY(mutex_);
  std::uint64_t events_since_ LOCI_GUARDED_BY(mutex_) = 0;
  std::uint64_t bytes_since_ LOCI_GUARDED_BY(mutex_) = 0;
  bool busy_ LOCI_GUARDED_BY(mutex_) = false;
  std::optional<TimePoint> not_before_ LOCI_GUARDED_BY(mutex_);
  std::optional<CheckpointChanges> handed_ LOCI_GUARDED_BY(mutex_);
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;

  std::thread thread_;
};

}  // namespace loci
