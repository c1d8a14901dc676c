// SPDX-License-Identifier: Apache-2.0
// Plays the scans of a log into a session of a map, from wherever the server has it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "clients/cli/observation_maker.h"
#include "clients/cpp/mapping_session.h"
#include "clients/log/carmen_reader.h"
#include "clients/log/stamp_sorter.h"
#include "core/base/status.h"

namespace loci::cli {

struct PlayerFigures {
  std::size_t passed_over = 0;  // scans that the server had already
  std::size_t sent = 0;
  std::size_t moved = 0;  // by sorting
  std::size_t late = 0;   // too late to be sorted: the server refuses them
};

class LogPlayer {
 public:
  // `speed`: log time over wall time; nothing: as fast as the server takes it.
  LogPlayer(CarmenReader& reader, client::MappingSession& session, std::optional<double> speed)
      : reader_(reader), session_(session), speed_(speed) {}

  // Sends all scans of the log. Observation n of the session is the n-th scan in order of stamp, so
  // what the server has is passed over. An error of the log comes after all scans before it, except
  // those that wait for their order, have been sent: the session can go on later.
  Status Play(const std::function<void(const PlayerFigures&)>& on_scan);

  const PlayerFigures& figures() const { return figures_; }

 private:
  Status SendReady(const std::function<void(const PlayerFigures&)>& on_scan);
  void WaitForTurn(std::int64_t stamp_ns);

  CarmenReader& reader_;
  client::MappingSession& session_;
  std::optional<double> speed_;
  ObservationMaker maker_;
  StampSorter sorter_;
  PlayerFigures figures_;
  std::uint64_t number_ = 0;  // of the last scan taken from the sorter
  std::optional<std::int64_t> first_sent_ns_;
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace loci::cli
