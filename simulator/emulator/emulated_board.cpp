#include "simulator/emulator/emulated_board.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "firmware/backplane/shared_memory.h"

namespace scatter::simulator {
namespace {

constexpr std::uint64_t kLongestSleep_us = 1'000'000;
constexpr std::chrono::milliseconds kCheckEvery{20};
// Half a frame of a host that has been silent for this long is broken, as the firmware's own rule is.
constexpr std::uint64_t kHostSilence_us = 1'000'000;

Status check_options(const InstrumentOptions& options) {
  const auto refuse = [](std::string_view what, std::string remedy) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("board mps2_an500: {}", what), std::move(remedy));
  };
  const FaultPlan& faults = options.faults;
  const bool link = std::ranges::any_of(faults.link, &LinkRates::any) || !faults.stalls.empty() ||
                    !faults.disconnects.empty();
  if (link || !faults.reset_at_frame.empty()) {
    return refuse("of the faults it has only readout and led",
                  "give the others to a simulator without --board");
  }
  if (options.calibration == CalibrationHeld::kStale) {
    return refuse("it cannot begin with stale calibrations", "use calibration=session or none");
  }
  if (!options.flash_file.empty()) {
    return refuse("its memory is kept in a folder, not in a flash file", "use --state FOLDER");
  }
  return {};
}

bool is_file(const std::filesystem::path& path) {
  std::error_code problem;
  return std::filesystem::is_regular_file(path, problem);
}

}  // namespace

Result<FirmwareFiles> find_firmware(const std::filesystem::path& firmware) {
  constexpr std::string_view kBootloader = "bootloader.elf";
  constexpr std::string_view kFirmware = "openscatter.scfw";
  constexpr std::string_view kRemedy = "build it with ./run firmware, or name it with --firmware FILE";
  std::vector<std::filesystem::path> folders;
  if (!firmware.empty()) {
    if (!is_file(firmware)) {
      return fail(ErrorCode::kNotFound, fmt::format("{}: no such file", firmware.string()),
                  std::string(kRemedy));
    }
    folders.push_back(firmware.parent_path());
  }
  std::error_code problem;
  auto folder = std::filesystem::read_symlink("/proc/self/exe", problem).parent_path();
  for (int up = 0; up < 4 && !folder.empty(); ++up, folder = folder.parent_path()) {
    folders.push_back(folder / "firmware");
  }
  for (const auto& each : folders) {
    FirmwareFiles files{.bootloader = each / kBootloader,
                        .firmware = firmware.empty() ? each / kFirmware : firmware};
    if (is_file(files.bootloader) && is_file(files.firmware)) {
      return files;
    }
  }
  return fail(ErrorCode::kNotFound,
              fmt::format("no firmware for mps2_an500: {} and {} are not there", kBootloader, kFirmware),
              std::string(kRemedy));
}

Result<std::unique_ptr<EmulatedBoard>> EmulatedBoard::start(const EmulatedBoardOptions& options) {
  if (Status good = check_options(options.instrument); !good) {
    return std::unexpected(std::move(good.error()));
  }
  InstrumentOptions instrument = options.instrument;
  instrument.clock = ClockMode::kVirtual;
  auto board = VirtualBoard::make(instrument);
  if (!board) {
    return std::unexpected(std::move(board.error()));
  }
  auto state = BoardState::open(options.state);
  if (!state) {
    return std::unexpected(std::move(state.error()));
  }
  if (options.factory_set) {
    if (Status done = provide_factory_set(*state, **board); !done) {
      return std::unexpected(std::move(done.error()));
    }
  }
  if (state->fresh() && !options.firmware.empty()) {
    if (Status done = install_firmware(*state, options.firmware); !done) {
      return std::unexpected(std::move(done.error()));
    }
  }
  auto process =
      QemuProcess::start({.kernel = options.bootloader,
                          .shared_memory = state->shared_memory_file(),
                          .eeprom = options.eeprom ? state->eeprom_file() : std::filesystem::path{}});
  if (!process) {
    return std::unexpected(std::move(process.error()));
  }
  state->let_go();
  std::unique_ptr<EmulatedBoard> emulated(
      new EmulatedBoard(std::move(*board), std::move(*state), std::move(*process)));
  const BenchPace pace = options.instrument.clock == ClockMode::kReal ? BenchPace::kReal : BenchPace::kHaste;
  emulated->bench_ =
      std::make_unique<BenchService>(*emulated->board_, pace,
                                     emulated->state_.shared_memory().subspan(
                                         firmware::backplane::kFrameOffset, firmware::backplane::kFrameBytes),
                                     emulated->process_, options.conduct);
  if (Status booted = emulated->wait_for_boot(); !booted) {
    return std::unexpected(std::move(booted.error()));
  }
  return emulated;
}

EmulatedBoard::EmulatedBoard(std::unique_ptr<VirtualBoard> board, BoardState state, QemuProcess process)
    : board_(std::move(board)),
      state_(std::move(state)),
      process_(std::move(process)),
      process_id_(process_.id()) {}

EmulatedBoard::~EmulatedBoard() {
  bench_.reset();
  process_.kill();
}

Status EmulatedBoard::wait_for_boot() {
  const auto deadline = std::chrono::steady_clock::now() + kBootTimeout;
  while (!take_boots()) {
    const Result<std::uint64_t> ran = run_ready();
    if (!ran) {
      return std::unexpected(ran.error());
    }
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) {
      return fail(ErrorCode::kDeadlineExceeded,
                  fmt::format("board mps2_an500: nothing came from the firmware within {} s",
                              kBootTimeout.count() / 1000),
                  "check that the bootloader is that of ./run firmware");
    }
    std::vector<pollfd> files;
    add_waits(files);
    (void)::poll(files.data(), files.size(), static_cast<int>(std::min<std::int64_t>(left.count(), 1000)));
  }
  return {};
}

void EmulatedBoard::attach() {
  relay_.attach();
}
void EmulatedBoard::detach() {
  relay_.detach();
}

std::size_t EmulatedBoard::host_write(std::span<const std::byte> bytes) {
  const std::uint64_t now = now_us();
  if (now - heard_host_us_ >= kHostSilence_us) {
    relay_.host_was_silent();
  }
  heard_host_us_ = now;
  const std::size_t count = std::min(bytes.size(), relay_.writable());
  relay_.from_host(bytes.first(count));
  (void)pump();  // At once: a request's way is most of a round trip.
  return count;
}

std::uint64_t EmulatedBoard::now_us() const {
  const auto elapsed = std::chrono::steady_clock::now() - began_;
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(elapsed).count());
}

Result<std::uint64_t> EmulatedBoard::run_ready() {
  if (Status alive = check_alive(); !alive) {
    return std::unexpected(std::move(alive.error()));
  }
  while (pump()) {
  }
  if (bench_->has_news()) {
    if (std::optional<Error> failure = bench_->failure()) {
      // A line that broke is what the bench saw of QEMU's end; how it ended says more.
      Status alive = process_.check();
      return std::unexpected(alive ? std::move(*failure) : std::move(alive.error()));
    }
    (void)take_boots();
  }
  return now_us() + kLongestSleep_us;
}

/// The line brings bytes one by one: what need not be asked each time is asked now and then.
Status EmulatedBoard::check_alive() {
  const auto now = std::chrono::steady_clock::now();
  if (!line_closed_ && now - checked_ < kCheckEvery) {
    return {};
  }
  checked_ = now;
  return process_.check();
}

/// True when bytes moved between line and relay.
bool EmulatedBoard::pump() {
  bool moved = false;
  std::array<std::byte, 4096> bytes;
  if (const std::size_t room = std::min(bytes.size(), relay_.room_from_device()); room > 0) {
    const ssize_t count = ::recv(process_.uart0().number(), bytes.data(), room, MSG_DONTWAIT);
    if (count > 0) {
      relay_.from_device(std::span<const std::byte>(bytes).first(static_cast<std::size_t>(count)));
      moved = true;
    }
    line_closed_ = line_closed_ || count == 0;
  }
  if (const std::span<const std::byte> out = relay_.to_device(); !out.empty()) {
    const ssize_t count =
        ::send(process_.uart0().number(), out.data(), out.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count > 0) {
      relay_.sent_to_device(static_cast<std::size_t>(count));
      moved = true;
    }
  }
  return moved;
}

/// A start of the board breaks the host's connection, once: bootloader and firmware both speak.
bool EmulatedBoard::take_boots() {
  const auto boots = bench_->take_boots();
  for (const auto& booted : boots) {
    const bool same_start = booted.bootloader == 0 && bootloader_spoke_;
    bootloader_spoke_ = booted.bootloader != 0;
    if (!same_start) {
      // What it had sent before lies in the line already, unless the host is slow to take it.
      while (pump()) {
      }
      relay_.device_gone();
    }
  }
  return !boots.empty();
}

void EmulatedBoard::add_waits(std::vector<pollfd>& files) {
  int events = relay_.to_device().empty() ? 0 : POLLOUT;
  if (relay_.room_from_device() > 0) {
    events |= POLLIN;
  }
  files.push_back({process_.uart0().number(), static_cast<short>(events), 0});
  files.push_back({bench_->news_descriptor(), POLLIN, 0});
  if (process_.ended_descriptor() >= 0) {
    files.push_back({process_.ended_descriptor(), POLLIN, 0});
  }
}

}  // namespace scatter::simulator
