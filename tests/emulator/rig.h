// What the tests under QEMU share: the images, a served board, and the instrument of this process beside it.
#pragma once

#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "host_sdk/device/device.h"
#include "host_sdk/firmware_files/package.h"
#include "simulator/emulator/emulated_board.h"
#include "simulator/instrument/server.h"

namespace scatter::emulator {

/// The images of ./run firmware: in $SCATTER_FIRMWARE_DIR, else found from the running program.
[[nodiscard]] inline Result<simulator::FirmwareFiles> firmware_files() {
  const char* folder = std::getenv("SCATTER_FIRMWARE_DIR");
  return simulator::find_firmware(folder == nullptr ? std::filesystem::path{}
                                                    : std::filesystem::path(folder) / "openscatter.scfw");
}

/// A folder of its own, gone at the end.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "scatter-emulator-XXXXXX").string();
    REQUIRE(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// profile=binned, no waiting for light, and what `query` says.
[[nodiscard]] inline simulator::EmulatedBoardOptions board_options(std::string_view query = "") {
  const auto files = firmware_files();
  REQUIRE(files.has_value());
  simulator::InstrumentOptions defaults;
  defaults.profile = simulator::Profile::kBinned;
  const auto instrument = simulator::parse_instrument_options(query, defaults);
  REQUIRE(instrument.has_value());
  return {.instrument = *instrument, .bootloader = files->bootloader, .firmware = files->firmware};
}

/// A board under QEMU, served on a socket by a thread of its own. `before` has it for itself first.
class Emulated {
 public:
  explicit Emulated(const simulator::EmulatedBoardOptions& options,
                    const std::function<void(simulator::EmulatedBoard&)>& before = {}) {
    auto board = simulator::EmulatedBoard::start(options);
    if (!board) {
      FAIL(board.error().what);
    }
    board_ = std::move(*board);
    if (before) {
      before(*board_);
    }
    auto server = simulator::Server::listen("unix:" + (folder_ / "host.sock").string(), *board_);
    REQUIRE(server.has_value());
    server_ = std::move(*server);
    thread_ = std::jthread([this](const std::stop_token& stop) { served_ = server_->serve(stop); });
  }
  ~Emulated() { stop(); }
  Emulated(const Emulated&) = delete;
  Emulated& operator=(const Emulated&) = delete;

  /// Ends the service; the board goes on until the end of this object.
  void stop() {
    if (thread_.joinable()) {
      thread_.request_stop();
      thread_.join();
      server_.reset();
    }
  }
  /// kill -9. The service ends with an error.
  void cut_power() {
    ::kill(board_->process_id(), SIGKILL);
    thread_.join();
    CHECK_FALSE(served_.has_value());
    server_.reset();
  }
  [[nodiscard]] simulator::EmulatedBoard& board() { return *board_; }
  [[nodiscard]] const std::string& uri() const { return server_->address(); }
  [[nodiscard]] device::Device open() const {
    auto device = try_open();
    if (!device) {
      FAIL(device.error().what);
    }
    return std::move(*device);
  }
  /// While the board restarts: a connection made before its reset ends with it.
  [[nodiscard]] device::Device open_soon() const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    auto device = try_open();
    while (!device && device.error().code == ErrorCode::kDisconnected &&
           std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      device = try_open();
    }
    if (!device) {
      FAIL(device.error().what);
    }
    return std::move(*device);
  }
  [[nodiscard]] Result<device::Device> try_open(const device::Wait& wait = {std::chrono::seconds(20),
                                                                            {}}) const {
    device::OpenOptions options;
    options.wait = wait;
    return device::Device::open(server_->address(), options);
  }

 private:
  Folder folder_;
  std::unique_ptr<simulator::EmulatedBoard> board_;
  std::unique_ptr<simulator::Server> server_;
  Status served_;
  std::jthread thread_;
};

}  // namespace scatter::emulator
