// vm_compare HERE THERE: whether two recordings hold the same device frames, byte for byte: pixels, metadata,
// and the device's own clock. Prints how many, or the first difference of each kind.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "host_sdk/device/recording_reader.h"
#include "protocol/codec.h"

using namespace scatter;

namespace {

struct Difference {
  std::size_t count = 0;
  std::size_t first = 0;
};

template <typename M>
std::vector<std::byte> encoded(const M& message) {
  std::vector<std::byte> bytes(protocol::encoded_size(message));
  if (!protocol::encode(message, std::span(bytes))) {
    bytes.clear();
  }
  return bytes;
}

/// Everything but readings of the device's clock, which goes on while a host is busy, and names made from the
/// host's.
protocol::FrameBegin without_clocks(protocol::FrameBegin begin) {
  begin.exposure_start_us = 0;
  begin.calibration_id = {};
  return begin;
}
protocol::FrameEnd without_clocks(protocol::FrameEnd end) {
  end.readout_end_us = 0;
  return end;
}

Result<std::vector<device::Frame>> frames_of(const char* path) {
  const auto reader = device::RecordingReader::open(path);
  if (!reader) {
    return std::unexpected(reader.error());
  }
  std::vector<device::Frame> frames;
  const Status walked = reader->for_each_frame([&](std::size_t, const device::Frame& frame) -> Status {
    frames.push_back(frame);
    return {};
  });
  if (!walked) {
    return std::unexpected(walked.error());
  }
  return frames;
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) {
    fmt::print("usage: vm_compare HERE THERE\n");
    return 2;
  }
  const auto here = frames_of(words[1]);
  const auto there = frames_of(words[2]);
  for (const auto* side : {&here, &there}) {
    if (!*side) {
      fmt::print("{}; {}\n", side->error().what, side->error().remedy);
      return 1;
    }
  }
  std::map<std::string, Difference> differences;
  const auto expect = [&](const char* what, std::size_t frame, bool same) {
    if (!same) {
      auto& difference = differences[what];
      difference.first = difference.count++ == 0 ? frame : difference.first;
    }
  };
  const std::size_t common = std::min(here->size(), there->size());
  std::size_t bytes = 0;
  for (std::size_t k = 0; k < common; ++k) {
    const auto& a = (*here)[k];
    const auto& b = (*there)[k];
    expect("status", k,
           a.status == device::FrameStatus::kComplete && b.status == device::FrameStatus::kComplete);
    expect("pixels", k, std::ranges::equal(a.bytes(), b.bytes()));
    expect("metadata before the pixels", k,
           encoded(without_clocks(a.begin)) == encoded(without_clocks(b.begin)));
    expect("metadata behind the pixels", k, encoded(without_clocks(a.end)) == encoded(without_clocks(b.end)));
    bytes += a.bytes().size();
  }
  if (here->size() != there->size() || common == 0) {
    fmt::print("{} frames against {}\n", here->size(), there->size());
    return 1;
  }
  for (const auto& [what, difference] : differences) {
    fmt::print("{} differ in {} of {} frames, first in {}\n", what, difference.count, common,
               difference.first);
  }
  if (differences.empty()) {
    fmt::print("{} frames of {} bytes are the same\n", common, bytes);
  }
  return differences.empty() ? 0 : 1;
}
