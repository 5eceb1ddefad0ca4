#include "host_sdk/images/exr_threads.h"

#include <OpenEXR/ImfThreading.h>

#include <algorithm>
#include <mutex>
#include <thread>

namespace scatter::images {

int exr_threads() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (Imf::globalThreadCount() == 0) {
      Imf::setGlobalThreadCount(static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 16U)));
    }
  });
  return Imf::globalThreadCount();
}

}  // namespace scatter::images
