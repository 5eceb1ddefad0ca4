#include <utility>

#include "host_sdk/device/frame_assembler.h"
#include "host_sdk/device/ledger.h"
#include "host_sdk/device/recording_contents.h"
#include "host_sdk/device/recording_reader.h"

namespace scatter::device {

namespace {

// Pages behind the cursor are given back in pieces of this size, so that a recording of any length
// costs little memory.
constexpr std::uint64_t kForgetBytes = 16U << 20U;

AssemblerLimits limits_of(const RecordingReader::Impl& contents, std::size_t run) {
  AssemblerLimits limits;
  limits.max_open = 16;
  limits.run_id = contents.run_ids[run];
  if (run > 0) {
    limits.after_run = contents.run_ids[run - 1];
  }
  if (const std::uint32_t epoch = contents.runs[run].configuration.epoch; epoch != 0) {
    limits.epoch = epoch;
  }
  return limits;
}

}  // namespace

struct RunCursor::State {
  State(const RecordingReader::Impl& from, std::size_t run_index)
      : contents(&from),
        run(from.runs[run_index]),
        assembler(from.pool, limits_of(from, run_index)),
        at(run.first_record) {
    if (at < run.end_record) {
      forgotten = from.table.records()[at].offset;
    }
  }

  const RecordingReader::Impl* contents;
  const RecordedRun& run;
  FrameAssembler assembler;
  std::size_t at;
  std::uint64_t forgotten = 0;
  std::uint64_t damaged = 0;
  std::uint64_t delivered = 0;
  std::uint64_t corrupt = 0;

  void read(std::size_t record) {
    const recording::RecordRef& ref = contents->table.records()[record];
    if (ref.type != recording::RecordType::kWire) {
      return;
    }
    const auto frame = contents->table.wire(record);
    if (!frame) {
      ++damaged;
      return;
    }
    if (frame->header().channel == protocol::Channel::kStream) {
      assembler.accept(*frame, contents->table.host_time_unix_ns(record));
    }
    if (ref.offset - forgotten > kForgetBytes) {
      contents->file.forget(forgotten, ref.offset);
      forgotten = ref.offset;
    }
  }
};

Result<RunCursor> RecordingReader::frames(std::size_t run) const {
  if (run >= impl_->runs.size()) {
    return fail(ErrorCode::kOutOfRange,
                impl_->name + ": run " + std::to_string(run) + " was asked for, it has " +
                    std::to_string(impl_->runs.size()),
                "choose a run that exists");
  }
  return RunCursor(std::make_unique<RunCursor::State>(*impl_, run));
}

RunCursor::RunCursor(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
RunCursor::RunCursor(RunCursor&&) noexcept = default;
RunCursor& RunCursor::operator=(RunCursor&&) noexcept = default;
RunCursor::~RunCursor() = default;

Result<std::optional<Frame>> RunCursor::next() {
  State& state = *state_;
  for (;;) {
    if (std::optional<Frame> frame = state.assembler.pop()) {
      state.delivered += frame->status == FrameStatus::kComplete ? 1U : 0U;
      state.corrupt += frame->status == FrameStatus::kCorrupt ? 1U : 0U;
      return frame;
    }
    if (state.at < state.run.end_record) {
      state.read(state.at++);
    } else if (state.assembler.open() != 0) {
      state.assembler.flush();
    } else {
      return std::nullopt;
    }
  }
}

RecordedRunSummary RunCursor::summary() const {
  RecordedRunSummary out;
  protocol::Ledger device_half;
  if (state_->run.report) {
    device_half = state_->run.report->ledger;
  } else {
    device_half.exposed = state_->assembler.seen_until();
  }
  out.ledger = completed_ledger(device_half, state_->delivered, 0, state_->corrupt);
  out.integrity = state_->contents->integrity;
  out.integrity.corrupted_records += state_->damaged;
  return out;
}

}  // namespace scatter::device
