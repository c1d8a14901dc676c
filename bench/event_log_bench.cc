// SPDX-License-Identifier: Apache-2.0
// The event log: durable batches per second, from many sessions through one group commit.
//
//   event_log_bench [--seconds S] [--directory DIR] [--tiny]
//
// Each session sends a batch and waits until it is durable, then sends the next. One thread appends
// all batches that wait, in one transaction. In the same run, as the measure of the disk: one write
// of a batch's bytes and one fdatasync, again and again.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "core/base/random.h"
#include "core/engine/event.h"
#include "storage/sqlite/sqlite_store.h"

namespace loci {
namespace {

using Clock = std::chrono::steady_clock;

struct Arguments {
  double seconds = 3.0;
  std::filesystem::path directory = std::filesystem::temp_directory_path();
  std::size_t checkpoint_record_count = 400;
};

// An observation with 181 beams of a laser, as the log stores it.
std::string ObservationBytes() {
  RandomSequence random(1);
  ObservationEvent event;
  event.number = 1;
  event.odometry = Odometry{.previous_from_robot = {0.1, 0.0, 0.01}, .covariance_upper = {}};
  LaserScan scan;
  scan.angle_step_rad = kPi / 180.0;
  for (int i = 0; i < 181; ++i) {
    scan.ranges_mm.push_back(static_cast<std::uint16_t>(random.NextBits() % 10'000));
  }
  event.scan = scan;
  return EncodeEvent(event);
}

// Sessions hand in batches of the same bytes; one thread makes them durable in groups.
class GroupCommit {
 public:
  GroupCommit(MapStore& store, std::size_t observations, std::string bytes)
      : store_(&store), observations_(observations), bytes_(std::move(bytes)) {
    next_ = store.LastEvent().value + 1;
    writer_ = std::thread([this] { Write(); });
  }
  ~GroupCommit() {
    {
      const std::lock_guard held(mutex_);
      stop_ = true;
    }
    work_.notify_one();
    writer_.join();
  }

  // Returns when the batch is durable.
  void AppendBatch() {
    std::unique_lock held(mutex_);
    const std::uint64_t mine = ++handed_in_;
    work_.notify_one();
    durable_changed_.wait(held, [&] { return durable_ >= mine; });
  }

  std::uint64_t groups() const { return groups_; }

 private:
  void Write() {
    std::unique_lock held(mutex_);
    for (;;) {
      work_.wait(held, [&] { return stop_ || handed_in_ > durable_; });
      if (handed_in_ == durable_) {
        return;
      }
      const std::uint64_t until = handed_in_;
      const std::uint64_t count = (until - durable_) * observations_;
      held.unlock();
      std::vector<LogEntry> entries;
      for (std::uint64_t i = 0; i < count; ++i) {
        entries.push_back({.number = {next_++}, .bytes = bytes_});
      }
      const Status status = store_->Append(entries);
      if (!status.ok()) {
        std::fprintf(stderr, "%s\n", status.ToString().c_str());
        std::exit(1);
      }
      held.lock();
      durable_ = until;
      ++groups_;
      durable_changed_.notify_all();
    }
  }

  MapStore* store_;
  const std::size_t observations_;
  const std::string bytes_;
  std::uint64_t next_ = 1;
  std::mutex mutex_;
  std::condition_variable work_;
  std::condition_variable durable_changed_;
  std::uint64_t handed_in_ = 0;
  std::uint64_t durable_ = 0;
  std::uint64_t groups_ = 0;
  bool stop_ = false;
  std::thread writer_;
};

struct Figures {
  double batches_per_second = 0.0;
  double batches_per_group = 0.0;
  double p50_ms = 0.0;
  double p99_ms = 0.0;
};

double MillisecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

Figures Summarize(std::vector<double>& waits_ms, double seconds, std::uint64_t groups) {
  std::sort(waits_ms.begin(), waits_ms.end());
  const std::size_t count = waits_ms.size();
  Figures figures;
  if (count > 0) {
    figures.batches_per_second = static_cast<double>(count) / seconds;
    figures.batches_per_group = static_cast<double>(count) / static_cast<double>(groups);
    figures.p50_ms = waits_ms[count / 2];
    figures.p99_ms = waits_ms[count * 99 / 100];
  }
  return figures;
}

Figures MeasureSessions(MapStore& store, int sessions, std::size_t observations, double seconds) {
  std::vector<std::vector<double>> waits_ms(static_cast<std::size_t>(sessions));
  const Clock::time_point begin = Clock::now();
  std::uint64_t groups = 0;
  {
    GroupCommit commit(store, observations, ObservationBytes());
    std::vector<std::thread> threads;
    for (std::vector<double>& own : waits_ms) {
      threads.emplace_back([&commit, &own, begin, seconds] {
        while (MillisecondsSince(begin) < seconds * 1e3) {
          const Clock::time_point sent = Clock::now();
          commit.AppendBatch();
          own.push_back(MillisecondsSince(sent));
        }
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
    groups = commit.groups();
  }
  const double took_s = MillisecondsSince(begin) / 1e3;
  std::vector<double> all;
  for (const std::vector<double>& own : waits_ms) {
    all.insert(all.end(), own.begin(), own.end());
  }
  return Summarize(all, took_s, groups);
}

Figures MeasureDisk(const std::filesystem::path& file, std::size_t size, double seconds) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const std::string bytes(size, 'x');
  std::vector<double> waits_ms;
  const Clock::time_point begin = Clock::now();
  while (MillisecondsSince(begin) < seconds * 1e3) {
    const Clock::time_point sent = Clock::now();
    if (::write(descriptor, bytes.data(), bytes.size()) < 0 || ::fdatasync(descriptor) != 0) {
      std::perror("event_log_bench");
      std::exit(1);
    }
    waits_ms.push_back(MillisecondsSince(sent));
  }
  ::close(descriptor);
  return Summarize(waits_ms, seconds, waits_ms.size());
}

// Writes checkpoints of grids, one after the other, until `stop`.
void WriteCheckpoints(MapStore& store, std::size_t record_count, const std::atomic<bool>& stop) {
  RandomSequence random(2);
  while (!stop) {
    const EventNumber last = store.LastEvent();
    CheckpointChanges changes{.last_event = last, .state_digest = "", .written = {}, .removed = {}};
    for (std::size_t id = 0; id < record_count; ++id) {
      std::string grid(50'000, '\0');
      for (std::size_t i = 0; i < grid.size(); i += 2) {
        grid[i] = static_cast<char>(random.NextBits());
      }
      changes.written.push_back({.kind = 1, .id = id, .bytes = std::move(grid)});
    }
    const Status status = store.WriteCheckpoint(changes);
    if (!status.ok() && status.code() != StatusCode::kFailedPrecondition) {
      std::fprintf(stderr, "%s\n", status.ToString().c_str());
      std::exit(1);
    }
  }
}

void Print(const char* what, std::size_t observations, const Figures& figures) {
  std::printf("| %-34s | %12zu | %9.0f | %9.1f | %8.3f | %8.3f |\n",
              what,
              observations,
              figures.batches_per_second,
              figures.batches_per_group,
              figures.p50_ms,
              figures.p99_ms);
}

int Run(const Arguments& arguments) {
  const std::filesystem::path directory =
      arguments.directory / ("loci-event-log-bench-" + std::to_string(::getpid()));
  {
    StatusOr<std::unique_ptr<StoreDirectory>> opened = OpenSqliteDirectory(directory);
    if (!opened.ok()) {
      std::fprintf(stderr, "%s\n", opened.status().ToString().c_str());
      return 1;
    }
    std::printf("event: %zu bytes; %.1f s each; in %s\n",
                ObservationBytes().size(),
                arguments.seconds,
                arguments.directory.c_str());
    std::printf("| %-34s | observations | batches/s | per group | p50 (ms) | p99 (ms) |\n", "");
    std::printf("|---|---:|---:|---:|---:|---:|\n");
    for (const std::size_t observations : {std::size_t{1}, std::size_t{10}}) {
      Print("the disk: write, fdatasync",
            observations,
            MeasureDisk(
                directory / "file", ObservationBytes().size() * observations, arguments.seconds));
      const std::string name = "map-" + std::to_string(observations);
      const std::unique_ptr<MapStore> store = std::move((*opened)->Create(name)).value();
      Print("1 session", observations, MeasureSessions(*store, 1, observations, arguments.seconds));
      Print("64 sessions",
            observations,
            MeasureSessions(*store, 64, observations, arguments.seconds));
      std::atomic<bool> stop = false;
      std::thread checkpoints(
          [&] { WriteCheckpoints(*store, arguments.checkpoint_record_count, stop); });
      Print("64 sessions while checkpointing",
            observations,
            MeasureSessions(*store, 64, observations, arguments.seconds));
      stop = true;
      checkpoints.join();
    }
  }
  std::filesystem::remove_all(directory);
  return 0;
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  loci::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--tiny") == 0) {
      arguments.seconds = 0.02;
      arguments.checkpoint_record_count = 4;
    } else if (std::strcmp(argv[i], "--seconds") == 0 && has_value) {
      arguments.seconds = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--directory") == 0 && has_value) {
      arguments.directory = argv[++i];
    } else {
      std::fprintf(stderr, "usage: event_log_bench [--seconds S] [--directory DIR] [--tiny]\n");
      return 2;
    }
  }
  return loci::Run(arguments);
}
