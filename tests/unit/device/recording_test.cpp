#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/device/recording_writer.h"
#include "protocol/crc.h"
#include "tests/unit/device/scripted_device.h"

namespace scatter::device::test {
namespace {

using namespace std::chrono_literals;

/// A path in a folder of this process, removed at the end.
class TemporaryFile {
 public:
  TemporaryFile()
      : path_(std::filesystem::temp_directory_path() /
              ("scatter-device-" + std::to_string(::getpid()) + "-" + std::to_string(count_++) + ".scat")) {}
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  static inline int count_ = 0;
  std::filesystem::path path_;
};

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  Bytes out(text.size());
  std::memcpy(out.data(), text.data(), text.size());
  return out;
}

/// Records runs of the given lengths; the live frames.
std::vector<std::vector<Frame>> record(const std::filesystem::path& path,
                                       const std::vector<std::uint16_t>& runs, bool finish = true,
                                       const std::function<void(ScriptedDevice&)>& prepare = {}) {
  Pair pair = open_pair(prepare);
  REQUIRE(pair.host);
  Result<RecordingWriter> writer =
      RecordingWriter::create(path, {.creation_unix_ns = pair.host->system_time_unix_ns(), .tool = "test 1"});
  REQUIRE(writer);
  REQUIRE(writer->attach("calibration/white", Bytes(1000, std::byte{0x5A})));
  std::vector<std::vector<Frame>> out;
  for (const std::uint16_t frames : runs) {
    REQUIRE(pair.host->configure(test_recipe(frames)));
    Result<Stream> stream = pair.host->start({.recorder = &*writer, .credit_window = 4});
    REQUIRE(stream);
    out.push_back(drain(*stream));
  }
  REQUIRE(writer->note("done", 5));
  if (finish) {
    REQUIRE(writer->finish());
  }
  return out;
}

bool same(const Frame& a, const Frame& b) {
  return a.status == b.status && a.missing == b.missing && a.has_begin == b.has_begin &&
         a.has_end == b.has_end && a.host_time_unix_ns == b.host_time_unix_ns &&
         a.begin.frame_id == b.begin.frame_id && a.begin.epoch == b.begin.epoch &&
         a.begin.run_id == b.begin.run_id && a.end.frame_crc == b.end.frame_crc &&
         a.bytes().size() == b.bytes().size() &&
         (a.bytes().empty() || std::memcmp(a.bytes().data(), b.bytes().data(), a.bytes().size()) == 0);
}

std::vector<Frame> frames_of(const RecordingReader& reader, std::size_t run) {
  Result<RunCursor> cursor = reader.frames(run);
  REQUIRE(cursor);
  std::vector<Frame> out;
  for (;;) {
    Result<std::optional<Frame>> frame = cursor->next();
    REQUIRE(frame);
    if (!*frame) {
      CHECK(cursor->summary().ledger.balances());
      return out;
    }
    out.push_back(std::move(**frame));
  }
}

TEST_CASE("A recording gives back the live frames, attachments, runs and ledgers") {
  const TemporaryFile file;
  const auto live = record(file.path(), {3, 5});
  const Result<RecordingReader> reader = RecordingReader::open(file.path());
  REQUIRE(reader);
  CHECK(reader->integrity().perfect());
  CHECK(reader->verify().perfect());
  CHECK(reader->info().creation_unix_ns == ScriptedDevice::kUnixStart);
  CHECK(reader->info().tool == "test 1");
  CHECK(reader->attachment_names() ==
        std::vector<std::string>{"calibration/white", "descriptor", "hello", "prnu_map"});
  CHECK(reader->attachment("calibration/white")->size() == 1000);
  CHECK(reader->attachment("calibration/black").error().code == ErrorCode::kNotFound);
  CHECK(reader->descriptor().value() == test_descriptor());
  CHECK(reader->hello()->serial.str() == "TEST-1");
  CHECK(reader->notes() == std::vector<std::string>{"done"});
  REQUIRE(reader->runs().size() == 2);
  for (std::size_t run = 0; run < 2; ++run) {
    CHECK(reader->runs()[run].started.run_id == run + 1);
    CHECK(reader->runs()[run].configuration.recipe == test_recipe(run == 0 ? 3 : 5));
    REQUIRE(reader->runs()[run].report);
    CHECK(reader->runs()[run].report->ledger.exposed == live[run].size());
    const std::vector<Frame> recorded = frames_of(*reader, run);
    REQUIRE(recorded.size() == live[run].size());
    for (std::size_t k = 0; k < recorded.size(); ++k) {
      CHECK(same(recorded[k], live[run][k]));
    }
  }
  CHECK(reader->frames(2).error().code == ErrorCode::kOutOfRange);
}

TEST_CASE("What was lost on the link is lost in the recording in the same places") {
  const TemporaryFile file;
  const auto live = record(file.path(), {6}, true, [](ScriptedDevice& device) {
    device.script.outgoing = [index = 0](const protocol::FrameHeader& header, Bytes frame) mutable {
      const bool lost = header.channel == protocol::Channel::kStream && index++ % 7 == 3;
      return lost ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(frame)};
    };
  });
  const Result<RecordingReader> reader = RecordingReader::open(file.path());
  REQUIRE(reader);
  CHECK(reader->verify().perfect());
  const std::vector<Frame> recorded = frames_of(*reader, 0);
  REQUIRE(recorded.size() == live[0].size());
  for (std::size_t k = 0; k < recorded.size(); ++k) {
    CHECK(same(recorded[k], live[0][k]));
  }
}

TEST_CASE("The same run twice gives the same bytes") {
  const TemporaryFile first;
  const TemporaryFile second;
  record(first.path(), {4});
  record(second.path(), {4});
  CHECK(read_file(first.path()) == read_file(second.path()));
}

// PROVES: protocol.md 6, a file cut anywhere opens up to its last whole frame and says so.
TEST_CASE("A recording cut at any byte opens, says so, and gives every whole frame before the cut") {
  const TemporaryFile file;
  const auto live = record(file.path(), {2, 2});
  const Bytes whole = read_file(file.path());
  std::size_t frames_before = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::span<const std::byte> cut = std::span(whole).first(size);
    const Result<RecordingReader> reader = RecordingReader::from_bytes(cut);
    if (size < 80) {
      REQUIRE_FALSE(reader);
      CHECK_FALSE(reader.error().remedy.empty());
      continue;
    }
    REQUIRE(reader);
    // The last 48 bytes are the end mark; the recording is whole without it, but says that it was cut.
    REQUIRE(reader->integrity().truncated);
    REQUIRE(reader->integrity().corrupted_records == 0);
    REQUIRE(reader->integrity().bytes_lost <= size);
    std::size_t frames = 0;
    REQUIRE(reader->for_each_frame([&](std::size_t run, const Frame& frame) {
      if (frame.status == FrameStatus::kComplete) {
        REQUIRE(same(frame, live[run][frame.begin.frame_id]));
        ++frames;
      }
      return Status();
    }));
    REQUIRE(frames >= frames_before);  // More bytes never give fewer frames.
    frames_before = frames;
  }
  CHECK(frames_before == 4);
}

TEST_CASE("A damaged byte anywhere is noticed or harmless, and never changes a frame") {
  const TemporaryFile file;
  const auto live = record(file.path(), {2, 2});
  const Bytes whole = read_file(file.path());
  std::size_t complete_least = 4;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    Bytes damaged = whole;
    damaged[at] ^= static_cast<std::byte>(1U << (at % 8));
    const Result<RecordingReader> reader = RecordingReader::from_bytes(damaged);
    if (at < 80) {
      REQUIRE_FALSE(reader);
      continue;
    }
    REQUIRE(reader);
    std::size_t complete = 0;
    REQUIRE(reader->for_each_frame([&](std::size_t run, const Frame& frame) {
      if (frame.status == FrameStatus::kComplete) {
        // A damaged configuration record joins two runs; the frames' own run ids stay.
        const std::size_t real_run = reader->runs().size() == 2 ? run : frame.begin.run_id - 1;
        REQUIRE(real_run < 2);
        REQUIRE(same(frame, live[real_run][frame.begin.frame_id]));
        ++complete;
      }
      return Status();
    }));
    complete_least = std::min(complete_least, complete);
    if (complete < 4) {
      REQUIRE_FALSE(reader->verify().perfect());
    }
  }
  CHECK(complete_least >= 2);
}

TEST_CASE("A recording in the making is readable without being finished") {
  const TemporaryFile file;
  Result<RecordingWriter> writer = RecordingWriter::create(file.path(), {});
  REQUIRE(writer);
  Bytes wire(protocol::kMaxFrameBytes);
  wire.resize(protocol::write_frame(wire, {}, Bytes(10'000)));
  for (int k = 0; k < 200; ++k) {
    REQUIRE(writer->wire(wire, 1));
  }
  const Result<RecordingReader> reader = RecordingReader::open(file.path());
  REQUIRE(reader);
  CHECK(reader->integrity().truncated);
  CHECK(reader->size_bytes() > 1'000'000);
}

// PROVES: issue 2, full disk while recording.
TEST_CASE("A full disk is told with a remedy; the file stays readable up to its last whole record") {
  SECTION("from the start") {
    const Result<RecordingWriter> writer = RecordingWriter::create("/dev/full", {});
    REQUIRE_FALSE(writer);
    CHECK(writer.error().code == ErrorCode::kResourceExhausted);
    CHECK_FALSE(writer.error().remedy.empty());
  }
  SECTION("later") {
    const TemporaryFile file;
    rlimit before{};
    REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{.rlim_cur = 1'500'000, .rlim_max = before.rlim_max};
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
    Result<RecordingWriter> writer = RecordingWriter::create(file.path(), {});
    REQUIRE(writer);
    Bytes wire(protocol::kMaxFrameBytes);
    wire.resize(protocol::write_frame(wire, {}, Bytes(9'999)));
    Status wrote;
    int count = 0;
    while (wrote && count < 1000) {
      wrote = writer->wire(wire, 1);
      ++count;
    }
    const Status finished = writer->finish();
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
    std::signal(SIGXFSZ, handler);
    REQUIRE_FALSE(wrote);
    CHECK(wrote.error().code == ErrorCode::kResourceExhausted);
    REQUIRE_FALSE(finished);
    CHECK(finished.error().code == ErrorCode::kResourceExhausted);
    const Result<RecordingReader> reader = RecordingReader::open(file.path());
    REQUIRE(reader);
    CHECK(reader->integrity().truncated);
    CHECK(reader->integrity().bytes_lost == 0);
    CHECK(reader->size_bytes() > 1'400'000);
  }
}

TEST_CASE("A recorder that fails during a run ends next() with its error and the device is stopped") {
  Pair pair = open_pair();
  REQUIRE(pair.host);
  REQUIRE(pair.host->configure(test_recipe(1000)));
  const TemporaryFile file;
  Result<RecordingWriter> writer = RecordingWriter::create(file.path(), {});
  REQUIRE(writer);
  {
    Result<Stream> stream = pair.host->start({.recorder = &*writer, .credit_window = 4});
    REQUIRE(stream);
    REQUIRE(stream->next());
    REQUIRE(writer->finish());  // From now on it takes nothing more.
    Result<std::optional<Frame>> frame = stream->next();
    while (frame && *frame) {
      frame = stream->next();
    }
    REQUIRE_FALSE(frame);
    CHECK(frame.error().code == ErrorCode::kFailedPrecondition);
  }
  CHECK(pair.device->aborted);
}

TEST_CASE("Other files, folders and later versions are refused with a remedy") {
  const TemporaryFile file;
  const auto code = [&](const Bytes& bytes) {
    const Result<RecordingReader> reader = RecordingReader::from_bytes(bytes);
    REQUIRE_FALSE(reader);
    CHECK_FALSE(reader.error().remedy.empty());
    return reader.error().code;
  };
  CHECK(code({}) == ErrorCode::kDataLoss);
  CHECK(code(Bytes(1000, std::byte{'P'})) == ErrorCode::kInvalidArgument);
  record(file.path(), {1});
  Bytes later = read_file(file.path());
  later[8] = std::byte{2};
  const std::uint32_t crc = protocol::crc32c(std::span<const std::byte>(later).first(76));
  protocol::store_le(later.data() + 76, crc);
  CHECK(code(later) == ErrorCode::kInvalidArgument);
  CHECK(RecordingReader::open("/nowhere/at/all.scat").error().code == ErrorCode::kNotFound);
  CHECK(RecordingReader::open("/").error().code == ErrorCode::kInvalidArgument);
  // A pipe that nobody writes to: an answer, not a wait.
  const std::string pipe = file.path().string() + ".pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  CHECK(RecordingReader::open(pipe).error().code == ErrorCode::kInvalidArgument);
  std::filesystem::remove(pipe);
  CHECK(RecordingWriter::create("/nowhere/at/all.scat", {}).error().code == ErrorCode::kNotFound);
  CHECK(RecordingWriter::create("/", {}).error().code == ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace scatter::device::test
