#include "simulator/emulator/bench_service.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stop_token>
#include <utility>

namespace scatter::simulator {
namespace {

constexpr int kLongestWait_ms = 1000;

/// 0 deg C on the scale of the thermometers.
constexpr std::int32_t kZeroCelsius_mK = 273'150;

void signal(const FileDescriptor& event) {
  const std::uint64_t one = 1;
  (void)!::write(event.number(), &one, sizeof one);
}

Status show(QmpClient& control, std::int32_t sensor_mK, std::int32_t led_board_mK) {
  if (Status done = control.set_temperature("sensor", sensor_mK - kZeroCelsius_mK); !done) {
    return done;
  }
  return control.set_temperature("led_board", led_board_mK - kZeroCelsius_mK);
}

int wait_ms(std::optional<BackplaneBench::Clock::time_point> due) {
  if (!due) {
    return kLongestWait_ms;
  }
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(*due - BackplaneBench::Clock::now());
  return static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, kLongestWait_ms));
}

}  // namespace

BenchService::BenchService(VirtualBoard& board, BenchPace pace, std::span<std::byte> frame,
                           QemuProcess& process, const BenchConduct& conduct)
    : news_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      line_(process.uart1()),
      process_(process),
      bench_(board, pace,
             {.frame = frame,
              .show_temperatures =
                  [&process](std::int32_t sensor_mK, std::int32_t led_board_mK) {
                    return show(process.control(), sensor_mK, led_board_mK);
                  },
              .booted =
                  [this](const firmware::backplane::Booted& booted) {
                    const std::scoped_lock lock(mutex_);
                    boots_.push_back(booted);
                    tell();
                  }}),
      conduct_(conduct) {
  bench_.conduct(conduct);
  bench_.warm_up();
  thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
}

BenchService::~BenchService() {
  thread_.request_stop();
  signal(wake_);
}

void BenchService::tell() {
  has_news_.store(true, std::memory_order_release);
  signal(news_);
}

std::vector<firmware::backplane::Booted> BenchService::take_boots() {
  const std::scoped_lock lock(mutex_);
  has_news_.store(failure_.has_value(), std::memory_order_release);
  std::uint64_t count = 0;
  (void)!::read(news_.number(), &count, sizeof count);
  return std::exchange(boots_, {});
}

std::optional<Error> BenchService::failure() const {
  const std::scoped_lock lock(mutex_);
  return failure_;
}

BackplaneBench::Statistics BenchService::statistics() const {
  const std::scoped_lock lock(mutex_);
  return statistics_;
}

void BenchService::conduct(const BenchConduct& conduct) {
  const std::scoped_lock lock(mutex_);
  conduct_ = conduct;
}

void BenchService::put(std::shared_ptr<const Sample> sample) {
  std::unique_lock lock(mutex_);
  sample_ = std::move(sample);
  signal(wake_);
  settled_.wait(lock, [this] { return sample_ == nullptr || failure_.has_value(); });
}

/// What others have asked for in the meantime.
void BenchService::settle() {
  const std::scoped_lock lock(mutex_);
  std::uint64_t count = 0;
  (void)!::read(wake_.number(), &count, sizeof count);
  bench_.conduct(conduct_);
  if (sample_) {
    bench_.put(std::move(sample_));
    sample_ = nullptr;
    settled_.notify_all();
  }
}

Status BenchService::turn(BackplaneBench::Clock::time_point now) {
  std::array<std::byte, 1024> bytes;
  const ssize_t count = ::recv(line_.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) {
    return fail(ErrorCode::kDisconnected, "QEMU has closed the backplane's line",
                "start the simulator again");
  }
  const auto received =
      std::span<const std::byte>(bytes).first(count > 0 ? static_cast<std::size_t>(count) : 0);
  if (Status done = bench_.receive(received, now); !done) {
    return done;
  }
  std::vector<std::byte>& out = bench_.to_board();
  const ssize_t sent =
      out.empty() ? 0 : ::send(line_.number(), out.data(), out.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (sent > 0) {
    out.erase(out.begin(), out.begin() + sent);
  }
  return {};
}

Status BenchService::loop(const std::stop_token& stop) {
  if (Status shown = bench_.show_temperatures(); !shown) {
    return shown;
  }
  if (Status runs = process_.resume(); !runs) {
    return runs;
  }
  while (!stop.stop_requested()) {
    const short events = static_cast<short>(bench_.to_board().empty() ? POLLIN : POLLIN | POLLOUT);
    std::array<pollfd, 2> files{pollfd{wake_.number(), POLLIN, 0}, pollfd{line_.number(), events, 0}};
    (void)::poll(files.data(), files.size(), wait_ms(bench_.due()));
    settle();
    if (Status done = turn(BackplaneBench::Clock::now()); !done) {
      return done;
    }
    const std::scoped_lock lock(mutex_);
    statistics_ = bench_.statistics();
  }
  return {};
}

void BenchService::serve(const std::stop_token& stop) {
  if (Status done = loop(stop); !done) {
    const std::scoped_lock lock(mutex_);
    failure_ = std::move(done.error());
    settled_.notify_all();
    tell();
  }
}

}  // namespace scatter::simulator
