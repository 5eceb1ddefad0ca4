#include <catch2/catch.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "protocol/link_decoder.h"
#include "simulator/faults/frame_faults.h"

using namespace scatter;
using namespace scatter::simulator;

namespace {

using Bytes = std::vector<std::byte>;

/// Frame number n of a test stream; its payload differs in length and content from its neighbours'.
Bytes frame(std::uint32_t n) {
  Bytes payload(n % 97 + 1, static_cast<std::byte>(n));
  Bytes out(payload.size() + protocol::kFrameOverhead);
  protocol::FrameHeader header;
  header.message = 0x0101;
  header.sequence = n;
  REQUIRE(protocol::write_frame(out, header, payload) == out.size());
  return out;
}

Bytes stream(std::uint32_t count) {
  Bytes all;
  for (std::uint32_t n = 0; n < count; ++n) {
    const Bytes one = frame(n);
    all.insert(all.end(), one.begin(), one.end());
  }
  return all;
}

struct Received {
  std::vector<std::uint32_t> sequences;
  protocol::LinkCounters counters;
};

Received decode(const Bytes& bytes) {
  Received received;
  Bytes buffer(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder(buffer);
  const auto take = [&](const protocol::Frame& one) { received.sequences.push_back(one.header().sequence); };
  decoder.push(bytes, take);
  decoder.give_up(take);
  received.counters = decoder.counters();
  return received;
}

struct Outcome {
  Bytes bytes;
  FaultCounts counts;
};

Outcome run(const LinkRates& rates, const Bytes& in, std::size_t piece, std::uint64_t seed = 1,
            Direction direction = Direction::kToHost) {
  FrameFaults faults(rates, seed, direction);
  Outcome outcome;
  for (std::size_t at = 0; at < in.size(); at += piece) {
    faults.pass(std::span(in).subspan(at, std::min(piece, in.size() - at)), 0, outcome.bytes);
  }
  faults.release_due(FrameFaults::kHoldUs, outcome.bytes);
  outcome.counts = faults.counts();
  CHECK_FALSE(faults.due_us().has_value());
  return outcome;
}

/// Six standard deviations of a binomial count: a chance of 2e-9 per check, and the seed is fixed.
void check_rate(std::uint64_t struck, std::uint64_t of, double rate) {
  const double mean = static_cast<double>(of) * rate;
  CHECK(std::abs(static_cast<double>(struck) - mean) < 6 * std::sqrt(mean * (1 - rate)));
}

constexpr std::uint32_t kFrames = 4000;

}  // namespace

TEST_CASE("Without faults every byte comes through, cut anyhow, garbage included") {
  Bytes in = stream(50);
  in.insert(in.begin() + 1000, 333, std::byte{0xA7});
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{64}, in.size()}) {
    CHECK(run({}, in, piece).bytes == in);
  }
}

TEST_CASE("The same seed gives the same faults whatever the pieces; another seed or direction gives others") {
  LinkRates rates;
  rates.drop = rates.corrupt = rates.duplicate = rates.reorder = rates.truncate = rates.garbage = 0.1;
  const Bytes in = stream(300);
  const Outcome whole = run(rates, in, in.size());
  CHECK(run(rates, in, 13).bytes == whole.bytes);
  CHECK(run(rates, in, in.size(), 2).bytes != whole.bytes);
  CHECK(run(rates, in, in.size(), 1, Direction::kToDevice).bytes != whole.bytes);
}

TEST_CASE("Drop removes whole frames at its rate and harms no other") {
  const Outcome outcome = run({.drop = 0.05}, stream(kFrames), 4096);
  const Received received = decode(outcome.bytes);
  CHECK(received.sequences.size() + outcome.counts.dropped == kFrames);
  CHECK(received.counters.skipped_bytes == 0);
  CHECK(std::ranges::is_sorted(received.sequences));
  check_rate(outcome.counts.dropped, kFrames, 0.05);
}

TEST_CASE("Corrupt damages a frame at its rate so that a decoder always notices") {
  const Outcome outcome = run({.corrupt = 0.05}, stream(kFrames), 4096);
  const Received received = decode(outcome.bytes);
  CHECK(outcome.counts.frames == kFrames);
  CHECK(received.sequences.size() == kFrames - outcome.counts.corrupted);
  CHECK(outcome.bytes.size() == stream(kFrames).size());
  check_rate(outcome.counts.corrupted, kFrames, 0.05);
}

TEST_CASE("Corrupt flips one to five bits") {
  const Bytes in = frame(90);
  std::array<int, 6> seen{};
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Bytes out = run({.corrupt = 1}, in, in.size(), seed).bytes;
    REQUIRE(out.size() == in.size());
    int flips = 0;
    for (std::size_t i = 0; i < in.size(); ++i) {
      flips += std::popcount(static_cast<unsigned>(in[i] ^ out[i]));
    }
    REQUIRE(flips >= 1);
    REQUIRE(flips <= 5);
    ++seen[static_cast<std::size_t>(flips)];
  }
  for (int flips = 1; flips <= 5; ++flips) {
    CHECK(seen[static_cast<std::size_t>(flips)] > 0);
  }
}

TEST_CASE("Duplicate repeats a frame right behind itself") {
  const Outcome outcome = run({.duplicate = 0.05}, stream(kFrames), 4096);
  const Received received = decode(outcome.bytes);
  CHECK(received.sequences.size() == kFrames + outcome.counts.duplicated);
  CHECK(std::ranges::is_sorted(received.sequences));
  check_rate(outcome.counts.duplicated, kFrames, 0.05);
}

TEST_CASE("Reorder swaps a frame with its successor and loses none") {
  const Outcome outcome = run({.reorder = 0.05}, stream(kFrames), 4096);
  Received received = decode(outcome.bytes);
  REQUIRE(received.sequences.size() == kFrames);
  std::uint64_t swapped = 0;
  for (std::uint32_t n = 0; n < kFrames; ++n) {
    swapped += received.sequences[n] > n ? 1 : 0;
    CHECK(std::abs(static_cast<int>(received.sequences[n]) - static_cast<int>(n)) <= 1);
  }
  CHECK(swapped == outcome.counts.reordered);
  CHECK(outcome.counts.reordered > 0);
}

TEST_CASE("A frame held for reordering goes on alone when no successor comes") {
  FrameFaults faults({.reorder = 1}, 1, Direction::kToHost);
  const Bytes in = frame(5);
  Bytes out;
  faults.pass(in, 1000, out);
  CHECK(out.empty());
  REQUIRE(faults.due_us() == 1000 + FrameFaults::kHoldUs);
  faults.release_due(1000 + FrameFaults::kHoldUs - 1, out);
  CHECK(out.empty());
  faults.release_due(1000 + FrameFaults::kHoldUs, out);
  CHECK(out == in);
}

TEST_CASE("Truncate cuts frames, and the next whole frame is still found") {
  const Outcome outcome = run({.truncate = 0.02}, stream(kFrames), 4096);
  const Received received = decode(outcome.bytes);
  CHECK(received.sequences.size() == kFrames - outcome.counts.truncated);
  check_rate(outcome.counts.truncated, kFrames, 0.02);
}

TEST_CASE("Garbage comes between frames and harms none") {
  const Outcome outcome = run({.garbage = 0.05}, stream(kFrames), 4096);
  const Received received = decode(outcome.bytes);
  CHECK(received.sequences.size() == kFrames);
  CHECK(received.counters.skipped_bytes >= outcome.counts.garbage_bursts);
  CHECK(received.counters.skipped_bytes <= 64 * outcome.counts.garbage_bursts);
  check_rate(outcome.counts.garbage_bursts, kFrames, 0.05);
}
