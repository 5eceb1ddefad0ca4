// A host for the firmware's tests: sends requests, keeps everything that comes back in order, and runs
// the instrument over virtual time.
#pragma once

#include <catch2/catch.hpp>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "firmware/core/instrument.h"
#include "protocol/crc.h"
#include "protocol/link_decoder.h"
#include "tests/unit/firmware/fake_board.h"

namespace scatter::firmware::fake {

struct Received {
  protocol::FrameHeader header;
  std::vector<std::byte> payload;
  std::uint64_t at_us = 0;
  template <protocol::Message M>
  [[nodiscard]] M as() const {
    REQUIRE(header.id() == M::kId);
    const auto message = protocol::decode<M>(payload);
    REQUIRE(message.has_value());
    return *message;
  }
};

struct HostFrame {
  protocol::FrameBegin begin;
  std::vector<std::byte> bytes;
  std::optional<protocol::FrameEnd> end;
};

class FakeHost {
 public:
  explicit FakeHost(FakeBoard& board)
      : board_(board), ports_(board.ports()), instrument_(std::make_unique<Instrument>(ports_)) {}

  /// Talks to something else than an Instrument on the same board.
  FakeHost(FakeBoard& board, std::function<Step()> device)
      : board_(board), ports_(board.ports()), device_(std::move(device)) {}

  Instrument& instrument() { return *instrument_; }
  std::vector<Received> received;
  std::vector<HostFrame> frames;
  std::uint16_t session = 0x1234;
  bool reading = true;  ///< False: the host does not take bytes off the link.

  /// Restarts the firmware over the same board (flash stays).
  void reboot() {
    instrument_ = std::make_unique<Instrument>(ports_);
    decoder_.reset();
  }

  template <protocol::Message M>
  std::uint16_t send(const M& message, protocol::Channel channel = protocol::Channel::kControl) {
    const std::uint16_t correlation = channel == protocol::Channel::kControl ? ++correlation_ : 0;
    send_as(message, correlation, channel);
    return correlation;
  }
  template <protocol::Message M>
  void send_as(const M& message, std::uint16_t correlation,
               protocol::Channel channel = protocol::Channel::kControl) {
    protocol::FrameHeader header;
    header.channel = channel;
    header.session = session;
    header.correlation = correlation;
    std::vector<std::byte> bytes(protocol::encoded_size(message) + protocol::kFrameOverhead);
    REQUIRE(protocol::write_message(bytes, header, message) == bytes.size());
    board_.link.to_device.insert(board_.link.to_device.end(), bytes.begin(), bytes.end());
  }
  void grant(std::uint32_t run_id, std::uint32_t until) {
    send(protocol::Credit{.run_id = run_id, .may_send_until = until}, protocol::Channel::kEvent);
  }

  /// One poll; takes what it sent. True when something happened.
  bool poll() {
    const Step step = device_ ? device_() : instrument_->poll();
    wake_us_ = step.wake_at_us;
    return take() || step.did_work;
  }
  /// Polls until nothing happens, at one moment of time.
  void settle() {
    for (int i = 0; i < 100'000; ++i) {
      if (!poll()) {
        return;
      }
    }
    FAIL("the firmware never comes to rest");
  }
  /// Runs until `done` or for `us` of virtual time.
  template <typename Done>
  bool run(std::uint64_t us, Done done) {
    const std::uint64_t end = board_.clock.time_us + us;
    for (;;) {
      settle();
      if (done()) {
        return true;
      }
      if (board_.clock.time_us >= end) {
        return false;
      }
      REQUIRE(wake_us_ > 0);
      board_.clock.time_us = std::min(end, std::max(wake_us_, board_.clock.time_us + 1));
    }
  }
  void run_for(std::uint64_t us) {
    run(us, [] { return false; });
  }

  /// Replies to a correlation, PENDING included, in order.
  [[nodiscard]] std::vector<Received> replies(std::uint16_t correlation) const {
    std::vector<Received> found;
    for (const Received& r : received) {
      if (r.header.channel == protocol::Channel::kControl && r.header.correlation == correlation) {
        found.push_back(r);
      }
    }
    return found;
  }
  [[nodiscard]] static bool is_pending(const Received& r) {
    return r.header.id() == protocol::MessageId::kStatusReply &&
           r.as<protocol::StatusReply>().status == protocol::StatusCode::kPending;
  }
  [[nodiscard]] std::optional<Received> final_reply(std::uint16_t correlation) const {
    for (const Received& r : replies(correlation)) {
      if (!is_pending(r)) {
        return r;
      }
    }
    return std::nullopt;
  }
  /// Sends and waits for the final reply.
  template <protocol::Message M>
  Received ask(const M& message, std::uint64_t within_us = 10'000'000) {
    const std::uint16_t correlation = send(message);
    REQUIRE(run(within_us, [&] { return final_reply(correlation).has_value(); }));
    return *final_reply(correlation);
  }
  template <protocol::Message M>
  protocol::StatusCode status_of(const M& message) {
    return ask(message).template as<protocol::StatusReply>().status;
  }
  template <protocol::Message M>
  [[nodiscard]] std::vector<M> all() const {
    std::vector<M> found;
    for (const Received& r : received) {
      if (r.header.id() == M::kId) {
        found.push_back(r.as<M>());
      }
    }
    return found;
  }

  protocol::HelloReply hello() {
    protocol::Hello message;
    message.max_payload = max_payload;
    return ask(message).as<protocol::HelloReply>();
  }
  std::uint32_t configure(const protocol::Recipe& recipe) {
    return ask(protocol::SetConfiguration{.recipe = recipe}).as<protocol::ConfigurationAccepted>().epoch;
  }
  std::uint32_t start(std::uint32_t epoch, std::uint32_t credit = 0x7000'0000) {
    return ask(protocol::Start{.epoch = epoch, .may_send_until = credit}).as<protocol::Started>().run_id;
  }
  /// Configuration, start, and the run to its end.
  protocol::RunFinished measure(const protocol::Recipe& recipe, std::uint64_t within_us = 60'000'000) {
    const std::size_t before = all<protocol::RunFinished>().size();
    start(configure(recipe));
    REQUIRE(run(within_us, [&] { return all<protocol::RunFinished>().size() > before; }));
    return all<protocol::RunFinished>().back();
  }
  std::uint32_t max_payload = 16384;

 private:
  bool take() {
    if (!reading || board_.link.to_host.empty()) {
      return false;
    }
    decoder_.push(board_.link.to_host, [this](const protocol::Frame& frame) { keep(frame); });
    board_.link.to_host.clear();
    CHECK(decoder_.counters().skipped_bytes == 0);  // The device never sends garbage.
    return true;
  }
  void keep(const protocol::Frame& frame) {
    received.push_back(
        {frame.header(), {frame.payload().begin(), frame.payload().end()}, board_.clock.time_us});
    const Received& r = received.back();
    switch (frame.id()) {
      case protocol::MessageId::kFrameBegin:
        frames.push_back({r.as<protocol::FrameBegin>(), {}, std::nullopt});
        break;
      case protocol::MessageId::kFrameData: {
        REQUIRE(!frames.empty());
        const auto data = r.as<protocol::FrameData>();
        CHECK(data.frame_id == frames.back().begin.frame_id);
        CHECK(data.offset == frames.back().bytes.size());
        frames.back().bytes.insert(frames.back().bytes.end(), data.data.begin(), data.data.end());
        break;
      }
      case protocol::MessageId::kFrameEnd:
        REQUIRE(!frames.empty());
        frames.back().end = r.as<protocol::FrameEnd>();
        CHECK(frames.back().bytes.size() == frames.back().begin.total);
        CHECK(protocol::crc32c(frames.back().bytes) == frames.back().end->frame_crc);
        break;
      default:
        break;
    }
  }

  FakeBoard& board_;
  Ports ports_;
  std::unique_ptr<Instrument> instrument_;
  std::function<Step()> device_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder_{buffer_};
  std::uint16_t correlation_ = 0;
  std::uint64_t wake_us_ = 0;
};

/// A small fixed recipe.
inline protocol::Recipe fixed_recipe() {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.illuminations.push_back(4);
  recipe.exposures_us.push_back(1'000);
  recipe.exposures_us.push_back(20'000);
  recipe.repeats = 2;
  recipe.off_frames = 1;
  return recipe;
}

}  // namespace scatter::firmware::fake
