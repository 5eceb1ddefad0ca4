#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>

#include "host_sdk/device/recording_writer.h"
#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

struct Recorded {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("scatter-replay-" + std::to_string(::getpid()) + ".scat");
  std::vector<std::vector<Frame>> live;
  std::vector<RunSummary> summaries;

  explicit Recorded(const std::vector<std::uint16_t>& runs, bool lossy = false) {
    Pair pair = open_pair([lossy](ScriptedDevice& device) {
      if (lossy) {
        device.script.outgoing = [index = 0](const protocol::FrameHeader& header, Bytes frame) mutable {
          const bool lost = header.channel == protocol::Channel::kStream && index++ % 9 == 4;
          return lost ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(frame)};
        };
      }
    });
    REQUIRE(pair.host);
    Result<RecordingWriter> writer = RecordingWriter::create(path, {.creation_unix_ns = 1, .tool = "t"});
    REQUIRE(writer);
    for (const std::uint16_t frames : runs) {
      REQUIRE(pair.host->configure(test_recipe(frames)));
      Result<Stream> stream = pair.host->start({.recorder = &*writer, .credit_window = 4});
      REQUIRE(stream);
      live.push_back(drain(*stream));
      summaries.push_back(stream->summary());
    }
    REQUIRE(writer->finish());
  }
  ~Recorded() { std::filesystem::remove(path); }
  Recorded(const Recorded&) = delete;
  Recorded& operator=(const Recorded&) = delete;
  [[nodiscard]] std::string uri() const { return "replay:" + path.string(); }
};

// PROVES: protocol.md 6, a recording replays through the same SDK code as a live device.
TEST_CASE("A replay gives the live frames, losses and ledger, through the same calls") {
  for (const bool lossy : {false, true}) {
    const Recorded recorded({4, 7}, lossy);
    Result<Device> device = Device::open(recorded.uri());
    REQUIRE(device);
    CHECK(device->hello().serial.str() == "TEST-1");
    CHECK(device->descriptor() == test_descriptor());
    CHECK(device->read_object(protocol::ObjectId::kPrnuMap)->size() == kWidth * kHeight);
    for (std::size_t run : {1U, 0U, 1U}) {
      const auto configured = device->configure(test_recipe(run == 0 ? 4 : 7));
      REQUIRE(configured);
      CHECK(configured->planned_frames == (run == 0 ? 4 : 7));
      Result<Stream> stream = device->start({.recorder = nullptr, .credit_window = 2});
      REQUIRE(stream);
      const std::vector<Frame> frames = drain(*stream);
      REQUIRE(frames.size() == recorded.live[run].size());
      for (std::size_t k = 0; k < frames.size(); ++k) {
        const Frame& live = recorded.live[run][k];
        CHECK(frames[k].status == live.status);
        CHECK(frames[k].missing == live.missing);
        CHECK(frames[k].begin.frame_id == live.begin.frame_id);
        REQUIRE(frames[k].bytes().size() == live.bytes().size());
        CHECK(std::memcmp(frames[k].bytes().data(), live.bytes().data(), live.bytes().size()) == 0);
      }
      CHECK(stream->summary().ledger == recorded.summaries[run].ledger);
      CHECK(stream->summary().reason == recorded.summaries[run].reason);
    }
  }
}

TEST_CASE("A replay starts without configuring: its own configuration is in force") {
  const Recorded recorded({3});
  Result<Device> device = Device::open(recorded.uri());
  REQUIRE(device);
  Result<Stream> stream = device->start();
  REQUIRE(stream);
  CHECK(drain(*stream).size() == 3);
}

TEST_CASE("A replay refuses what a recording cannot do, with a remedy") {
  const Recorded recorded({3});
  Result<Device> device = Device::open(recorded.uri());
  REQUIRE(device);
  const auto other = device->configure(test_recipe(99));
  REQUIRE_FALSE(other);
  CHECK(other.error().code == ErrorCode::kFailedPrecondition);
  CHECK(other.error().what.find("a recording cannot") != std::string::npos);
  const Status set = device->set_key_value("name", "x");
  REQUIRE_FALSE(set);
  CHECK(set.error().code == ErrorCode::kFailedPrecondition);
  CHECK(device->read_object(protocol::ObjectId::kHotPixels).error().code == ErrorCode::kNotFound);
}

TEST_CASE("A replay of a run that was cut off ends, and its ledger balances") {
  const Recorded recorded({5});
  std::filesystem::resize_file(recorded.path, std::filesystem::file_size(recorded.path) / 2);
  Result<Device> device = Device::open(recorded.uri());
  REQUIRE(device);
  Result<Stream> stream = device->start();
  REQUIRE(stream);
  const std::vector<Frame> frames = drain(*stream);
  CHECK(frames.size() < 5);
  CHECK(stream->summary().reason == protocol::RunEnd::kHostGone);
  CHECK(stream->summary().ledger.balances());
}

TEST_CASE("A replay can be stopped and started again") {
  const Recorded recorded({50});
  Result<Device> device = Device::open(recorded.uri());
  REQUIRE(device);
  {
    Result<Stream> stream = device->start({.recorder = nullptr, .credit_window = 2});
    REQUIRE(stream);
    REQUIRE(stream->next());
    const Result<RunSummary> summary = stream->abort();
    REQUIRE(summary);
    CHECK(summary->ledger.balances());
  }
  Result<Stream> again = device->start();
  REQUIRE(again);
  CHECK(drain(*again).size() == 50);
}

}  // namespace
}  // namespace scatter::device::test
