#include "tools/scatter/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace scatter::cli {

Progress::Progress() : terminal_(isatty(STDERR_FILENO) == 1) {}
Progress::~Progress() {
  clear();
}

void Progress::show(double fraction, const std::string& what) {
  const int percent = int(std::lround(100 * std::clamp(fraction, 0.0, 1.0)));
  if (!terminal_ || (percent == percent_ && what == what_)) {
    return;
  }
  percent_ = percent;
  what_ = what;
  visible_ = true;
  constexpr int kWidth = 30;
  const auto full = std::size_t(percent * kWidth / 100);
  std::fprintf(stderr, "\r\033[K[%s%s] %3d %%  %s", std::string(full, '=').c_str(),
               std::string(kWidth - full, ' ').c_str(), percent, what.c_str());
  std::fflush(stderr);
}

void Progress::clear() {
  if (visible_) {
    std::fputs("\r\033[K", stderr);
    std::fflush(stderr);
    visible_ = false;
  }
}

}  // namespace scatter::cli
