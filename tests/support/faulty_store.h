// SPDX-License-Identifier: Apache-2.0
// A store around another one that fails when a test says so.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "storage/store.h"

namespace loci {

// What goes wrong; shared by all maps of a FaultyDirectory.
struct StoreFaults {
  std::atomic<StatusCode> append{StatusCode::kOk};
  std::atomic<StatusCode> checkpoint{StatusCode::kOk};
  // Damages the newest checkpoint when it is read.
  std::atomic<bool> newest_checkpoint_damaged{false};
  std::atomic<std::uint64_t> checkpoints_written{0};
  // While it is set, an append waits before it begins; clear it and notify.
  std::atomic<bool> append_held{false};
  std::atomic<std::uint64_t> appends_begun{0};
};

class FaultyStore final : public MapStore {
 public:
  FaultyStore(std::unique_ptr<MapStore> store, StoreFaults& faults)
      : store_(std::move(store)), faults_(faults) {}

  Status Append(std::span<const LogEntry> entries) override {
    ++faults_.appends_begun;
    faults_.appends_begun.notify_all();
    faults_.append_held.wait(true);
    const StatusCode fault = faults_.append;
    return fault == StatusCode::kOk ? store_->Append(entries) : Status(fault, "simulated");
  }
  EventNumber LastEvent() const override { return store_->LastEvent(); }
  Status ReadLog(EventNumber after,
                 const std::function<Status(const LogEntry&)>& visit) const override {
    return store_->ReadLog(after, visit);
  }
  Status WriteCheckpoint(const CheckpointChanges& changes) override {
    const StatusCode fault = faults_.checkpoint;
    if (fault != StatusCode::kOk) {
      return Status(fault, "simulated");
    }
    const Status status = store_->WriteCheckpoint(changes);
    faults_.checkpoints_written += status.ok() ? 1 : 0;
    return status;
  }
  StatusOr<std::vector<CheckpointInfo>> ListCheckpoints() const override {
    return store_->ListCheckpoints();
  }
  StatusOr<Checkpoint> ReadCheckpoint(EventNumber last_event) const override {
    LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointInfo> kept, store_->ListCheckpoints());
    if (faults_.newest_checkpoint_damaged && last_event == kept.back().last_event) {
      return DataLossError("simulated");
    }
    return store_->ReadCheckpoint(last_event);
  }
  Status TrimLog(EventNumber last) override { return store_->TrimLog(last); }
  Status CheckIntegrity() const override { return store_->CheckIntegrity(); }
  StatusOr<StoredBytes> MeasureBytes() const override { return store_->MeasureBytes(); }

 private:
  const std::unique_ptr<MapStore> store_;
  StoreFaults& faults_;
};

// `faults` must outlive it.
class FaultyDirectory final : public StoreDirectory {
 public:
  FaultyDirectory(std::unique_ptr<StoreDirectory> directory, StoreFaults& faults)
      : directory_(std::move(directory)), faults_(faults) {}

  StatusOr<std::vector<std::string>> List() const override { return directory_->List(); }
  StatusOr<std::unique_ptr<MapStore>> Create(const std::string& map) override {
    return Wrap(directory_->Create(map));
  }
  StatusOr<std::unique_ptr<MapStore>> Open(const std::string& map) override {
    return Wrap(directory_->Open(map));
  }
  Status Delete(const std::string& map) override { return directory_->Delete(map); }

 private:
  StatusOr<std::unique_ptr<MapStore>> Wrap(StatusOr<std::unique_ptr<MapStore>> store) {
    if (!store.ok()) {
      return store;
    }
    return std::unique_ptr<MapStore>(
        std::make_unique<FaultyStore>(std::move(store).value(), faults_));
  }

  const std::unique_ptr<StoreDirectory> directory_;
  StoreFaults& faults_;
};

}  // namespace loci
