// SPDX-License-Identifier: Apache-2.0
// What the kernel knows of this process (proc(5)).
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include <sys/resource.h>
#include <unistd.h>

#include "server/metrics/metrics.h"

namespace loci {
namespace {

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

// The second number of /proc/self/statm: pages that are in memory.
double ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0.0;
  double resident_pages = 0.0;
  statm >> total_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double OpenFileCount() {
  std::error_code error;
  std::filesystem::directory_iterator file("/proc/self/fd", error);
  double count = 0.0;
  for (; !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
    count += 1.0;
  }
  return count;
}

}  // namespace

void CollectProcessMetrics(MetricsText& text) {
  rusage usage = {};
  if (getrusage(RUSAGE_SELF, &usage) == 0) {
    text.AddCounter("process_cpu_seconds_total",
                    "Processor time of this process, user and system.",
                    {},
                    Seconds(usage.ru_utime) + Seconds(usage.ru_stime));
  }
  text.AddGauge("process_resident_memory_bytes", "Memory in use.", {}, ResidentBytes());
  text.AddGauge("process_open_fds", "Open files and sockets.", {}, OpenFileCount());
}

}  // namespace loci
