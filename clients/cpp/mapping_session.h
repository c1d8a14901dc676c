// SPDX-License-Identifier: Apache-2.0
// One run of one robot: observations in, corrections out; nothing lost, nothing twice.
//
//   auto channel = loci::client::Channel::Create("tcp://127.0.0.1:5600");
//   loci::client::MappingSessionOptions options;
//   options.map = "office";
//   options.session = "2026-03-01-a";
//   options.robot = "r2";
//   auto session = loci::client::MappingSession::Open(channel, options);
//   if (!session.ok()) return Fail(session.status());
//   while (robot.Drives()) {
//     loci::v1::Observation observation;
//     observation.set_stamp_ns(robot.stamp_ns());
//     ...                                            // odometry and scan
//     if (auto status = (*session)->Append(std::move(observation)); !status.ok())
//       return Fail(status);
//     robot.Correct((*session)->progress().map_from_odom);
//   }
//   auto summary = (*session)->Close();              // all of it is in the map
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/cpp/channel.h"
#include "core/base/status.h"
#include "loci/v1/mapping.pb.h"

namespace loci::client {

struct MappingSessionOptions {
  std::string map;
  std::string session;                      // [a-z0-9_-]{1,64}; unique in the map
  std::string robot;                        // [a-z0-9_-]{1,64}
  std::optional<v1::Pose2> map_from_start;  // absent: the map's origin

  // A batch is sent when it has this many observations or bytes, when its first observation has
  // waited for `batch_delay`, or at once when no batch is unacknowledged.
  std::size_t batch_observations_max = 64;
  std::size_t batch_bytes_max = std::size_t{256} << 10U;
  std::chrono::milliseconds batch_delay{100};
  // Batches sent and not yet durable. Append waits while the window and one batch are full.
  std::size_t window_batches = 8;
  // Longest wait for one answer.
  std::chrono::milliseconds answer_max{30'000};
  // How long to try again without any progress when the server is away, or has no room
  // (RESOURCE_EXHAUSTED): a restart, a full disk. After that, the session fails.
  std::chrono::milliseconds retry_for{60'000};
  // Longest wait of Close: the server works off all it owes the session before it answers.
  std::chrono::milliseconds close_max{3'600'000};
  // Told of what goes wrong and is tried again, by the session's thread. May be empty.
  std::function<void(const std::string& what)> on_trouble;
};

// An observation that the server would not take, with its reason. Its number is used up.
struct Refusal {
  std::uint64_t number = 0;
  std::string reason;
};

struct MappingProgress {
  std::uint64_t last_appended_number = 0;
  // Every observation up to here is on the server's disk.
  std::uint64_t last_durable_number = 0;
  v1::Pose2 map_from_odom;
  std::uint64_t revision = 0;
  // Of this process's batches, as far as their answers came.
  std::uint64_t refused_count = 0;
  // Times that the connection was lost or the server had no room.
  std::uint64_t interruptions = 0;
};

// Sends from a thread of its own. Append, Flush and Close by one thread at a time; progress and
// TakeRefusals by any.
class MappingSession {
 public:
  // Opens the session, or finds it open again: next_number() tells what the server has of it. Tries
  // for `retry_for` while the server cannot be reached.
  static StatusOr<std::unique_ptr<MappingSession>> Open(std::shared_ptr<Channel> channel,
                                                        const MappingSessionOptions& options);
  MappingSession(const MappingSession&) = delete;
  MappingSession& operator=(const MappingSession&) = delete;
  // Leaves the session open in the server. What is not durable yet is lost: Flush or Close first.
  ~MappingSession();

  // The number that the next observation gets. After Open: one more than the last durable one, so
  // that a player of a log knows where to go on.
  std::uint64_t next_number() const;

  // Hands over one observation; waits while the window is full. An error is final: it is what every
  // later call returns.
  Status Append(v1::Observation observation);

  // Waits until all observations are durable.
  Status Flush();

  // Flushes and closes; returns when the map contains all of it.
  StatusOr<v1::SessionState> Close();

  MappingProgress progress() const;
  // The refusals since the last time, at most 1000 of them; progress() counts all.
  std::vector<Refusal> TakeRefusals();

 private:
  class Impl;
  explicit MappingSession(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace loci::client
