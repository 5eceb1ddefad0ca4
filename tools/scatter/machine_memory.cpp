#include "tools/scatter/machine_memory.h"

#include <unistd.h>

#include <cstdio>

namespace scatter::cli {

std::uint64_t available_memory() noexcept {
  if (std::FILE* const file = std::fopen("/proc/meminfo", "re"); file != nullptr) {
    char line[128];
    unsigned long long kilobytes = 0;
    bool found = false;
    while (!found && std::fgets(line, sizeof line, file) != nullptr) {
      found = std::sscanf(line, "MemAvailable: %llu kB", &kilobytes) == 1;  // NOLINT(cert-err34-c)
    }
    std::fclose(file);
    if (found) {
      return std::uint64_t{kilobytes} * 1024;
    }
  }
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long size = sysconf(_SC_PAGESIZE);
  return pages > 0 && size > 0 ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(size) : 0;
}

}  // namespace scatter::cli
