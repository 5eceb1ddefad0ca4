// One run on the host's side. Internal to this wing: programs use Stream.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>

#include "host_sdk/device/frame_assembler.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/device/session.h"
#include "host_sdk/device/stream.h"

namespace scatter::device {

struct StreamPlan {
  RecordingWriter* recorder = nullptr;
  std::uint32_t window = 8;
  bool live = false;  ///< Live preview: the newest frames matter, older ones give way.
};

struct Stream::State final : WireSink {
  State(std::shared_ptr<Session> session, const AssemblerLimits& limits, const StreamPlan& plan);
  ~State();
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  /// Sends Start; `epoch` is the configuration's.
  [[nodiscard]] Status start(std::uint32_t epoch, const Wait& wait);
  [[nodiscard]] Result<std::optional<Frame>> next(const Wait& wait);
  [[nodiscard]] Status stop(TimePoint deadline, const std::stop_token& stop);
  [[nodiscard]] Result<RunSummary> abort(const Wait& wait);
  [[nodiscard]] RunSummary summary() const;
  [[nodiscard]] TimePoint session_now() const { return session_->now(); }

  void on_stream(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) override;
  void on_message(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) override;

  std::atomic<bool> stop_requested{false};
  protocol::Started started;

 private:
  [[nodiscard]] Frame hand_out(Frame frame);
  [[nodiscard]] Status grant(std::uint32_t until, const std::stop_token& stop);
  /// The device has been silent: asks how it is and mends what a lost message broke.
  [[nodiscard]] Status inquire(TimePoint deadline, const std::stop_token& stop);
  /// Live preview drops frames at the source, ids included, so grants must catch up with ids that
  /// the host cannot see: each is twice the last until something comes.
  [[nodiscard]] Status catch_up(const std::stop_token& stop);
  [[nodiscard]] Error explain_restart(const std::stop_token& stop);
  void record(const protocol::Frame& frame, std::uint64_t host_time_unix_ns);
  void take_report(const protocol::RunReport& report);
  /// Nothing more will come: settles what is open and lets the device be used again.
  void finish();

  std::shared_ptr<Session> session_;
  FrameAssembler assembler_;
  StreamPlan plan_;
  std::uint32_t granted_until_;
  std::uint32_t catch_up_ = 0;  ///< Live preview: size of the next grant into the unknown.
  int holds_ = 0;               ///< Inquiries in a row that found the device holding.
  bool running_ = false;
  bool finished_ = false;
  bool stop_sent_ = false;
  std::optional<protocol::RunReport> report_;
  std::optional<Error> recorder_error_;
  std::optional<Error> broken_;  ///< Why no frames will come any more.
  std::uint64_t delivered_ = 0;
  std::uint64_t corrupt_ = 0;
  std::uint64_t lost_host_ = 0;
  TimePoint last_activity_{};
  LinkStatistics before_;
  LinkStatistics after_;
};

}  // namespace scatter::device
