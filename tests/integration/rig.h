// What the integration tests share: simulated instruments, in process and served, and one known run.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host_sdk/device/device.h"
#include "simulator/instrument/server.h"
#include "simulator/instrument/virtual_instrument.h"
#include "tools/sim_scheme/sim_scheme.h"

namespace scatter::integration {

inline std::shared_ptr<simulator::VirtualInstrument> instrument_of(std::string_view query) {
  auto options = simulator::parse_instrument_options(query);
  REQUIRE(options.has_value());
  auto instrument = simulator::VirtualInstrument::make(*options);
  REQUIRE(instrument.has_value());
  return std::move(*instrument);
}

/// A host on an instrument in this process.
inline Result<device::Device> open_on(const std::shared_ptr<simulator::VirtualInstrument>& instrument,
                                      const device::OpenOptions& options = {}) {
  return device::Device::open(tools::make_sim_transport(instrument), options);
}

/// A host on a URI, with this name and these schemes (null: the built-in ones).
inline Result<device::Device> open_uri(std::string_view uri,
                                       const device::TransportRegistry* registry = nullptr,
                                       const std::string& host_name = "test") {
  device::OpenOptions options;
  options.registry = registry;
  options.host_name = host_name;
  return device::Device::open(uri, options);
}

/// An instrument behind a socket, served by a thread of its own.
class Served {
 public:
  Served(std::string_view query, const std::string& address) : instrument_(instrument_of(query)) {
    auto server = simulator::Server::listen(address, *instrument_);
    REQUIRE(server.has_value());
    server_ = std::move(*server);
    thread_ = std::jthread([this](const std::stop_token& stop) { served_ = server_->serve(stop); });
  }
  ~Served() { stop(); }
  /// Ends the service and takes the socket away.
  void stop() {
    if (thread_.joinable()) {
      thread_.request_stop();
      thread_.join();
      CHECK(served_.has_value());
      statistics_ = server_->statistics();
      server_.reset();
    }
  }
  /// After stop().
  [[nodiscard]] simulator::Server::Statistics statistics() const { return statistics_; }
  [[nodiscard]] const std::string& address() const { return server_->address(); }

 private:
  std::shared_ptr<simulator::VirtualInstrument> instrument_;
  std::unique_ptr<simulator::Server> server_;
  Status served_;
  simulator::Server::Statistics statistics_;
  std::jthread thread_;
};

inline constexpr std::uint16_t kSide = 64;

/// Frames of the counter pattern, whose every pixel is known (SPEC.md): 8 KiB each.
inline protocol::Recipe pattern_recipe(std::uint16_t frames) {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.exposures_us.push_back(1000);
  recipe.repeats = frames;
  recipe.region_width = recipe.region_height = kSide;
  recipe.test_pattern = 1;
  return recipe;
}

/// Pixels of a complete pattern frame that differ from (frame * 7919 + index) mod 2^bits; all of them when it
/// cannot be unpacked. Any thread: it states nothing to the test framework.
inline std::size_t wrong_pixels(const device::Frame& frame) {
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

struct Outcome {
  std::vector<device::Frame> frames;
  std::size_t complete = 0;
  std::size_t wrong = 0;       ///< Wrong pixels in complete pattern frames.
  std::optional<Error> error;  ///< What ended the stream, if not the run's end.
  device::RunSummary summary;
};

/// Runs a recipe to its end or to the first error.
inline Outcome run(device::Device& device, const protocol::Recipe& recipe, const device::Wait& wait = {}) {
  Outcome outcome;
  const auto configured = device.configure(recipe, wait);
  if (!configured) {
    outcome.error = configured.error();
    return outcome;
  }
  auto stream = device.start({}, wait);
  if (!stream) {
    outcome.error = stream.error();
    return outcome;
  }
  while (true) {
    auto frame = stream->next(wait);
    if (!frame) {
      outcome.error = frame.error();
      break;
    }
    if (!*frame) {
      break;
    }
    if ((*frame)->status == device::FrameStatus::kComplete) {
      ++outcome.complete;
      outcome.wrong += recipe.test_pattern != 0 ? wrong_pixels(**frame) : 0;
    }
    outcome.frames.push_back(std::move(**frame));
  }
  outcome.summary = stream->summary();
  return outcome;
}

}  // namespace scatter::integration
