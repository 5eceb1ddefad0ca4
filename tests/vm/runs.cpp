// vm_runs URI RUNS FRAMES [SIDE]: RUNS measurements of FRAMES frames of SIDE x SIDE pixels of the counter
// pattern, one after another in one session. Each must end as asked, hold every frame with every pixel right,
// and have a ledger that balances. Prints "streaming" with the first frame, and how it ended.
#include <chrono>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "tests/vm/host.h"

using namespace scatter;

namespace {

protocol::Recipe recipe(std::uint16_t frames, std::uint16_t side) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.repeats = frames;
  recipe.region_width = recipe.region_height = side;
  recipe.test_pattern = 1;
  return recipe;
}

/// Pixels that differ from (frame * 7919 + index) mod 2^bits (SPEC.md, test pattern).
std::size_t wrong_pixels(const device::Frame& frame) {
  std::vector<std::uint16_t> pixels(frame.pixel_count());
  if (!device::unpack(frame, pixels)) {
    return pixels.size();
  }
  const std::uint32_t mask = (1U << frame.begin.bits) - 1;
  std::size_t wrong = 0;
  for (std::uint32_t k = 0; k < pixels.size(); ++k) {
    wrong += pixels[k] == ((frame.begin.frame_id * 7919 + k) & mask) ? 0 : 1;
  }
  return wrong;
}

bool run(device::Device& device, std::uint16_t frames, std::uint16_t side, int& status) {
  const auto fails = [&](const Error& error) {
    status = vm::report(error);
    return false;
  };
  if (const auto configured = device.configure(recipe(frames, side)); !configured) {
    return fails(configured.error());
  }
  auto stream = device.start();
  if (!stream) {
    return fails(stream.error());
  }
  std::size_t got = 0;
  std::size_t wrong = 0;
  while (true) {
    const auto frame = stream->next();
    if (!frame) {
      return fails(frame.error());
    }
    if (!*frame) {
      break;
    }
    wrong += (*frame)->status == device::FrameStatus::kComplete ? wrong_pixels(**frame) : 1;
    if (got++ == 0 && frames > 2) {
      fmt::print("streaming\n");
      std::fflush(stdout);
    }
  }
  const auto summary = stream->summary();
  const auto& ledger = summary.ledger;
  const bool whole = summary.reason == protocol::RunEnd::kCompleted && got == frames &&
                     ledger.exposed == frames && ledger.delivered == frames;
  if (!ledger.balances() || wrong != 0 || !whole) {
    fmt::print(
        "ended with reason {}, {} of {} frames, {} wrong pixels; exposed {} delivered {} lost {} {} {} {} "
        "corrupt {}, {}\n",
        static_cast<int>(summary.reason), got, frames, wrong, ledger.exposed, ledger.delivered,
        ledger.lost_sensor, ledger.lost_firmware, ledger.lost_link, ledger.lost_host, ledger.corrupt,
        ledger.balances() ? "balanced" : "NOT balanced");
    status = 1;
    return false;
  }
  return true;
}

}  // namespace

int main(int count, char** words) {
  if (count < 4) {
    fmt::print("usage: vm_runs URI RUNS FRAMES [SIDE]\n");
    return 2;
  }
  const auto host = vm::Host::make();
  if (!host) {
    return vm::report(host.error());
  }
  auto device = host->open(words[1]);
  if (!device) {
    return vm::report(device.error());
  }
  const int runs = std::atoi(words[2]);
  const auto frames = static_cast<std::uint16_t>(std::atoi(words[3]));
  const auto side = static_cast<std::uint16_t>(count > 4 ? std::atoi(words[4]) : 64);
  int status = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (int k = 0; k < runs; ++k) {
    if (!run(*device, frames, side, status)) {
      fmt::print("run {} of {}\n", k + 1, runs);
      return status;
    }
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto link = device->link_statistics();
  fmt::print(
      "{} runs of {} frames, ledgers balanced; {:.1f} ms each; {} bytes, {} copied to put frames together\n",
      runs, frames, took.count() * 1000 / runs, link.bytes, link.copied_bytes);
  return 0;
}
