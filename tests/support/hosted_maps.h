// SPDX-License-Identifier: Apache-2.0
// Maps on a temporary disk, with calls that wait for their answer.
#pragma once

#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/map_directory.h"
#include "storage/sqlite/sqlite_store.h"
#include "tests/support/faulty_store.h"
#include "tests/support/temporary_directory.h"

namespace loci {

// The server's maps without a server. Restart is what a kill and a new start do.
class HostedMaps {
 public:
  HostedMaps() { Start(); }
  explicit HostedMaps(const HostLimits& limits) {
    limits_.host = limits;
    Start();
  }

  void Start() {
    auto store = OpenSqliteDirectory(disk_.path());
    ASSERT_TRUE(store.ok()) << store.status().ToString();
    auto maps = MapDirectory::Open(
        std::make_unique<FaultyDirectory>(std::move(store).value(), faults_), limits_, clock_);
    ASSERT_TRUE(maps.ok()) << maps.status().ToString();
    maps_ = std::move(maps).value();
  }
  void Stop(StopMode mode) {
    maps_->Stop(mode);
    maps_.reset();
  }
  void Restart(StopMode mode) {
    Stop(mode);
    Start();
  }

  MapDirectory& operator*() { return *maps_; }
  MapDirectory* operator->() { return maps_.get(); }
  StoreFaults& faults() { return faults_; }
  HostLimits& limits() { return limits_.host; }
  const std::filesystem::path& path() const { return disk_.path(); }

  // Waits for the map's recovery.
  std::shared_ptr<MapHost> Host(const std::string& map) {
    auto host = maps_->Find(map);
    EXPECT_TRUE(host.ok()) << host.status().ToString();
    IgnoreError((*host)->WaitUntilServing(), "the test looks at the calls' answers");
    return *host;
  }

  StatusOr<HostedSession> OpenSession(const std::string& map, const std::string& session) {
    return Await<HostedSession>([&](auto done) {
      Host(map)->OpenSession(session, {"robot", {}}, std::move(done));
    });
  }
  StatusOr<HostedSession> CloseSession(const std::string& map, const std::string& session) {
    return Await<HostedSession>(
        [&](auto done) { Host(map)->CloseSession(session, std::move(done)); });
  }
  // Observations [begin, end) of the drive, which is numbered from 1.
  StatusOr<AppendOutcome> Append(const std::string& map,
                                 const std::string& session,
                                 const std::vector<ObservationEvent>& drive,
                                 std::size_t begin,
                                 std::size_t end) {
    BatchRequest batch;
    batch.first_number = begin + 1;
    batch.observations.assign(drive.begin() + static_cast<std::ptrdiff_t>(begin),
                              drive.begin() + static_cast<std::ptrdiff_t>(end));
    return Await<AppendOutcome>(
        [&](auto done) { Host(map)->AppendBatch(session, std::move(batch), std::move(done)); });
  }
  StatusOr<HostedMapInfo> Info(const std::string& map) {
    return Await<HostedMapInfo>([&](auto done) { Host(map)->GetInfo(std::move(done)); });
  }
  // Empty if the map does not answer.
  std::string Digest(const std::string& map) {
    const StatusOr<HostedMapInfo> info = Info(map);
    EXPECT_TRUE(info.ok()) << info.status().ToString();
    return info.ok() ? info->state_digest : "";
  }

  template <typename T, typename Call>
  static StatusOr<T> Await(Call call) {
    const auto answer = std::make_shared<std::promise<StatusOr<T>>>();
    std::future<StatusOr<T>> future = answer->get_future();
    call([answer](StatusOr<T> result) { answer->set_value(std::move(result)); });
    return future.get();
  }

 private:
  TemporaryDirectory disk_;
  ServerLimits limits_;
  StoreFaults faults_;
  SteadyClock clock_;
  std::unique_ptr<MapDirectory> maps_;
};

}  // namespace loci
