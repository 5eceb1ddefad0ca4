// A host that speaks bare wire frames: for tests of the instrument below the SDK.
#pragma once

#include <catch2/catch.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "protocol/link_decoder.h"
#include "simulator/instrument/virtual_instrument.h"

namespace scatter::simulator {

inline std::shared_ptr<VirtualInstrument> instrument_of(std::string_view query) {
  auto options = parse_instrument_options(query);
  REQUIRE(options.has_value());
  auto instrument = VirtualInstrument::make(*options);
  REQUIRE(instrument.has_value());
  return std::move(*instrument);
}

class RawHost {
 public:
  explicit RawHost(VirtualInstrument& instrument, std::uint16_t nonce = 77)
      : instrument_(instrument), nonce_(nonce) {
    instrument_.attach();
  }

  template <typename M>
  std::uint16_t send(const M& message, protocol::Channel channel = protocol::Channel::kControl) {
    std::vector<std::byte> bytes(protocol::kMaxFrameBytes);
    const bool control = channel == protocol::Channel::kControl;
    bytes.resize(protocol::write_message(bytes,
                                         {.channel = channel,
                                          .sequence = sequence_++,
                                          .session = nonce_,
                                          .correlation = control ? ++correlation_ : std::uint16_t{0}},
                                         message));
    REQUIRE(instrument_.host_write(bytes) == bytes.size());
    return correlation_;
  }

  /// Runs for `patience_us` and gives every frame to `on_frame` until it returns true.
  void listen(const std::function<bool(const protocol::Frame&)>& on_frame,
              std::uint64_t patience_us = 2'000'000) {
    const std::uint64_t deadline = instrument_.now_us() + patience_us;
    std::vector<std::byte> bytes(64 * 1024);
    bool done = false;
    while (!done) {
      instrument_.run_until(deadline);
      const std::size_t count = instrument_.host_read(bytes);
      transcript.insert(transcript.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      decoder_.push(std::span(bytes).first(count),
                    [&](const protocol::Frame& frame) { done = on_frame(frame) || done; });
      if (count == 0 && (instrument_.now_us() >= deadline || !instrument_.attached())) {
        return;
      }
    }
  }

  /// Sends a request and gives its reply of type R, if that is what comes.
  template <typename R, typename M>
  std::optional<R> ask(const M& message) {
    const std::uint16_t correlation = send(message);
    std::optional<R> reply;
    listen([&](const protocol::Frame& frame) {
      if (frame.header().correlation != correlation) {
        return false;
      }
      reply = frame.as<R>();
      const auto status = frame.as<protocol::StatusReply>();
      return !status || status->status != protocol::StatusCode::kPending;
    });
    return reply;
  }

  std::vector<std::byte> transcript;  ///< Everything that the device said.

 private:
  VirtualInstrument& instrument_;
  std::uint16_t nonce_;
  std::uint32_t sequence_ = 0;
  std::uint16_t correlation_ = 0;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder_{buffer_};
};

}  // namespace scatter::simulator
