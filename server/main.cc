// SPDX-License-Identifier: Apache-2.0
// locid: runs a server in the foreground until it is told to stop.
#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <thread>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "server/base/mutex.h"
#include "server/rpc/frame.h"
#include "server/server.h"

namespace {

// What is acknowledged is durable: a stop that takes longer than this may end anywhere.
constexpr std::chrono::milliseconds kStopMax{4500};

constexpr int kExitOk = 0;
constexpr int kExitRefused = 1;
constexpr int kExitUsage = 2;

// One line per event, key=value, on standard error.
void StartLog(bool verbose) {
  auto logger = spdlog::stderr_logger_mt("locid");
  logger->set_pattern("time=%Y-%m-%dT%H:%M:%S.%eZ level=%l %v", spdlog::pattern_time_type::utc);
  logger->set_level(verbose ? spdlog::level::debug : spdlog::level::info);
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(logger);
  loci::SilenceParser();
}

// Signals that end the server are waited for by one thread; a full disk or a lost peer is an error
// of the call that meets it.
sigset_t PrepareSignals() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGINT);
  sigaddset(&ending, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);  // threads started later inherit it
  return ending;
}

// Every connection and every map needs file descriptors; the usual soft limit is 1024.
void RaiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < limit.rlim_max) {
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0) {
      spdlog::warn("event=file_limit_kept soft={}", limit.rlim_cur);
    }
  }
}

// Ends the process if it lives longer than kStopMax.
class StopWatchdog {
 public:
  StopWatchdog() : thread_([this] { Run(); }) {}
  ~StopWatchdog() {
    {
      const loci::MutexLock lock(mutex_);
      done_ = true;
      changed_.NotifyAll();
    }
    thread_.join();
  }

 private:
  void Run() {
    const auto deadline = std::chrono::steady_clock::now() + kStopMax;
    const loci::MutexLock lock(mutex_);
    while (!done_) {
      if (!changed_.WaitUntil(mutex_, deadline) && !done_) {
        spdlog::warn("event=stop_cut_short after_ms={} lost=nothing", kStopMax.count());
        std::_Exit(kExitOk);
      }
    }
  }

  loci::Mutex mutex_;
  loci::ConditionVariable changed_;
  bool done_ LOCI_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

int Serve(const loci::ServerOptions& options) {
  const sigset_t ending = PrepareSignals();
  RaiseFileLimit();
  loci::StatusOr<std::unique_ptr<loci::Server>> server = loci::Server::Start(options);
  if (!server.ok()) {
    std::fprintf(stderr, "locid: %s\n", server.status().ToString().c_str());
    return kExitRefused;
  }
  const std::string http = (*server)->http_endpoint().empty() ? "off" : (*server)->http_endpoint();
  std::printf("listening rpc=%s http=%s\n", (*server)->rpc_endpoint().c_str(), http.c_str());
  std::fflush(stdout);
  spdlog::info("event=started version={} data={} rpc={} http={}",
               options.version,
               options.data.string(),
               (*server)->rpc_endpoint(),
               http);
  int signal = 0;
  while (sigwait(&ending, &signal) != 0) {
  }
  spdlog::info("event=stopping signal={}", signal);
  const StopWatchdog watchdog;
  (*server)->Stop();
  spdlog::info("event=stopped");
  return kExitOk;
}

int Run(int argc, char** argv) {
  loci::ServerOptions options;
  options.version = LOCI_VERSION;
  std::string data;
  bool verbose = false;
  CLI::App app("locid: keeps and serves the maps of a data directory.", "locid");
  app.set_version_flag("--version", "locid " LOCI_VERSION);
  app.add_option("--data", data, "Directory of the maps; made if it is missing")
      ->required()
      ->type_name("DIR");
  app.add_option(
         "--listen", options.listen, "Where robots and clients call; port 0 takes a free one")
      ->capture_default_str()
      ->type_name("tcp://HOST:PORT");
  app.add_option("--http",
                 options.http,
                 "Where browsers and monitoring call; port 0 takes a free one; \"off\" for none")
      ->capture_default_str()
      ->type_name("HOST:PORT");
  app.add_option("--checkpoint-events",
                 options.limits.host.checkpoint_events,
                 "A map's state is written after so many events: fewer make a start after a kill "
                 "quicker, and write more")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 32U))
      ->type_name("N");
  app.add_flag("--insecure",
               options.insecure,
               "Allow addresses that other machines can reach: nothing is encrypted, and everyone "
               "may read, write and delete maps");
  app.add_flag("--verbose", verbose, "Log more");
  app.footer(
      "Exit codes: 0 stopped by SIGINT or SIGTERM; 1 refused (address, directory); 2 usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  if (options.http == "off") {
    options.http.clear();
  }
  options.data = data;
  if (const loci::Status status = loci::CheckEndpoints(options); !status.ok()) {
    std::fprintf(
        stderr, "locid: %s\nRun with --help for more information.\n", status.message().c_str());
    return kExitUsage;
  }
  StartLog(verbose);
  return Serve(options);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "locid: %s\n", error.what());
    return kExitRefused;
  }
}
